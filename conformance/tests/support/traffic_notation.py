"""The traffic notation: sessions as lines of text, and fixtures that judge them.

Each line is one event, a millisecond after the previous one. The first query of a state after a
reply or a final result of a two-stage command comes later, so that the state is current (A-4.8-3),
unless a line with seconds is between them::

    login                       a login that succeeds
    > run_program a.rob         the client sends; a text of data follows, with \\xNN for bytes
    < run_program 1             the controller sends
    <90 run_program 11          with the tag of a final result
    > 3E 1                      an opcode in hex, where the command has another or none
    > chunk 0/300               file data: position, file size; then len=5, big, cut, other
    > =AA 09 00 CC              raw bytes
    < gap 12                    bytes that were not recorded; without a number, of unknown length
    > open                      half-close, close, rst, injected; a connection opens by itself; a
                                text after it is the event's note
    +5.2                        seconds pass
    2> get_time                 on the connection named 2
"""

import codecs
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk
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
from scaraspec.traffic.robot_state import STATE_LAG_NS, RobotState
from scaraspec.traffic.wire import Kind, WireEvent

_LINE = re.compile(r"(?P<name>\w*)(?P<who>[<>])(?P<tag>90)? (?P<what>[^ =]+|=)(?: ?(?P<data>.*))?")
_LINK = {
    "open": Kind.OPENED,
    "half-close": Kind.HALF_CLOSED,
    "close": Kind.CLOSED,
    "rst": Kind.RESET,
    "injected": Kind.INJECTED,
}
_SAMPLED = ("get_status", "get_tool_coordinates", "get_joint_angles")

# Hostile file content: it is full of frames, for a framer that loses synchronisation.
_CONTENT = b"".join(
    bytes.fromhex(frame) + bytes((i % 256,))
    for i in range(40)
    for frame in (
        "AA 09 00 CC",
        "CC 09 02 30 30 AA",
        "AA 77 00 CC",
        "AA 05 03 61 62 63 CC",
        "CC 90 30 02 31 31 AA",
        "AA 30 01 61 CC",
        "CC 01 01 30 AA",
        "CC 42 03 31 20 30 AA",
        "AA 52 00 CC",
    )
)


@dataclass
class _Script:
    """Turns lines into events."""

    time_ns: int = 0
    events: list[WireEvent] = field(default_factory=list)
    offsets: dict[tuple[str, Direction], int] = field(default_factory=dict)
    settles: bool = False

    def run(self, text: str) -> list[WireEvent]:
        for line in (raw.strip() for raw in text.splitlines()):
            if line == "login":
                self.run("> login password\n< login 1")
            elif line.startswith("+"):
                self.settles = False
                self.time_ns += int(float(line[1:]) * 1e9)
            elif line:
                self._line(line)
        return self.events

    def _line(self, line: str) -> None:
        match = _LINE.fullmatch(line)
        assert match, line
        connection, what, data = match["name"] or "1", match["what"], match["data"]
        direction = A2C if match["who"] == ">" else C2A
        if (connection, direction) not in self.offsets:
            self.offsets[connection, A2C] = self.offsets[connection, C2A] = 0
            if what not in ("open", "gap", "injected"):
                self._add(connection, A2C, Kind.OPENED)
        if what in _LINK:
            self._add(connection, direction, _LINK[what])
            self.events[-1] = replace(self.events[-1], note=data)
        elif what == "gap":
            self._add(connection, direction, Kind.GAP, length_bytes=int(data or -1))
        else:
            if direction is A2C and self.settles and what in _SAMPLED:
                self.settles = False
                self.time_ns += 1_000_000 + STATE_LAG_NS
            two_stage = what in BY_NAME and BY_NAME[what].two_stage
            self.settles = self.settles or (direction is C2A and two_stage)
            octets = _octets(direction, what, data, tagged=bool(match["tag"]))
            self._add(connection, direction, Kind.BYTES, octets)

    def _add(
        self,
        connection: str,
        direction: Direction,
        kind: Kind,
        data: bytes = b"",
        length_bytes: int = 0,
    ) -> None:
        self.time_ns += 1_000_000
        if kind is Kind.OPENED:
            self.offsets[connection, A2C] = self.offsets[connection, C2A] = 0
        at = self.offsets[connection, direction]
        self.events.append(
            WireEvent(self.time_ns, connection, direction, kind, data, at, length_bytes)
        )
        self.offsets[connection, direction] = at + len(data) + max(length_bytes, 0)


def _octets(direction: Direction, what: str, data: str, *, tagged: bool) -> bytes:
    if what == "=":
        return bytes.fromhex(data)
    if what == "chunk":
        opcode = 0x52 if direction is A2C else 0x56
        return Frame(direction, opcode, _chunk(*data.split())).encode()
    opcode = BY_NAME[what].opcode if what in BY_NAME else int(what, 16)
    payload = codecs.decode(data, "unicode_escape").encode("latin-1")
    return Frame(direction, opcode, payload, tagged).encode()


def _chunk(where: str, *options: str) -> bytes:
    position, size = (int(number) for number in where.split("/"))
    length = max(min(BUFFER_BYTES, size - position), 0)
    for option in options:
        if option.startswith("len="):
            length = int(option.removeprefix("len="))
    content = _CONTENT[::-1] if "other" in options else _CONTENT
    chunk = Chunk(size, position, length, content[position:][: min(length, BUFFER_BYTES)])
    order, cut = "big" if "big" in options else "little", "cut" in options
    dialect = Dialect.of(endian=order, chunk_trunc="truncated" if cut else "full")
    return FILE_DATA.encode(chunk, dialect)


