"""Replay: what a recorded client asked is asked again, and the answers are held side by side.

Law: nothing is sent that was not allowed by its hazard, that the table does not know, or whose form
is wrong. What goes out keeps its order; the next request waits for the answer to the one before.
No link is opened here.
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

_MOST_UNANSWERED: Final = 256
"""Requests whose answer is looked for further on in the capture."""


class Link(Protocol):
    """What is needed of a link to a controller, see `links.link.Link`."""

    @property
    def now_s(self) -> float:
        """The present instant on its monotonic clock."""

    def send(self, data: bytes) -> object:
        """Send all of `data`."""

    def receive(self, deadline_s: float) -> tuple[int, object] | None:
        """Return when which bytes came; anything else is the end; None where none came by then."""


class LinkEndedError(Exception):
    """The controller has ended the link."""


@dataclass(slots=True)
class ReplayStep:
    """Something that the recorded client sent.

    Attributes:
        name: The command, or what else it is.
        time_ns: When, in the capture.
        frame: What is to be sent; None where nothing may.
        reason: Why nothing may.
        is_reply: It answers the controller's request, instead of asking.
        recorded_reply: The form of the first reply in the capture, see `reply_form`.
        new_reply: The form of the first reply now.
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
        """Whether nothing more of the capture belongs to it."""
        return self.frame is None or self.is_reply or bool(self.recorded_reply)

    @property
    def differs(self) -> bool:
        """Whether the controller answers otherwise than it did; where it did, that is."""
        return bool(self.recorded_reply) and self.recorded_reply != self.new_reply


def plan_steps(
    events: Iterable[WireEvent], connection: str, allowed: Collection[Hazard]
) -> Iterator[ReplayStep]:
    """Give what the client of one connection sent, each with the reply that it got.

    Args:
        events: A capture.
        connection: Which of its connections.
        allowed: What the requests that are sent may do at worst.
    """
    dialogue = Dialogue(connection, RobotState(), DEFAULT)
    waiting: deque[ReplayStep] = deque()
    for event in events:
        if event.connection != connection:
            continue
        for item in dialogue.feed(event):
            if isinstance(item, FrameSeen) and item.frame.direction is C2A:
                _answer(waiting, item)
            elif isinstance(item, FrameSeen):
                waiting.append(_step(item, allowed))
            elif isinstance(item, InvalidBytes) and item.place.direction is A2C:
                waiting.append(ReplayStep("bytes", event.time_ns, reason="no frame"))
        while waiting and (waiting[0].complete or len(waiting) > _MOST_UNANSWERED):
            yield waiting.popleft()
    yield from waiting


def replay(
    plan: Iterable[ReplayStep], link: Link, *, reply_timeout_s: float, speed: float | None = None
) -> Iterator[ReplayStep]:
    """Send what may be sent; give each step when it is done.

    Args:
        plan: The steps.
        link: Open, and logged in where that is needed.
        reply_timeout_s: How long an answer is waited for.
        speed: How much faster than in the capture, 1 for as it was; None for at once.

    Raises:
        LinkEndedError: The controller has ended the link.
    """
    ear, asked = _Ear(link), True
    begun: tuple[float, int] | None = None
    for step in plan:
        begun = begun or (link.now_s, step.time_ns)
        if speed and step.frame:
            ear.receive_until(begun[0] + (step.time_ns - begun[1]) / 1e9 / speed)
        if step.frame and step.is_reply:
            # Where it did not ask once, as in a download that it refused, it is not waited for.
            timeout_s = reply_timeout_s if asked else 0
            asked = bool(ear.receive_reply(step.frame.opcode, timeout_s, part="request"))
            if asked:
                link.send(step.frame.encode())
            else:
                step.frame, step.reason = None, "the controller did not ask"
        elif step.frame:
            asked = True
            link.send(step.frame.encode())
            step.new_reply = ear.receive_reply(step.frame.opcode, reply_timeout_s, part="reply")
        yield step


def reply_form(parsed: Parsed | None) -> str:
    """What a reply amounts to, whatever values are in it: values change from day to day."""
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


class _Ear:
    """Hears what the controller sends, and keeps what nobody has waited for so far."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._framer = Framer(C2A)
        self._unmatched: deque[Frame] = deque(maxlen=_MOST_UNANSWERED)

    def receive_reply(self, opcode: int, timeout_s: float, *, part: str) -> str:
        """Return the form of the next message of this opcode; nothing if none comes in time."""
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
        """Keep what comes by then."""
        while self._link.now_s < deadline_s:
            self._receive(deadline_s)

    def _receive(self, deadline_s: float) -> bool:
        """Take what comes next; false if nothing comes by then."""
        arrival = self._link.receive(deadline_s)
        if arrival is None:
            return False
        if not isinstance(arrival[1], bytes):
            raise LinkEndedError("the controller has ended the link")
        found = self._framer.feed(arrival[1])
        self._unmatched.extend(item for item in found if isinstance(item, Frame))
        return True


def _step(seen: FrameSeen, allowed: Collection[Hazard]) -> ReplayStep:
    """What becomes of a frame of the client."""
    step = ReplayStep(seen.name, seen.place.time_ns)
    parsed = seen.parsed
    if not seen.certain:
        step.reason = "behind a gap"
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


def _answer(waiting: Iterable[ReplayStep], seen: FrameSeen) -> None:
    """Give a first reply to the oldest step that waits for one of its opcode."""
    for step in waiting:
        if not step.complete and step.frame and step.frame.opcode == seen.frame.opcode:
            if not seen.frame.tagged:
                step.recorded_reply = reply_form(seen.parsed)
            return
