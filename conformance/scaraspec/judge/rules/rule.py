"""Rules: a rule is a pure function of a traffic event and the robot state.

A rule returns None if its requirement does not apply to the event. A rule never guesses: if
overlapping exchanges leave the answer open, it returns `inconclusive`. A rule that uses only
its event can ignore capture gaps: the judge turns the failure of an uncertain event into
inconclusive.

A rule about a frame depends on its bytes alone: not on place, times or robot state. So does a rule
about exchanges that is declared `by_bytes`, if the exchange is `plain`. The judge calls such a rule
once for equal bytes.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
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
    """The result of a rule for one traffic event.

    Attributes:
        verdict: Pass, tolerated, inconclusive or fail.
        message: One sentence that is clear without the traffic; empty for a pass.
        expected: The expected value, in short.
        observed: The observed value.
        places: The evidence; if empty, the bytes of the traffic event.
        reading: For a toleration: the key of the reading or the register entry, and the option.
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
    """Return that the SUT violates the requirement."""
    return RuleResult(Verdict.FAIL, message, expected, observed, tuple(at))


def tolerated(key: str, option: str, message: str, *, at: Iterable[WireRange] = ()) -> RuleResult:
    """Return that the SUT follows a listed reading, or one that the register warns about."""
    return RuleResult(Verdict.TOLERATED, message, places=tuple(at), reading=(key, option))


def inconclusive(message: str) -> RuleResult:
    """Return that the evidence does not suffice."""
    return RuleResult(Verdict.INCONCLUSIVE, message)


Check = Callable[[Any, RobotState], RuleResult | None]


@dataclass(frozen=True, slots=True)
class Rule:
    """A check function with its requirement and the traffic events that it checks.

    Attributes:
        requirement: The requirement's id.
        on: The type of traffic event.
        names: The commands; empty for all.
        sender: The side that sent the frame or request; None for both.
        payload: For frames: selects the payloads; None for all, also for frames without one.
        check: The function.
        by_bytes: Whether the result follows from the bytes alone: of a frame, or of the request and
            the reply of an exchange that is `plain`.
    """

    requirement: str
    on: type
    names: frozenset[str]
    sender: Direction | None
    payload: Callable[[Payload], bool] | None
    check: Check
    by_bytes: bool

    def applies_to(self, traffic_event: TrafficEvent) -> bool:
        """Whether the rule checks traffic events of this kind (see `kind_of`)."""
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
"""All rules, in the order in which the modules define them."""


def rule(
    *requirements: str,
    on: type[Any],
    names: Iterable[str] = (),
    sender: Direction | None = None,
    payload: Callable[[Payload], bool] | None = None,
    by_bytes: bool = False,
) -> Callable[[Check], Check]:
    """Register a check for one or more requirements; it gives all of them the same result."""
    by_bytes = by_bytes or on is FrameSeen

    def register(check: Check) -> Check:
        RULES.extend(
            Rule(r, on, frozenset(names), sender, payload, check, by_bytes) for r in requirements
        )
        return check

    return register


def kind_of(traffic_event: TrafficEvent) -> tuple[object, ...]:
    """Return the kind of a traffic event: the same rules check events of the same kind."""
    if isinstance(traffic_event, FrameSeen):
        frame = traffic_event.frame
        return (FrameSeen, traffic_event.name, frame.direction, frame.tagged)
    return (type(traffic_event), name_of(traffic_event), sender_of(traffic_event))


def payload_of(seen: FrameSeen) -> Payload | None:
    """Return the payload type of a frame; None if the command table has none."""
    return seen.command.payload(seen.frame) if seen.command else None


def places_of(traffic_event: TrafficEvent) -> tuple[WireRange, ...]:
    """Return the byte ranges of a traffic event."""
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


def places_of_file(transfer: Transfer) -> tuple[WireRange, ...]:
    """Return the places of the name and the last chunk of a complete transfer."""
    last = (transfer.last_chunk.place,) if transfer.last_chunk else ()
    return (*places_of(transfer), *last)


def name_of(traffic_event: TrafficEvent) -> str:
    """Return the command name of a traffic event; empty without a command."""
    match traffic_event:
        case FrameSeen() | Exchange():
            return traffic_event.name
        case UnsolicitedReply():
            return traffic_event.seen.name
        case _:
            return ""


def sender_of(traffic_event: TrafficEvent) -> Direction | None:
    """Return the side that sent the frame, bytes, request or file; None without a sender."""
    match traffic_event:
        case FrameSeen():
            return traffic_event.frame.direction
        case Exchange():
            return traffic_event.request.frame.direction
        case UnsolicitedReply():
            return traffic_event.seen.frame.direction
        case InvalidBytes():
            return traffic_event.place.direction
        case Transfer():
            return A2C if traffic_event.upload else C2A
        case _:
            return None


def is_certain(traffic_event: TrafficEvent) -> bool:
    """Return whether no gap or fault can have affected it; link changes are always certain."""
    if isinstance(traffic_event, LinkChange | CaptureGap | Injected):
        return isinstance(traffic_event, LinkChange)
    return traffic_event.certain
