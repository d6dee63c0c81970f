"""Operations: one method for each command, written once for both clients.

A method describes a `Call`: how to prepare the request and how to convert the result. `Client`
performs the call and blocks; `AsyncClient` performs it and is awaited. A new command needs one new
method here.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from scaraspec.client.core import ClientCore
from scaraspec.client.local_files import check_new, check_regular, write_new
from scaraspec.client.pending_operation import PendingOperation, Progress
from scaraspec.client.results import RunningProgram, Status
from scaraspec.protocol.commands import (
    JointValues,
    MoveTarget,
    Network,
    PasswordChange,
    Point,
    PortValue,
    Pose,
)
from scaraspec.protocol.fields import Clock, Diagnostics, PayloadError
from scaraspec.protocol.payloads import JogDirection
from scaraspec.protocol.readings import Dialect
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from collections.abc import Coroutine

    from scaraspec.client.aio import AsyncClient, AsyncPending
    from scaraspec.client.blocking import Client, Pending

P = ParamSpec("P")
T = TypeVar("T")

_CLOCK = Clock("time")

Text = str | bytes
"""A name or a password.

A `str` is encoded and decoded with the ``text_encoding`` of the dialect, UTF-8 by default. Bytes
that are not valid in it are decoded to surrogate escapes, which encode to the same bytes (T/8).
"""


@dataclass(frozen=True, slots=True)
class Call(Generic[T]):
    """An operation with its arguments.

    Attributes:
        prepare: Creates the pending operation with a core.
        convert: Converts the value of the pending operation to the result for the caller.
        progress: Callback for the progress of a file transfer.
    """

    prepare: Callable[[ClientCore], PendingOperation]
    convert: Callable[[Any], T]
    progress: Progress | None = None


class operation(Generic[P, T]):  # noqa: N801 - a decorator
    """Decorator: turns a method that describes a `Call` into one that performs it."""

    def __init__(self, describe: Callable[Concatenate[Any, P], Call[T]]) -> None:
        self.describe = describe
        self.__doc__ = describe.__doc__

    @overload
    def __get__(self, client: None, owner: type) -> "operation[P, T]": ...
    @overload
    def __get__(self, client: "Client", owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(
        self, client: "AsyncClient", owner: type
    ) -> "Callable[P, Coroutine[Any, Any, T]]": ...
    def __get__(self, client: Any, owner: type) -> Any:
        """Return the method, bound to a client."""
        if client is None:
            return self
        return lambda *args, **kwargs: client.perform(self.describe(client, *args, **kwargs))


class start_method(Generic[P]):  # noqa: N801 - a decorator
    """The ``start_`` form of a two-stage operation: it returns after the first reply.

    It returns a `Pending` or an `AsyncPending`, whose `wait` waits for the final result and raises
    `Refused` if the controller refused the command.
    """

    def __init__(self, whole: operation[P, None]) -> None:
        self.describe = whole.describe
        self.__doc__ = whole.__doc__

    @overload
    def __get__(self, client: None, owner: type) -> "start_method[P]": ...
    @overload
    def __get__(self, client: "Client", owner: type) -> "Callable[P, Pending]": ...
    @overload
    def __get__(
        self, client: "AsyncClient", owner: type
    ) -> "Callable[P, Coroutine[Any, Any, AsyncPending]]": ...
    def __get__(self, client: Any, owner: type) -> Any:
        """Return the method, bound to a client."""
        if client is None:
            return self
        return lambda *args, **kwargs: client.start(self.describe(client, *args, **kwargs))


def _command_call(
    name: str, value: Any = None, convert: Callable[[Any], Any] = lambda value: value
) -> Call[Any]:
    """Describe the call of a command from the command table."""
    return Call(lambda core: core.command(name, value), convert)


class Operations(ABC):
    """The commands of a client.

    Every method may raise:

    - `PayloadError`: The document does not allow this value. Nothing was sent.
    - `LoginFailed`: The login failed, or no login has succeeded yet.
    - `Refused`, `Failed`, `Interrupted`: The controller did not execute the command. `.code` is
      the reason.
    - `ReplyTimeout`, `LinkLost`: The controller did not reply. It is unknown whether it executed
      the command: call `get_status` first, also after a new connection (A-2-9).
    - `ProtocolError`: The reply cannot be decoded.

    Two-stage methods return after the final result, for which there is no timeout (A-3-15). Their
    ``start_`` forms return after the first reply.
    """

    @property
    @abstractmethod
    def dialect(self) -> Dialect:
        """The readings in use."""

    # 4.1 - 4.8: session and settings

    @operation
    def login(self, password: Text) -> Call[None]:
        """Log in. The client sends nothing else before a login has succeeded (4.1, L104)."""
        return _command_call("login", self._bytes(password))

    @operation
    def set_password(self, old: Text, new: Text) -> Call[None]:
        """Replace the password `old` by `new` (4.2, L123-125)."""
        return _command_call("set_password", PasswordChange(self._bytes(old), self._bytes(new)))

    @operation
    def get_network(self) -> Call[Network]:
        """Return the IP address, subnet mask and gateway of the controller (4.3, L145-153)."""
        return _command_call("get_network")

    @operation
    def set_network(self, ip: str, mask: str, gateway: str) -> Call[None]:
        """Set IP address, subnet mask and gateway (4.4, L157-162).

        The controller may close the link afterwards.

        Args:
            ip: IPv4 address in dotted decimal.
            mask: Subnet mask in dotted decimal.
            gateway: IPv4 address of the gateway in dotted decimal.
        """
        return _command_call("set_network", Network(ip, mask, gateway))

    @operation
    def set_time(self, time: datetime | str) -> Call[None]:
        """Set the clock of the controller (4.5, L169; A-4.5-1).

        Args:
            time: A datetime, or text of the form YYYYMMDDHHMMSS. Fractions of a second and the
                time zone are not sent.
        """
        return _command_call("set_time", time if isinstance(time, datetime) else _time(time))

    @operation
    def get_time(self) -> Call[datetime]:
        """Return the clock of the controller, a datetime without time zone (4.6, L181-189)."""
        return _command_call("get_time")

    @operation
    def get_version(self) -> Call[str]:
        """Return the software version of the controller (4.7, L193-203)."""
        return _command_call("get_version")

    @operation
    def get_status(self) -> Call[Status]:
        """Return the robot's state (idle, running or error) and its status code (4.8, L207-217)."""
        return _command_call("get_status", convert=Status.of)

    # 4.9 - 4.16: programs

    @operation
    def get_running_program(self) -> Call[RunningProgram | None]:
        """Return the running program and its run time; None if no program runs (4.9, L221-237)."""
        return _command_call(
            "get_running_program",
            convert=lambda run: run and RunningProgram(self._text(run.name), run.run_time_s),
        )

    @operation
    def list_programs(self) -> Call[tuple[str, ...]]:
        """Return the names of all programs, in the order of the controller (4.10, L241-251)."""
        return _command_call("list_programs", convert=lambda names: tuple(map(self._text, names)))

    @operation
    def delete_program(self, name: Text) -> Call[None]:
        """Delete the program `name` (4.11, L255-263)."""
        return _command_call("delete_program", self._bytes(name))

    @operation
    def get_default_program(self) -> Call[str | None]:
        """Return the name of the default program; None if none is set (4.12, L267-275)."""
        return _command_call("get_default_program", convert=lambda name: self._text(name) or None)

    @operation
    def set_default_program(self, name: Text) -> Call[None]:
        """Set the default program; it may take effect at the next power-on (4.13; A-4.12-3)."""
        return _command_call("set_default_program", self._bytes(name))

    @operation
    def get_motor_temperatures(self) -> Call[JointValues]:
        """Return the temperatures of the four motors in °C (4.14, L291-302)."""
        return _command_call("get_motor_temperatures")

    @operation
    def run_program(self, name: Text) -> Call[None]:
        """Run the program `name` to its end (4.15, L306-328). The robot moves."""
        return _command_call("run_program", self._bytes(name))

    start_run_program = start_method(run_program)

    @operation
    def simulate_program(self, name: Text) -> Call[None]:
        """Simulate the program `name` to its end (4.16). The arm may still move (A-4.16-1)."""
        return _command_call("simulate_program", self._bytes(name))

    start_simulate_program = start_method(simulate_program)

    # 4.17 - 4.28: motion

    @operation
    def emergency_stop(self) -> Call[None]:
        """Stop the robot (4.17, L358-383). Not a substitute for a hardware emergency stop.

        Other threads or tasks may call it while a call waits. The controller refuses it if there
        is nothing to stop (L363).
        """
        return _command_call("emergency_stop")

    start_emergency_stop = start_method(emergency_stop)

    @operation
    def reset(self) -> Call[None]:
        """Reset the robot (4.18, L387-419). The robot may move (A-4.18-3)."""
        return _command_call("reset")

    start_reset = start_method(reset)

    @operation
    def get_gripper_center(self) -> Call[Point]:
        """Return the gripper center relative to the tool, in mm (4.19, L423-431)."""
        return _command_call("get_gripper_center")

    @operation
    def set_gripper_center(self, x: float, y: float, z: float) -> Call[None]:
        """Set the gripper center relative to the tool, in mm (4.20, L435-443)."""
        return _command_call("set_gripper_center", Point(x, y, z))

    @operation
    def set_initial_tool_position(  # noqa: PLR0913, PLR0917 - the six fields of L447
        self, x: float, y: float, z: float, theta_x: float, theta_y: float, theta_z: float
    ) -> Call[None]:
        """Set the initial tool position, in mm and degrees (4.21, L447-455)."""
        return _command_call("set_initial_tool_position", Pose(x, y, z, theta_x, theta_y, theta_z))

    @operation
    def get_initial_tool_position(self) -> Call[Pose]:
        """Return the initial tool position in mm and degrees (4.22, L459-467).

        theta_y and theta_z have no meaning (L1006).
        """
        return _command_call("get_initial_tool_position")

    @operation
    def get_tool_coordinates(self) -> Call[Pose]:
        """Return the tool coordinates in mm and degrees (4.23, L471-479).

        theta_y and theta_z have no meaning (L1006).
        """
        return _command_call("get_tool_coordinates")

    @operation
    def set_tool_coordinates(  # noqa: PLR0913, PLR0917 - the seven fields of L483
        self,
        speed: int,
        x: float,
        y: float,
        z: float,
        theta_x: float,
        theta_y: float,
        theta_z: float,
    ) -> Call[None]:
        """Move the tool to a position (4.24, L483-516).

        Args:
            speed: 1 to 100 % of full speed.
            x: In mm.
            y: In mm.
            z: In mm.
            theta_x: In degrees.
            theta_y: Has no meaning (L1006).
            theta_z: Has no meaning (L1006).
        """
        target = MoveTarget(speed, x, y, z, theta_x, theta_y, theta_z)
        return _command_call("set_tool_coordinates", target)

    start_set_tool_coordinates = start_method(set_tool_coordinates)

    @operation
    def release_joints(self) -> Call[None]:
        """Release all joints so that they move freely (4.25, L520-549). The wrist may fall."""
        return _command_call("release_joints")

    start_release_joints = start_method(release_joints)

    @operation
    def lock_joints(self) -> Call[None]:
        """Lock all joints (4.26, L553-582)."""
        return _command_call("lock_joints")

    start_lock_joints = start_method(lock_joints)

    @operation
    def get_joint_angles(self) -> Call[JointValues]:
        """Return the joint positions in degrees, the wrist in mm (4.27, L586-594; A-4.27-3)."""
        return _command_call("get_joint_angles")

    @operation
    def jog(self, direction: JogDirection | str) -> Call[None]:
        """Move along ``+y``, ``-y``, ``+x`` or ``-x`` until stopped (4.28, L598-637).

        The document does not say how to stop a jog; `emergency_stop` stops it (A-4.28-3).
        """
        return _command_call("jog", parse_direction(direction))

    start_jog = start_method(jog)

    # 4.31 - 4.35: inputs, outputs, power

    @operation
    def get_digital_inputs(self) -> Call[str]:
        """Return the digital inputs, one digit per port, port 8 leftmost (4.31, L641-651)."""
        return _command_call("get_digital_inputs")

    @operation
    def set_digital_output(self, port: int, value: int) -> Call[None]:
        """Set the digital output `port` to `value`, 0 or 1 (4.32, L655-663)."""
        return _command_call("set_digital_output", PortValue(port, value))

    @operation
    def get_analog_input(self, port: int) -> Call[float]:
        """Return the value of an analog input (4.33, L667-675).

        The document gives no unit and no scale (A-4.33-1).
        """
        return _command_call("get_analog_input", port)

    @operation
    def get_digital_outputs(self) -> Call[str]:
        """Return the digital outputs, one digit per port, port 16 leftmost (4.34, L679-687)."""
        return _command_call("get_digital_outputs")

    @operation
    def shutdown(self) -> Call[None]:
        """Shut down the robot (4.35, L691-706). The controller may close the link afterwards."""
        return _command_call("shutdown")

    # 5: files

    @operation
    def upload(
        self,
        local: str | os.PathLike[str],
        remote: Text | None = None,
        progress: Progress | None = None,
    ) -> Call[None]:
        """Upload a file to the controller (5.2, L743-763).

        Args:
            local: Path of the local file.
            remote: Name on the controller; by default the name of the local file.
            progress: Callback after each chunk. An exception that it raises aborts the upload.

        Raises:
            OSError: The file cannot be read, or is no regular file. Nothing was sent.
            TransferFailed: The upload failed. The document leaves open whether a part of the file
                remains on the controller (A-5-12).
        """
        path = Path(local)
        check_regular(path)
        return self._upload(path.name if remote is None else remote, path.read_bytes(), progress)

    @operation
    def upload_bytes(
        self, content: bytes, remote: Text, progress: Progress | None = None
    ) -> Call[None]:
        """Upload `content` as the file `remote`; otherwise like `upload`."""
        return self._upload(remote, content, progress)

    @operation
    def download(
        self,
        remote: Text,
        local: str | os.PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Call[Path]:
        """Download a file from the controller (5.3, L767-787).

        Args:
            remote: Name on the controller.
            local: Path of the new local file; by default `remote` in the working directory.
            progress: Callback after each chunk. An exception that it raises aborts the download.

        Returns:
            The path of the new file.

        Raises:
            OSError: The local file exists or cannot be created. If possible, this is detected
                before the transfer starts.
            TransferFailed: The download failed. No local file was created.
        """
        name = self._bytes(remote)
        path = Path(self._text(name) if local is None else local)

        def write(content: bytes) -> Path:
            write_new(path, content)
            return path

        check_new(path)
        return Call(lambda core: core.download(name), write, progress)

    @operation
    def download_bytes(self, remote: Text, progress: Progress | None = None) -> Call[bytes]:
        """Download the file `remote` and return its content; otherwise like `download`."""
        name = self._bytes(remote)
        return Call(lambda core: core.download(name), bytes, progress)

    def _upload(self, remote: Text, content: bytes, progress: Progress | None) -> Call[None]:
        name = self._bytes(remote)
        return Call(lambda core: core.upload(name, content), lambda _: None, progress)

    def _bytes(self, text: Text) -> bytes:
        if isinstance(text, bytes):
            return text
        try:
            return text.encode(self._encoding, "surrogateescape")
        except UnicodeEncodeError as error:
            raise PayloadError(
                UserMessage(
                    "{text!r} cannot be encoded in {encoding}", text=text, encoding=error.encoding
                )
            ) from None

    def _text(self, data: bytes) -> str:
        return data.decode(self._encoding, "surrogateescape")

    @property
    def _encoding(self) -> str:
        encoding = self.dialect["text_encoding"]
        return "utf-8" if encoding == "bytes" else encoding


def _time(text: str) -> datetime:
    """Parse a time of the form YYYYMMDDHHMMSS.

    Raises:
        PayloadError: The text is not a time.
    """
    time = _CLOCK.read(str(text).encode(), Diagnostics())
    if time is None:
        raise PayloadError(
            UserMessage("{text!r} is not a time of the form YYYYMMDDHHMMSS (L172)", text=text)
        )
    return time


def parse_direction(direction: JogDirection | str) -> JogDirection:
    """Parse the direction of a jog: ``+y``, ``-y``, ``+x`` or ``-x`` (L605-608).

    Raises:
        PayloadError: The text is not a direction.
    """
    for known in JogDirection:
        if direction in (known, str(known)):
            return known
    raise PayloadError(
        UserMessage(
            "direction {direction!r} is not one of {known_directions}",
            direction=direction,
            known_directions=", ".join(map(str, JogDirection)),
        )
    )
