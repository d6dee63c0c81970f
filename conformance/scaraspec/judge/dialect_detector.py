"""Dialect detection: which reading of each open point a peer follows, and whether it mixes two."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.hazard import Hazard
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, TrafficEvent


class ReadingObservation(NamedTuple):
    """A peer, an open point, and the option that the peer showed."""

    peer: Direction
    key: str
    option: str


_SHOW_READINGS: Final = frozenset(
    ("get_default_program", "get_motor_temperatures", "list_programs")
)
"""Queries whose exchanges show readings."""


def observed_readings(traffic_event: TrafficEvent) -> Iterable[ReadingObservation]:
    """Return the readings that a traffic event shows; an uncertain event shows none."""
    if isinstance(traffic_event, FrameSeen):
        parsed = traffic_event.parsed
        if not parsed or not parsed.decoded.readings or not traffic_event.certain:
            return ()
        peer = traffic_event.frame.direction
        return [ReadingObservation(peer, *shown) for shown in parsed.decoded.readings]
    if not isinstance(traffic_event, Exchange) or not traffic_event.certain:
        return ()
    return _of_exchange(traffic_event) if _may_show(traffic_event) else ()


def _may_show(x: Exchange) -> bool:
    two_stage = x.command is None or x.command.two_stage
    return two_stage or x.logged_in is False or x.name in _SHOW_READINGS


def _of_exchange(x: Exchange) -> Iterator[ReadingObservation]:
    if x.command is None:
        yield from _of_unknown(x)
        return
    if x.name == "get_default_program":
        yield ReadingObservation(A2C, "op_get_default", f"0x{x.request.frame.opcode:02X}")
        # The reply 0 may also be that to an undefined opcode (A-3-9).
        if x.reply and x.reply.frame.data != b"0":
            yield ReadingObservation(C2A, "op_get_default", f"0x{x.reply.frame.opcode:02X}")
    elif x.name == "get_motor_temperatures" and x.reply:
        yield ReadingObservation(C2A, "op_temp_reply", f"0x{x.reply.frame.opcode:02X}")
    elif x.name == "list_programs" and x.reply and x.reply.value and x.reply.value.more:
        pushed = x.parts[-1] is not x.reply
        yield ReadingObservation(C2A, "list_cont", "push" if pushed else "request")
    if x.command.two_stage:
        yield from _of_two_stage(x)
    if x.logged_in is False and x.name != "login":
        yield from _of_prelogin(x)


def _of_unknown(x: Exchange) -> Iterator[ReadingObservation]:
    """How an undefined opcode was answered (A-3-9)."""
    if x.reply and x.reply.frame.data == b"0":
        yield ReadingObservation(C2A, "on_unknown", "0")
    elif x.ending is Ending.HUNG_UP:
        yield ReadingObservation(C2A, "on_unknown", "close")
    elif x.ending is Ending.UNANSWERED:
        yield ReadingObservation(C2A, "on_unknown", "ignore")


def _of_prelogin(x: Exchange) -> Iterator[ReadingObservation]:
    """How a command before the login was answered (A-4-4)."""
    if x.reply:
        assert x.command
        refused = x.accepted is False or x.reply.frame.data == b"0"
        served = "reads" if x.command.hazard is Hazard.READ_ONLY else "all"
        yield ReadingObservation(C2A, "prelogin", "failure" if refused else served)
    elif x.ending is Ending.HUNG_UP:
        yield ReadingObservation(C2A, "prelogin", "close")
    elif x.ending is Ending.UNANSWERED:
        yield ReadingObservation(C2A, "prelogin", "ignore")


def _of_two_stage(x: Exchange) -> Iterator[ReadingObservation]:
    refused = x.accepted is False and x.name != "reset"  # the document draws its refusal (A-4-2)
    if x.concurrent and refused and x.reply_value.code:
        yield ReadingObservation(C2A, "busy_reply", "state")
    elif x.concurrent and x.ending is Ending.UNANSWERED:
        yield ReadingObservation(C2A, "busy_reply", "silence")
    if x.interrupted_by and x.interrupted_by.name == "emergency_stop":
        here = x.interrupted_by.request.place.connection == x.request.place.connection
        if x.result and here:  # connections have no common order
            yield ReadingObservation(
                C2A, "estop_interrupted", "after" if x.result_after_stop else "first"
            )
        elif x.ending is Ending.UNFINISHED:
            yield ReadingObservation(C2A, "estop_interrupted", "none")


_BOTH: Final = frozenset({"op_get_default", "prelogin", "estop_interrupted"})
"""Points at which one peer may show several options without mixing readings.

A controller may serve both opcodes, treat commands differently before a login (A-4-4), and stop two
commands in different ways (jog, A-4.17-4).
"""


class DialectDetector:
    """Counts observed readings: the dialect of each peer, and where a peer mixes readings."""

    def __init__(self) -> None:
        self.counts: Counter[ReadingObservation] = Counter()

    def add(self, traffic_event: TrafficEvent) -> None:
        """Count the readings that a traffic event shows."""
        for observation in observed_readings(traffic_event):
            self.counts[observation] += 1

    def of(self, peer: Direction) -> Mapping[str, tuple[str, ...]]:
        """Return the observed options of a peer by key, the most frequent first."""
        seen: dict[str, tuple[str, ...]] = {}
        for observation, _ in self.counts.most_common():
            if observation.peer is peer:
                seen[observation.key] = (*seen.get(observation.key, ()), observation.option)
        return dict(sorted(seen.items()))

    def mixed(self, peer: Direction) -> Mapping[str, tuple[str, ...]]:
        """Return the keys at which a peer showed options that exclude each other."""
        return {k: v for k, v in self.of(peer).items() if len(v) > 1 and k not in _BOTH}
