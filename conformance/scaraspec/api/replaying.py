"""The replay of a capture: recorded requests are sent to a controller again."""

from collections.abc import Callable, Collection, Iterator
from contextlib import closing
from pathlib import Path
from typing import Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.transports.connect import connect
from scaraspec.transports.link import Link
from scaraspec.transports.url import parse
from scaraspec.user_message import UserMessage
from scaraspec_recorder import replay as capture_replay
from scaraspec_recorder.replay import MAX_GAP_S, ReplayStep
from scaraspec_recorder.sources.capture import open_capture

_LOGIN: Final = BY_NAME["login"]
_ACCEPTED: Final = "ok"


class LoginFailedError(Exception):
    """The controller refused the login or did not answer it; one sentence for the user."""


def replay(  # noqa: PLR0913 - independent options
    capture: Path,
    url: str,
    *,
    allowed: Collection[Hazard] = (),
    password: str = "password",  # noqa: S107 - the document's example (L109)
    connection: str = "1",
    port: int | None = None,
    reply_timeout_s: float = 5.0,
    speed: float | None = None,
    max_gap_s: float = MAX_GAP_S,
    progress: Callable[[int, int], None] = lambda _read, _size: None,
) -> Iterator[ReplayStep]:
    """Send the requests of a recorded client to a controller, in the same order.

    Undefined opcodes and malformed frames are never sent. Each request waits for the reply to the
    one before, and for the final results before it in the capture.

    Args:
        capture: An MCAP recording, or a pcap or pcapng.
        url: The link to the controller, such as ``tcp://127.0.0.1:8877``.
        allowed: Hazards of the requests to send, besides read-only ones.
        password: The password for the login over TCP.
        connection: The number of the connection in the capture.
        port: The controller's TCP port in packet captures; None for all connections.
        reply_timeout_s: How long to wait for a reply, in seconds.
        speed: Speed relative to the capture, for example 2 for twice as fast; None sends without
            pauses.
        max_gap_s: The longest pause between two messages of the capture, in seconds.
        progress: Called from time to time with the bytes read so far and the size of the file.

    Yields:
        Each message of the client, after it was sent or skipped, and each final result.

    Raises:
        CaptureError: The capture cannot be read.
        LinkError: The URL is invalid, or the controller cannot be reached.
        LinkEndedError: The controller closed the link.
        LoginFailedError: The login failed.
        PayloadError: The password cannot be sent.
    """
    needs_login = parse(url).needs_login
    source = open_capture(capture, port=port)
    with closing(connect(url)) as link:
        if needs_login:
            _log_in(link, password, reply_timeout_s)
        plan = capture_replay.plan_steps(source, connection, {Hazard.READ_ONLY, *allowed})
        size_bytes = capture.stat().st_size
        for step in capture_replay.replay(
            plan, link, reply_timeout_s=reply_timeout_s, speed=speed, max_gap_s=max_gap_s
        ):
            progress(source.summary.read_bytes, size_bytes)
            yield step


def _log_in(link: Link, password: str, reply_timeout_s: float) -> None:
    frame = Frame(A2C, _LOGIN.opcode, _LOGIN.request.encode(password.encode()))
    steps = (ReplayStep("login", 0, frame),)
    (step,) = capture_replay.replay(steps, link, reply_timeout_s=reply_timeout_s)
    if step.new_reply != _ACCEPTED:
        raise LoginFailedError(
            UserMessage("the controller refuses the password: name another with --password")
            if step.new_reply
            else UserMessage("the controller does not answer the login")
        )
