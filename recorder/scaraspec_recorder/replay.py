"""Replays the requests of a recorded client and compares the replies.

A request is sent only if its hazard is allowed, its command is defined and its form is valid. The
order is kept: each request waits for the reply to the previous one, and for the final results that
came before it in the capture. Replies are compared by their meaning. This module opens no link.
"""

from collections import deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Final, Protocol

from scaraspec.judge.tolerances import same_meaning
from scaraspec.protocol.commands import BY_NAME, parse_frame
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.readings import DEFAULT
from scaraspec.traffic.dialogue import Dialogue
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.text import text_of

MAX_GAP_S: Final = 60.0
"""The longest pause between two messages, in seconds of the capture."""

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
    """One message of the recorded client, or a final result that it waits for.

    Attributes:
        name: The command's name, or "bytes".
        time_ns: Time in the capture.
        frame: The frame to send; None if nothing is sent.
        reason: Why it is not sent or not waited for.
        is_reply: The message is a reply to a request of the controller.
        is_result: A final result of the controller.
        duration_s: How long the execution took until the final result, in the capture.
        recorded: The first reply or the final result in the capture.
        received: The same in the replay.
    """

    name: str
    time_ns: int
    frame: Frame | None = None
    reason: str = ""
    is_reply: bool = False
    is_result: bool = False
    duration_s: float = 0.0
    recorded: Frame | None = None
    received: Frame | None = None

    @property
    def complete(self) -> bool:
        """Whether no further message of the capture belongs to it."""
        return self.frame is None or self.is_reply or self.recorded is not None

    @property
    def recorded_reply(self) -> str:
        """The reply in the capture as text; empty if there is none."""
        return _reply_text(self.recorded)

    @property
    def new_reply(self) -> str:
        """The reply in the replay as text; empty if there is none."""
        return _reply_text(self.received)

    @property
    def differs(self) -> bool:
        """Whether the replies have another meaning; False without a recorded one."""
        if self.recorded is None or self.reason:
            return False
        return self.received is None or not _same(self.recorded, self.received)


def _reply_text(frame: Frame | None) -> str:
    return (text_of(frame) or "an empty reply") if frame else ""


def _same(recorded: Frame, received: Frame) -> bool:
    """Return whether two replies have the same meaning."""
    first, second = parse_frame(recorded), parse_frame(received)
    if first is None or second is None:
        return recorded.data == received.data
    if bool(first.decoded.issues) != bool(second.decoded.issues):
        return False
    return same_meaning(first.command.name, first.decoded.value, second.decoded.value)


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
    accepted_ns: dict[int, int] = {}  # by opcode: when a command that is sent was accepted
    for event in events:
        if event.connection != connection:
            continue
        for item in dialogue.feed(event):
            if isinstance(item, FrameSeen) and item.frame.direction is C2A:
                _add_reply(item, pending, accepted_ns)
            elif isinstance(item, FrameSeen):
                pending.append(_step(item, allowed))
            elif isinstance(item, InvalidBytes) and item.place.direction is A2C:
                pending.append(ReplayStep("bytes", event.time_ns, reason="not a frame"))
        while pending and (pending[0].complete or len(pending) > _MAX_PENDING):
            yield pending.popleft()
    yield from pending


def replay(
    plan: Iterable[ReplayStep],
    link: Link,
    *,
    reply_timeout_s: float,
    speed: float | None = None,
    max_gap_s: float = MAX_GAP_S,
) -> Iterator[ReplayStep]:
    """Send the allowed messages. Yield each step when it is done.

    Args:
        plan: The steps.
        link: An open link, logged in if required.
        reply_timeout_s: Timeout of a reply. A final result may take this much longer than in the
            capture.
        speed: Speed relative to the capture; None sends without pauses.
        max_gap_s: The longest pause between two messages of the capture, in seconds.

    Raises:
        LinkEndedError: The controller closed the link.
    """
    receiver, requested = _FrameReceiver(link), True
    not_executing: set[str] = set()
    due_s, before_ns = link.now_s, None
    for step in plan:
        gap_s = (step.time_ns - (step.time_ns if before_ns is None else before_ns)) / 1e9
        before_ns = step.time_ns
        if speed:
            due_s += min(max(gap_s, 0.0), max_gap_s) / speed
            if step.frame:
                receiver.receive_until(due_s)
        if step.is_result:
            if step.name in not_executing:
                step.reason = "it was not accepted"
            else:
                timeout_s = step.duration_s + reply_timeout_s
                step.received = receiver.receive_reply(step, timeout_s, part="result")
        elif step.frame and step.is_reply:
            # After one missing request, as in a refused download, do not wait for further ones.
            timeout_s = reply_timeout_s if requested else 0
            requested = bool(receiver.receive_reply(step, timeout_s, part="request"))
            if requested:
                link.send(step.frame.encode())
            else:
                step.frame, step.reason = None, "the controller did not send the request"
        elif step.frame:
            requested = True
            link.send(step.frame.encode())
            step.received = receiver.receive_reply(step, reply_timeout_s, part="reply")
            (not_executing.discard if _accepts(step.received) else not_executing.add)(step.name)
        yield step


def _accepts(reply: Frame | None) -> bool:
    parsed = parse_frame(reply) if reply else None
    value = parsed.decoded.value if parsed else None
    return isinstance(value, Acceptance) and value.accepted


class _FrameReceiver:
    """Receives frames of the controller and keeps those that do not match a request yet."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._framer = Framer(C2A)
        self._unmatched: deque[Frame] = deque(maxlen=_MAX_PENDING)

    def receive_reply(self, step: ReplayStep, timeout_s: float, *, part: str) -> Frame | None:
        """Return the next message of this part of a step's command; None after the timeout."""
        opcode = BY_NAME[step.name].opcode if step.frame is None else step.frame.opcode
        deadline_s = self._link.now_s + timeout_s
        while True:
            for frame in self._unmatched:
                parsed = parse_frame(frame)
                if frame.opcode == opcode and (parsed is None or parsed.part == part):
                    self._unmatched.remove(frame)
                    return frame
            if not self._receive(deadline_s):
                return None

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


def _add_reply(seen: FrameSeen, pending: deque[ReplayStep], accepted_ns: dict[int, int]) -> None:
    """Add a message of the controller to the step that it answers, or a step for a result."""
    opcode = seen.frame.opcode
    if not seen.frame.tagged:
        if _assign_reply(pending, seen):
            accepted_ns[opcode] = seen.place.time_ns
    elif (begun_ns := accepted_ns.pop(opcode, None)) is not None:
        pending.append(_result(seen, begun_ns))


def _result(seen: FrameSeen, begun_ns: int) -> ReplayStep:
    """Build the step that waits for a final result."""
    step = ReplayStep(seen.name, seen.place.time_ns, is_result=True, recorded=seen.frame)
    step.duration_s = max(seen.place.time_ns - begun_ns, 0) / 1e9
    return step


def _assign_reply(pending: Iterable[ReplayStep], seen: FrameSeen) -> bool:
    """Assign a first reply to the oldest pending step with the same opcode.

    Returns:
        Whether it accepts a two-stage command that is sent.
    """
    for step in pending:
        if not step.complete and step.frame and step.frame.opcode == seen.frame.opcode:
            step.recorded = seen.frame
            return _accepts(seen.frame)
    return False
