"""Replays the requests of a recorded client and compares the replies.

A request is sent only if its hazard is allowed, its command is defined and its form is valid. The
order is kept; each request waits for the reply to the previous one. This module opens no link.
"""

from collections import deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Final, Protocol

from scaraspec.protocol.commands import Parsed, parse_frame
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.readings import DEFAULT
from scaraspec.traffic.dialogue import Dialogue
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import WireEvent

_MAX_PENDING: Final = 256
"""Maximum number of requests whose reply is still searched in the capture."""


class Link(Protocol):
    """The methods that a link to a controller must have."""

    @property
    def now_s(self) -> float:
        """Current time of its monotonic clock, in seconds."""

    def send(self, data: bytes) -> object:
        """Send all of `data`."""

    def receive(self, deadline_s: float) -> tuple[int, object] | None:
        """Return time and bytes; None after the deadline. Other objects mean the end."""


class LinkEndedError(Exception):
    """The controller closed the link."""


@dataclass(slots=True)
class ReplayStep:
    """One message of the recorded client.

    Attributes:
        name: The command's name, or "bytes".
        time_ns: Time in the capture.
        frame: The frame to send; None if it is not sent.
        reason: Why it is not sent.
        is_reply: The message is a reply to a request of the controller.
        recorded_reply: Form of the first reply in the capture, see `reply_form`.
        new_reply: Form of the first reply in the replay.
    """

    name: str
    time_ns: int
    frame: Frame | None = None
    reason: str = ""
    is_reply: bool = False
    recorded_reply: str = ""
    new_reply: str = ""

    @property
    def complete(self) -> bool:
        """Whether no further message of the capture belongs to it."""
        return self.frame is None or self.is_reply or bool(self.recorded_reply)

    @property
    def differs(self) -> bool:
        """Whether the new reply differs from the recorded one; False without a recorded reply."""
        return bool(self.recorded_reply) and self.recorded_reply != self.new_reply


def plan_steps(
    events: Iterable[WireEvent], connection: str, allowed: Collection[Hazard]
) -> Iterator[ReplayStep]:
    """Yield the messages of the client of one connection, each with its recorded reply.

    Args:
        events: The events of a capture.
        connection: Name of the connection.
        allowed: Hazards of the requests that may be sent.
    """
    dialogue = Dialogue(connection, RobotState(), DEFAULT)
    pending: deque[ReplayStep] = deque()
    for event in events:
        if event.connection != connection:
            continue
        for item in dialogue.feed(event):
            if isinstance(item, FrameSeen) and item.frame.direction is C2A:
                _assign_reply(pending, item)
            elif isinstance(item, FrameSeen):
                pending.append(_step(item, allowed))
            elif isinstance(item, InvalidBytes) and item.place.direction is A2C:
                pending.append(ReplayStep("bytes", event.time_ns, reason="not a frame"))
        while pending and (pending[0].complete or len(pending) > _MAX_PENDING):
            yield pending.popleft()
    yield from pending


def replay(
    plan: Iterable[ReplayStep], link: Link, *, reply_timeout_s: float, speed: float | None = None
) -> Iterator[ReplayStep]:
    """Send the allowed messages. Yield each step when it is done.

    Args:
        plan: The steps.
        link: An open link, logged in if required.
        reply_timeout_s: Timeout of a reply.
        speed: Speed relative to the capture; None sends without pauses.

    Raises:
        LinkEndedError: The controller closed the link.
    """
    receiver, requested = _FrameReceiver(link), True
    begun: tuple[float, int] | None = None
    for step in plan:
        begun = begun or (link.now_s, step.time_ns)
        if speed and step.frame:
            receiver.receive_until(begun[0] + (step.time_ns - begun[1]) / 1e9 / speed)
        if step.frame and step.is_reply:
            # After one missing request, as in a refused download, do not wait for further ones.
            timeout_s = reply_timeout_s if requested else 0
            requested = bool(receiver.receive_reply(step.frame.opcode, timeout_s, part="request"))
            if requested:
                link.send(step.frame.encode())
            else:
                step.frame, step.reason = None, "the controller did not send the request"
        elif step.frame:
            requested = True
            link.send(step.frame.encode())
            step.new_reply = receiver.receive_reply(
                step.frame.opcode, reply_timeout_s, part="reply"
            )
        yield step


def reply_form(parsed: Parsed | None) -> str:
    """Return the form of a reply, independent of the values in it, which change between runs."""
    if parsed is None:
        return "undefined"
    value = parsed.decoded.value
    if parsed.decoded.issues:
        return "malformed"
    if isinstance(value, Acceptance):
        return "accepted" if value.accepted else "refused"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "answered"


class _FrameReceiver:
    """Receives frames of the controller and keeps those that do not match a request yet."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._framer = Framer(C2A)
        self._unmatched: deque[Frame] = deque(maxlen=_MAX_PENDING)

    def receive_reply(self, opcode: int, timeout_s: float, *, part: str) -> str:
        """Return the form of the next message with this opcode; empty after the timeout."""
        deadline_s = self._link.now_s + timeout_s
        while True:
            while self._unmatched:
                frame = self._unmatched.popleft()
                parsed = parse_frame(frame)
                if frame.opcode == opcode and (parsed is None or parsed.part == part):
                    return reply_form(parsed)
            if not self._receive(deadline_s):
                return ""

    def receive_until(self, deadline_s: float) -> None:
        """Receive and keep frames until the deadline."""
        while self._link.now_s < deadline_s:
            self._receive(deadline_s)

    def _receive(self, deadline_s: float) -> bool:
        """Receive the next bytes. Return False after the deadline."""
        arrival = self._link.receive(deadline_s)
        if arrival is None:
            return False
        if not isinstance(arrival[1], bytes):
            raise LinkEndedError("the controller closed the link")
        found = self._framer.feed(arrival[1])
        self._unmatched.extend(item for item in found if isinstance(item, Frame))
        return True


def _step(seen: FrameSeen, allowed: Collection[Hazard]) -> ReplayStep:
    """Build the step of a client frame."""
    step = ReplayStep(seen.name, seen.place.time_ns)
    parsed = seen.parsed
    if not seen.certain:
        step.reason = "after a gap"
    elif parsed is None:
        step.reason = "undefined opcode"
    elif parsed.decoded.issues:
        step.reason = "malformed"
    elif parsed.command.hazard not in allowed:
        step.reason = parsed.command.hazard.value
    else:
        step.frame = seen.frame
        step.is_reply = parsed.part == "reply"
    return step


def _assign_reply(pending: Iterable[ReplayStep], seen: FrameSeen) -> None:
    """Assign a first reply to the oldest pending step with the same opcode."""
    for step in pending:
        if not step.complete and step.frame and step.frame.opcode == seen.frame.opcode:
            if not seen.frame.tagged:
                step.recorded_reply = reply_form(seen.parsed)
            return
