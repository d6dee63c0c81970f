"""Statistics of the traffic of a session, in bounded memory.

`SessionStats` takes all items that a judge yields and makes no verdicts. Durations are counted in
histograms (see `histogram` for their error). Lists have a limit; further entries are only counted.
"""

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from statistics import median
from typing import Final, TypeVar

from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.fields import show
from scaraspec.report.evidence import EvidenceCollector
from scaraspec.report.histogram import Histogram
from scaraspec.report.model import (
    CommandSeen,
    ConnectionSeen,
    Loss,
    RunSeen,
    Session,
    TransferSeen,
)
from scaraspec.traffic.events import (
    CaptureGap,
    Ending,
    Exchange,
    FrameSeen,
    Injected,
    InvalidBytes,
    LinkChange,
    TrafficEvent,
    Transfer,
)
from scaraspec.traffic.wire import Kind, WireEvent, WireRange
from scaraspec.user_message import UserMessage

_MAX_LISTED: Final = 500
_RUNS: Final = ("run_program", "simulate_program")

T = TypeVar("T")


@dataclass(slots=True)
class _Command:
    """Statistics of one command."""

    count: int = 0
    refused: int = 0
    endings: Counter[str] = field(default_factory=Counter)
    latency: Histogram = field(default_factory=Histogram)
    duration: Histogram = field(default_factory=Histogram)


@dataclass(slots=True)
class _Connection:
    """Statistics of one connection."""

    begun_ns: int
    ended_ns: int
    bytes: Counter[Direction] = field(default_factory=Counter)
    frames: int = 0
    ending: str = "open"
    note: str = ""
    faults: int = 0

    @property
    def remark(self) -> str:
        """The addresses and the number of injected faults."""
        faults = UserMessage("injected faults: {faults}", faults=self.faults) if self.faults else ""
        return "; ".join(filter(None, (self.note, faults)))


