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

    def applies_to(self, traffic_event: TrafficEvent) -> bool:
        """Whether it concerns such a happening: one of this `kind_of`."""
        return (
            self.on is type(traffic_event)
            and (not self.names or name_of(traffic_event) in self.names)
            and self.sender in (None, sender_of(traffic_event))
            and (self.payload is None or self._holds_payload(traffic_event))
        )

    def _holds_payload(self, traffic_event: TrafficEvent) -> bool:
        payload = payload_of(traffic_event) if isinstance(traffic_event, FrameSeen) else None
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


def kind_of(traffic_event: TrafficEvent) -> tuple[object, ...]:
    """What decides which rules look at a happening: equal kinds have equal rules."""
    if isinstance(traffic_event, FrameSeen):
        frame = traffic_event.frame
        return (FrameSeen, traffic_event.name, frame.direction, frame.tagged)
    return (type(traffic_event), name_of(traffic_event), sender_of(traffic_event))


def payload_of(seen: FrameSeen) -> Payload | None:
    """The payload that a frame holds, None where the table knows none."""
    return seen.command.payload(seen.frame) if seen.command else None


def places_of(traffic_event: TrafficEvent) -> tuple[WireRange, ...]:
    """Where on the wire a happening is."""
    match traffic_event:
        case FrameSeen() | InvalidBytes():
            return (traffic_event.place,)
        case UnsolicitedReply():
            return (traffic_event.seen.place,)
        case Exchange():
            return tuple(seen.place for seen in traffic_event.frames)
        case Transfer():
            return places_of(traffic_event.opening) if traffic_event.opening else ()
        case LinkChange(event) | CaptureGap(event) | Injected(event):
            length_bytes = max(event.length_bytes, 0)
            where = (event.connection, event.direction, event.offset_bytes)
            return (WireRange(*where, length_bytes, event.time_ns),)


def name_of(traffic_event: TrafficEvent) -> str:
    """The command that a happening belongs to, empty where there is none."""
    match traffic_event:
        case FrameSeen() | Exchange():
            return traffic_event.name
        case UnsolicitedReply():
            return traffic_event.seen.name
        case _:
            return ""


def sender_of(traffic_event: TrafficEvent) -> Direction | None:
    """Who sent the frame or the bytes, or asked; None if there is no sender."""
    match traffic_event:
        case FrameSeen():
            return traffic_event.frame.direction
        case Exchange():
            return traffic_event.request.frame.direction
        case UnsolicitedReply():
            return traffic_event.seen.frame.direction
        case InvalidBytes():
            return traffic_event.place.direction
        case _:
            return None


def is_certain(traffic_event: TrafficEvent) -> bool:
    """Whether no gap or fault can have touched it; a change of the link is seen or it is not."""
    if isinstance(traffic_event, LinkChange | CaptureGap | Injected):
        return isinstance(traffic_event, LinkChange)
    return traffic_event.certain
