"""The recording of the traffic between clients and a controller, by a transparent proxy."""

from collections.abc import AsyncIterator, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Final

from scaraspec.api.viewer import has_viewer
from scaraspec.transports.url import Rfcomm, Serial, Tcp, join_host_port, parse, split_host_port
from scaraspec.user_message import UserMessage
from scaraspec_recorder import recording as recorder
from scaraspec_recorder.config import ConfigError, RobotConfig, TimestampSource
from scaraspec_recorder.recording import DRAIN_S, Recording
from scaraspec_recorder.sinks.sink import SinkFactory
from scaraspec_recorder.tap import serial_relay
from scaraspec_recorder.tap.routes import Mode, Route, route
from scaraspec_recorder.tap.tcp import is_loopback

LOOPBACK: Final = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class RecordingPlan:
    """A robot and its link, checked.

    Attributes:
        robot: The configuration of its recording.
        controller: The link of the controller.
        listen: The addresses on which the recorder listens.
        client_line: The serial line of the client; None if clients connect over TCP.
    """

    robot: RobotConfig
    controller: Tcp | Serial | Rfcomm
    listen: tuple[tuple[str, int], ...]
    client_line: serial_relay.SerialAddress | None = None

    @classmethod
    def of(cls, robot: RobotConfig) -> "RecordingPlan":
        """Check the links of a robot.

        Raises:
            ConfigError: The links or options contradict each other.
            UrlError: A URL is invalid.
        """
        controller, client_line = parse(robot.url), None
        if any("://" in text for text in robot.listen):
            client_line, listen = _client_line(robot.listen), [(LOOPBACK, 0)]
        else:
            listen = [_address(text) for text in robot.listen]
        if robot.mode is not Mode.EXPLICIT and (client_line or not isinstance(controller, Tcp)):
            raise ConfigError(
                UserMessage("the mode {mode} needs TCP on both sides", mode=robot.mode)
            )
        if (
            robot.injection
            and not robot.i_mean_it
            and not all(is_loopback(host) for host, _ in listen)
        ):
            raise ConfigError(
                UserMessage(
                    "faults would be injected at {listen}, and other machines can connect: add "
                    "--i-mean-it if this is intended",
                    listen=" and ".join(robot.listen),
                )
            )
        return cls(robot, controller, tuple(listen), client_line)

    @property
    def route(self) -> Route:
        """The route to the controller."""
        if isinstance(self.controller, Tcp):
            return route(self.robot.mode, *self.controller)
        return serial_relay.SerialRoute(self.controller)

    def sinks(self, viewer_url: str | None) -> tuple[SinkFactory, ...]:
        """Return the factories of the sinks: the files, and the viewer if there is one."""
        needs_login = self.controller.needs_login
        session = {"controller": str(self.controller)}
        files = self.robot.sink(session, draw=has_viewer(), needs_login=needs_login)
        if viewer_url is None:
            return (files,)
        from scaraspec_recorder.sinks.rerun.live import live_sink  # noqa: PLC0415 - for a viewer

        return files, partial(live_sink, url=viewer_url, needs_login=needs_login)

    def client_relay(self, address: tuple[str, int]) -> AbstractAsyncContextManager[object]:
        """Connect the serial line of the client, if there is one, to the recorder's address."""
        if not self.client_line:
            return nullcontext()
        return serial_relay.relay_serial_client(self.client_line, address)


def _client_line(listen: Sequence[str]) -> serial_relay.SerialAddress:
    """Parse the URL of the client's serial line.

    Raises:
        ConfigError: It is not a serial line, or not the only address.
        UrlError: The URL is invalid.
    """
    url = next(text for text in listen if "://" in text)
    client = parse(url)
    if isinstance(client, Tcp):
        raise ConfigError(
            UserMessage(
                "{url} is not an address to listen on: write {address}",
                url=url,
                address=join_host_port(*client),
            )
        )
    if len(listen) > 1:
        raise ConfigError(
            UserMessage("{url} cannot be combined with other addresses to listen on", url=url)
        )
    return client


def _address(text: str) -> tuple[str, int]:
    """Parse an address to listen on; the host ``*`` is all addresses.

    Raises:
        ConfigError: The host is missing.
        UrlError: The address is invalid.
    """
    port = text.removeprefix(":")
    if port.isdigit():
        raise ConfigError(
            UserMessage(
                "{text} has no host: write HOST:PORT, as {loopback}:{port}, or *:{port} for all "
                "addresses of this machine",
                text=text,
                loopback=LOOPBACK,
                port=port,
            )
        )
    return split_host_port(text, lowest_port=0)


@asynccontextmanager
async def record(
    robot: RobotConfig, *, viewer_url: str | None = None, drain_s: float = DRAIN_S
) -> AsyncIterator[Recording]:
    """Relay clients to a controller and record the traffic while the context is active.

    The link never waits for the recording. Two processes are started: one forwards, one writes.

    Args:
        robot: URL of the controller, listening address, folder and limits of the recording;
            ``RobotConfig("robot", "tcp://192.168.1.2")`` has defaults for the rest.
        viewer_url: URL of a Rerun viewer that shows the traffic; None for none.
        drain_s: How long to wait at the end until everything is written, in seconds.

    Yields:
        The recording: its address, its progress, and marks.

    Raises:
        ConfigError: The links or options contradict each other.
        UrlError: A URL is invalid.
        OSError: An address or the folder cannot be used, or another recorder uses the folder.
    """
    plan = RecordingPlan.of(robot)
    async with (
        recorder.record(
            plan.route,
            plan.listen,
            robot.out,
            plan.sinks(viewer_url),
            injection=robot.injection,
            kernel_time=robot.timestamps is TimestampSource.KERNEL,
            file_mode=robot.file_mode,
            durable=robot.durable,
            upload=robot.upload,
        ) as recording,
        plan.client_relay(recording.address),
    ):
        recording.drain_s = drain_s
        yield recording