@dataclass
class Record:
    """What a judge made of a session."""

    judge: Judge
    happenings: list[TrafficEvent]
    findings: list[Finding]

    @property
    def robot(self) -> RobotState:
        """The state of the only controller."""
        (robot,) = self.judge.robots.values()
        return robot

    @property
    def exchanges(self) -> list[Exchange]:
        """The exchanges, as they ended."""
        return [h for h in self.happenings if isinstance(h, Exchange)]

    @property
    def transfers(self) -> list[Transfer]:
        """The transfers, as they ended."""
        return [h for h in self.happenings if isinstance(h, Transfer)]

    @property
    def unsolicited(self) -> list[UnsolicitedReply]:
        """The unsolicited frames."""
        return [h for h in self.happenings if isinstance(h, UnsolicitedReply)]

    @property
    def undecodable(self) -> list[InvalidBytes]:
        """Bytes that belong to no frame."""
        return [h for h in self.happenings if isinstance(h, InvalidBytes)]

    def exchange(self, name: str) -> Exchange:
        """The only exchange of a command."""
        (found,) = [x for x in self.exchanges if x.name == name]
        return found

    def verdict(self, requirement: str) -> Verdict:
        """The gravest verdict on a requirement."""
        tally = self.judge.tallies.get(requirement)
        return tally.verdict if tally else Verdict.NONE

    @property
    def failed(self) -> set[str]:
        """The requirements that failed."""
        return {f.requirement for f in self.findings if f.verdict is Verdict.FAIL}

    @property
    def printed(self) -> list[tuple[Any, ...]]:
        """All events and findings, without their times."""
        return [
            *(_untimed(what) for what in self.happenings),
            *((f.requirement, f.verdict, f.observed, f.reading) for f in self.findings),
        ]


def _untimed(what: TrafficEvent) -> tuple[Any, ...]:
    match what:
        case FrameSeen():
            return (
                "frame",
                what.frame,
                what.place.offset_bytes,
                what.certain,
            )
        case InvalidBytes():
            place = what.place
            return (
                "bytes",
                what.data,
                what.reason,
                place.offset_bytes,
                place.length_bytes,
            )
        case LinkChange() | CaptureGap() | Injected():
            return (what.event.kind, what.event.direction)
        case Exchange():
            frames = [seen.frame for seen in what.frames]
            malformed = what.malformed.data if what.malformed else None
            return (
                "exchange",
                *frames,
                malformed,
                what.ending,
                what.logged_in,
                what.certain,
                [x.name for x in what.concurrent],
                what.expected_position,
            )
        case Transfer():
            return (
                what.name,
                what.state,
                what.reason,
                bytes(what.content),
            )
        case UnsolicitedReply():
            waiting = [x.name for x in what.waiting]
            return (
                "unasked",
                what.seen.frame,
                waiting,
                what.certain,
                what.late,
            )


def _judged(
    events: str | Iterable[WireEvent], dialect: Dialect = DEFAULT, *, needs_login: bool = True
) -> Record:
    judge = Judge(dialect, needs_login=needs_login)
    record = Record(judge, [], [])

    def take(items: Iterable[TrafficEvent | Finding]) -> None:
        for item in items:
            if isinstance(item, Finding):
                record.findings.append(item)
            else:
                record.happenings.append(item)

    for event in _Script().run(events) if isinstance(events, str) else events:
        take(judge.feed(event))
    take(judge.close())
    return record


def _recut(events: Iterable[WireEvent], size_bytes: Callable[[], int]) -> Iterator[WireEvent]:
    for event in events:
        if event.kind is not Kind.BYTES:
            yield event
            continue
        at = 0
        while at < len(event.data):
            piece = event.data[at : at + max(size_bytes(), 1)]
            yield replace(event, data=piece, offset_bytes=event.offset_bytes + at)
            at += len(piece)


def wire_events(session: str) -> list[WireEvent]:
    """Return the wire events of the lines of a session."""
    return _Script().run(session)


@pytest.fixture(scope="session")
def script() -> Callable[[str], list[WireEvent]]:
    """Convert the lines of a session to wire events."""
    return wire_events


@pytest.fixture(scope="session")
def judged() -> Callable[..., Record]:
    """Judge a session, given as lines or as events."""
    return _judged


@pytest.fixture(scope="session")
def check_case() -> Callable[[str, str, str], None]:
    """Compare the judgement of a session with what is expected for one requirement.

    Expected is a verdict, followed by the reading after "tolerated", and by the other requirements
    that fail after another verdict: a violation of a clause often violates a general requirement,
    too.
    """

    def check(requirement: str, expected: str, session: str) -> None:
        verdict, _, more = expected.partition(" ")
        record = _judged(session)
        printed = "\n".join(
            f"{f.requirement} {f.verdict.value}: {f.message}" for f in record.findings
        )
        assert record.verdict(requirement) is Verdict(verdict), printed
        also = set() if verdict == "tolerated" else set(more.split())
        assert record.failed == also | ({requirement} if verdict == "fail" else set()), printed
        findings = [f for f in record.findings if f.requirement == requirement]
        if verdict == "tolerated":
            assert {f.reading for f in findings} == {tuple(more.split("=", 1))}, printed
        for finding in findings:
            assert finding.message
            assert finding.evidence

    return check


@pytest.fixture(scope="session")
def recut() -> Callable[[Iterable[WireEvent], Callable[[], int]], Iterator[WireEvent]]:
    """Cut the bytes of events into pieces of the sizes that a function gives."""
    return _recut
