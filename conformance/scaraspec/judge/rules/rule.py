"""What a rule is: one pure function for one requirement, over one happening and the scene.

A rule returns nothing if its requirement does not apply to the event. A rule never guesses: if
overlapping exchanges leave the answer open, it returns `inconclusive`. A rule that looks at its
event alone can ignore capture gaps: the judge drops the failure of an event that is not certain.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.payloads import Payload
from scaraspec.traffic.events import (
    CaptureGap,
    Exchange,
    FrameSeen,
    Injected,
    InvalidBytes,
    LinkChange,
    TrafficEvent,
    Transfer,
    UnsolicitedReply,
)
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import WireRange


class RuleResult(NamedTuple):
    """A rule's word on one happening.

    Attributes:
        verdict: Pass, tolerated, inconclusive or fail.
        message: One sentence for a reader who has not seen the traffic; empty for a pass.
        expected: What the document leads to expect, in short.
        observed: What was there instead.
        places: The evidence; that of the happening where it is empty.
        reading: For a toleration: the reading's key, or the register's entry, and what was seen.
    """

    verdict: Verdict
    message: str = ""
    expected: str = ""
    observed: str = ""
    places: tuple[WireRange, ...] = ()
    reading: tuple[str, str] | None = None


PASSED = RuleResult(Verdict.PASS)


def failed(
    message: str, *, expected: str = "", observed: str = "", at: Iterable[WireRange] = ()
) -> RuleResult:
    """The subject violates the requirement."""
    return RuleResult(Verdict.FAIL, message, expected, observed, tuple(at))


def tolerated(key: str, option: str, message: str, *, at: Iterable[WireRange] = ()) -> RuleResult:
    """The subject follows a listed reading, or does what the register only warns of."""
    return RuleResult(Verdict.TOLERATED, message, places=tuple(at), reading=(key, option))


def inconclusive(message: str) -> RuleResult:
    """The evidence does not suffice."""
    return RuleResult(Verdict.INCONCLUSIVE, message)


Check = Callable[[Any, RobotState], RuleResult | None]


@dataclass(frozen=True, slots=True)
class Rule:
    """A check, bound to its requirement and to the happenings that it looks at.

    Attributes:
        requirement: The requirement's id.
        on: The type of happening.
        names: The commands it looks at; empty for all.
        sender: Who sent, or asked; None for either.
        payload: For frames: which payloads it looks at; None for all, and for frames without.
        check: The function.
    """

    requirement: str
    on: type
    names: frozenset[str]
    sender: Direction | None
    payload: Callable[[Payload], bool] | None
    check: Check

    def looks_at(self, happening: TrafficEvent) -> bool:
        """Whether it concerns such a happening: one of this `kind_of`."""
        return (
            self.on is type(happening)
            and (not self.names or name_of(happening) in self.names)
            and self.sender in (None, sender_of(happening))
            and (self.payload is None or self._holds_payload(happening))
        )

    def _holds_payload(self, happening: TrafficEvent) -> bool:
        payload = payload_of(happening) if isinstance(happening, FrameSeen) else None
        return self.payload is not None and payload is not None and self.payload(payload)


RULES: list[Rule] = []
"""All rules, in the order in which the rooms by clause define them."""


def rule(
    *requirements: str,
    on: type[Any],
    names: Iterable[str] = (),
    sender: Direction | None = None,
    payload: Callable[[Payload], bool] | None = None,
) -> Callable[[Check], Check]:
    """Enter a check for one or more requirements that it decides alike."""

    def enter(check: Check) -> Check:
        RULES.extend(Rule(r, on, frozenset(names), sender, payload, check) for r in requirements)
        return check

    return enter


def kind_of(happening: TrafficEvent) -> tuple[object, ...]:
    """What decides which rules look at a happening: equal kinds have equal rules."""
    if isinstance(happening, FrameSeen):
        frame = happening.frame
        return (FrameSeen, happening.name, frame.direction, frame.tagged)
    return (type(happening), name_of(happening), sender_of(happening))


def payload_of(seen: FrameSeen) -> Payload | None:
    """The payload that a frame holds, None where the table knows none."""
    return seen.command.payload(seen.frame) if seen.command else None


def places_of(happening: TrafficEvent) -> tuple[WireRange, ...]:
    """Where on the wire a happening is."""
    match happening:
        case FrameSeen() | InvalidBytes():
            return (happening.place,)
        case UnsolicitedReply():
            return (happening.seen.place,)
        case Exchange():
            return tuple(seen.place for seen in happening.frames)
        case Transfer():
            return places_of(happening.opening) if happening.opening else ()
        case LinkChange(event) | CaptureGap(event) | Injected(event):
            length_bytes = max(event.length_bytes, 0)
            where = (event.connection, event.direction, event.offset_bytes)
            return (WireRange(*where, length_bytes, event.time_ns),)


def name_of(happening: TrafficEvent) -> str:
    """The command that a happening belongs to, empty where there is none."""
    match happening:
        case FrameSeen() | Exchange():
            return happening.name
        case UnsolicitedReply():
            return happening.seen.name
        case _:
            return ""


def sender_of(happening: TrafficEvent) -> Direction | None:
    """Who sent the frame or the bytes, or asked; None where that is nobody."""
    match happening:
        case FrameSeen():
            return happening.frame.direction
        case Exchange():
            return happening.request.frame.direction
        case UnsolicitedReply():
            return happening.seen.frame.direction
        case InvalidBytes():
            return happening.place.direction
        case _:
            return None


def is_certain(happening: TrafficEvent) -> bool:
    """Whether no gap or fault can have touched it; a change of the link is seen or it is not."""
    if isinstance(happening, LinkChange | CaptureGap | Injected):
        return isinstance(happening, LinkChange)
    return happening.certain