class SessionStats:
    """Counts traffic events.

    Attributes:
        evidence: Stores the evidence of findings.
    """

    def __init__(self) -> None:
        self.evidence = EvidenceCollector()
        self._begun_ns: int | None = None
        self._ended_ns = 0
        self._bytes: Counter[Direction] = Counter()
        self._frames = self._undecodable_bytes = 0
        self._connections: dict[str, _Connection] = {}
        self._commands: defaultdict[str, _Command] = defaultdict(_Command)
        self._transfers: list[TransferSeen] = []
        self._runs: list[RunSeen] = []
        self._losses: list[Loss] = []
        self._lost_bytes = 0
        self._unlisted: Counter[str] = Counter()

    def add(self, item: TrafficEvent | Finding) -> None:
        """Add the next item that a judge yields."""
        self.evidence.add(item)
        match item:
            case FrameSeen():
                self._frames += 1
                connection = self._count_bytes(item.place)
                if connection:
                    connection.frames += 1
            case InvalidBytes():
                self._undecodable_bytes += item.place.length_bytes
                self._count_bytes(item.place)
            case LinkChange(event):
                self._add_link_change(event)
            case CaptureGap(event):
                self._add_loss(event)
            case Injected(event):
                self._add_fault(event)
            case Exchange():
                self._add_exchange(item)
            case Transfer():
                self._add_to("transfers", self._transfers, _transfer(item))

    @property
    def round_trip_s(self) -> float | None:
        """The median time from a request to its first reply, in seconds; None without a reply.

        It is the median over the commands.
        """
        timings = (command.latency.timing() for command in self._commands.values())
        return median(t.p50_ms / 1e3 for t in ts) if (ts := [*filter(None, timings)]) else None

    def session(self) -> Session | None:
        """Return the statistics so far; None if there were no events."""
        if self._begun_ns is None:
            return None
        return Session(
            begun_ns=self._begun_ns,
            ended_ns=self._ended_ns,
            bytes={d: self._bytes[d] for d in Direction},
            frames=self._frames,
            undecodable_bytes=self._undecodable_bytes,
            connections=tuple(
                ConnectionSeen(
                    name,
                    c.begun_ns,
                    c.ended_ns,
                    {d: c.bytes[d] for d in Direction},
                    c.frames,
                    c.ending,
                    c.remark,
                )
                for name, c in self._connections.items()
            ),
            exchanges=tuple(
                CommandSeen(
                    name,
                    c.count,
                    c.refused,
                    dict(sorted(c.endings.items())),
                    c.latency.timing(),
                    c.duration.timing(),
                )
                for name, c in sorted(self._commands.items())
            ),
            transfers=tuple(self._transfers),
            runs=tuple(self._runs),
            losses=tuple(self._losses),
            unlisted=dict(self._unlisted),
            lost_bytes=self._lost_bytes,
        )

    def one_sided(self) -> dict[str, Direction]:
        """Return the connections with bytes of one side only, and whose bytes are missing."""
        missing = {(loss.connection, loss.direction) for loss in self._losses}
        return {
            name: direction
            for name, connection in self._connections.items()
            for direction in Direction
            if (name, direction) in missing
            and connection.bytes[direction.opposite]
            and not connection.bytes[direction]
        }

    def _connection_at(self, name: str, time_ns: int) -> _Connection | None:
        """Return the connection and extend it to `time_ns`; None if it is not listed."""
        if self._begun_ns is None or time_ns < self._begun_ns:
            self._begun_ns = time_ns
        self._ended_ns = max(self._ended_ns, time_ns)
        connection = self._connections.get(name)
        if connection is None:
            if len(self._connections) >= _MAX_LISTED:
                return None
            connection = self._connections[name] = _Connection(time_ns, time_ns)
        connection.ended_ns = max(connection.ended_ns, time_ns)
        return connection

    def _count_bytes(self, place: WireRange) -> _Connection | None:
        self._bytes[place.direction] += place.length_bytes
        connection = self._connection_at(place.connection, place.time_ns)
        if connection:
            connection.bytes[place.direction] += place.length_bytes
        return connection

    def _add_link_change(self, event: WireEvent) -> None:
        connection = self._connection_at(event.connection, event.time_ns)
        if connection is None:
            if event.kind is Kind.OPENED:
                self._unlisted["connections"] += 1
        elif event.kind is Kind.OPENED:
            connection.note = event.note
        else:
            connection.ending = event.kind.value

    def _add_loss(self, event: WireEvent) -> None:
        connection = self._connection_at(event.connection, event.time_ns)
        if connection and not connection.note and "→" in event.note:
            connection.note = event.note  # the capture begins mid-stream
        if not event.is_loss:
            return  # but earlier traffic is not reliable
        self._lost_bytes += max(event.length_bytes, 0)
        loss = Loss(
            event.connection,
            event.direction,
            event.offset_bytes,
            event.length_bytes,
            event.time_ns,
            event.note,
        )
        self._add_to("losses", self._losses, loss)

    def _add_fault(self, event: WireEvent) -> None:
        if connection := self._connection_at(event.connection, event.time_ns):
            connection.faults += 1

    def _add_exchange(self, exchange: Exchange) -> None:
        command = self._commands[exchange.name]
        command.count += 1
        command.refused += exchange.accepted is False
        if exchange.ending is not Ending.ANSWERED:
            command.endings[exchange.ending.value] += 1
        if (latency_ns := exchange.latency_ns) is not None:
            command.latency.add(latency_ns)
        if (duration_ns := exchange.duration_ns) is not None:
            command.duration.add(duration_ns)
        if exchange.name in _RUNS:
            self._add_to("runs", self._runs, _run(exchange))

    def _add_to(self, name: str, listed: list[T], item: T) -> None:
        if len(listed) < _MAX_LISTED:
            listed.append(item)
        else:
            self._unlisted[name] += 1


def _transfer(transfer: Transfer) -> TransferSeen:
    return TransferSeen(
        name=show(transfer.name),
        upload=transfer.upload,
        begun_ns=transfer.begun_ns,
        duration_ms=(transfer.ended_ns - transfer.begun_ns) / 1e6,
        size_bytes=transfer.size_bytes,
        received_bytes=transfer.received_bytes,
        chunks=transfer.chunks,
        order=transfer.order,
        state=transfer.state.value,
        reason=transfer.reason,
    )


def _run(exchange: Exchange) -> RunSeen:
    outcome, code = _outcome(exchange)
    duration_ns = exchange.duration_ns
    return RunSeen(
        name=show(exchange.request_value or b""),
        simulated=exchange.name == "simulate_program",
        begun_ns=exchange.time_ns,
        duration_ms=None if duration_ns is None else duration_ns / 1e6,
        outcome=outcome,
        code=code or "",
    )


def _outcome(exchange: Exchange) -> tuple[str, str | None]:
    """Return the outcome of a run and its code of table 8-1, if there is one."""
    outcome = exchange.outcome
    if exchange.accepted is False:
        return "refused", getattr(exchange.reply_value, "code", None)
    if exchange.interrupted_by:
        return "interrupted", outcome.code if outcome else None
    if outcome is None:
        return exchange.ending.value, None
    return ("done" if outcome.done else "failed"), outcome.code
