"""Captures: the dialogue in a capture file, as rows of typed columns or as Arrow tables."""

from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.report.model import Role
from scaraspec.report.session import SessionStats
from scaraspec.results.comparison import compare
from scaraspec.results.dialogue_comparison import (
    CaptureComparison,
    Dialogue,
    compare_dialogues,
)
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import sending_direction
from scaraspec.tables.rows import RowBuilder
from scaraspec.tables.schema import (
    TABLES,
    ExchangeRow,
    FindingRow,
    LossRow,
    Row,
    TransferRow,
)
from scaraspec.traffic.events import Exchange, TrafficEvent
from scaraspec.traffic.wire import UNJUDGED, Kind
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sources.capture import McapCapture, PcapCapture
from scaraspec_recorder.sources.capture import open_capture as open_source

R = TypeVar("R")


class Step(NamedTuple):
    """A traffic event with the findings about it."""

    event: TrafficEvent
    findings: tuple[Finding, ...]


class Capture:
    """The dialogue in a capture. Each iteration reads the file again.

    Args:
        source: The capture file.
        ics: What the subject claims; None for what the file states.

    Attributes:
        path: The file.
    """

    def __init__(self, source: McapCapture | PcapCapture, ics: Ics | None = None) -> None:
        self.path = source.path
        self._source = source
        self._ics = ics

    @property
    def read_bytes(self) -> int:
        """How much of the file the current iteration has read."""
        return self._source.summary.read_bytes

    @property
    def whole(self) -> bool:
        """Whether the file is not damaged; known after an iteration."""
        return self._source.summary.whole

    @property
    def complete(self) -> bool:
        """Whether nothing is missing in what was captured; known after an iteration."""
        return self._source.summary.complete

    @property
    def notes(self) -> tuple[str, ...]:
        """What is missing or unusual in the file; complete after an iteration."""
        return tuple(self._source.summary.notes)

    def exchanges(self) -> Iterator[ExchangeRow]:
        """Yield the exchanges in the order in which they ended.

        Raises:
            CaptureError: See `open_capture`; also for the other methods.
        """
        return self._of(ExchangeRow)

    def all_exchanges(self) -> Iterator[Exchange]:
        """Yield the exchanges as the judge gets them, with all frames."""
        return (step.event for step in self.steps() if isinstance(step.event, Exchange))

    def transfers(self) -> Iterator[TransferRow]:
        """Yield the file transfers."""
        return self._of(TransferRow)

    def findings(self) -> Iterator[FindingRow]:
        """Yield the findings of the judge other than passes."""
        return self._of(FindingRow)

    def losses(self) -> Iterator[LossRow]:
        """Yield the bytes that are missing in the capture."""
        return self._of(LossRow)

    def table(self, name: str) -> Any:
        """Return a table as `pyarrow.Table`; its method `to_pandas` makes a data frame.

        Args:
            name: One of `TABLES`, such as ``exchanges``.

        Raises:
            KeyError: There is no such table.
            ImportError: The extra `tables` is not installed.
        """
        from scaraspec.tables import arrow  # noqa: PLC0415 - an optional extra

        return arrow.table(name, [*self._of(TABLES[name])])

    def rows(self) -> Iterator[Row]:
        """Yield the rows of all tables; those of sessions and of the file come last."""
        builder, stats = RowBuilder(f"{self.path}"), SessionStats()
        for step in self.steps():
            for item in (step.event, *step.findings):
                stats.add(item)
                if row := builder.take(item):
                    yield row
        yield from builder.finish(stats.session(), whole=self.whole, notes=self.notes, verdict=None)

    def steps(self) -> Iterator[Step]:
        """Yield the traffic events, each with the findings about it.

        Findings about the side that is not the subject of the capture are omitted, as in `audit`.
        """
        from scaraspec.api.auditing import subject_of  # noqa: PLC0415 - imports the MCAP writer

        role, claimed = subject_of(self._source)
        ics = self._ics or claimed
        scope = ics.scope(None if role is Role.CAPTURE else sending_direction(role))
        needs_login, time_scale = self._source.needs_login, ics.time_scale
        judge = Judge(ics.dialect, needs_login=needs_login, scope=scope, time_scale=time_scale)
        unjudged = set[str]()
        for event in self._source:
            if event.kind is Kind.OPENED and event.note == UNJUDGED:
                unjudged.add(event.connection)
            for step in _steps(judge.feed(event)):
                if event.connection in unjudged:
                    yield Step(step.event, ())
                else:
                    yield _in_scope(step, judge)
        for step in _steps(judge.close()):
            yield _in_scope(step, judge)

    def _of(self, kind: type[R]) -> Iterator[R]:
        return (row for row in self.rows() if isinstance(row, kind))


def open_capture(
    path: Path,
    *,
    port: int | None = DEFAULT_PORT,
    ics: Ics | None = None,
    wait: Callable[[], bool] | None = None,
) -> Capture:
    """Open an MCAP recording, or a pcap or pcapng file.

    Args:
        path: The file.
        port: The controller's TCP port in packet captures; None for all connections of this
            protocol.
        ics: What the subject claims; None for what the file states.
        wait: Called at the end of an MCAP recording in progress; returns whether to read on.

    Raises:
        CaptureError: The file cannot be read, is not a capture, or cannot grow.
    """
    source = open_source(path, port=port, wait=wait)
    if wait and not isinstance(source, McapCapture):
        raise CaptureError(
            UserMessage("{path} is no MCAP recording: only a recording can be followed", path=path)
        )
    return Capture(source, ics)


def compare_captures(
    before: Path, after: Path, *, port: int | None = DEFAULT_PORT
) -> CaptureComparison:
    """Compare how the same requests were answered in two captures, and what the judge found.

    Args:
        before: The first capture.
        after: The second capture.
        port: The controller's TCP port in packet captures; None for all connections of this
            protocol.

    Raises:
        CaptureError: A capture cannot be read.
    """
    from scaraspec.api.auditing import audit  # noqa: PLC0415 - imports the MCAP writer

    first, second = (
        Dialogue.of(open_capture(path, port=port).all_exchanges()) for path in (before, after)
    )
    judged = compare(*(audit(path, port=port)[0] for path in (before, after)))
    return CaptureComparison(compare_dialogues(first, second), judged)


def _steps(items: Iterator[TrafficEvent | Finding]) -> Iterator[Step]:
    """Group what the judge yields: each traffic event comes before its findings."""
    event: TrafficEvent | None = None
    findings: list[Finding] = []
    for item in chain(items, (None,)):
        if isinstance(item, Finding):
            findings.append(item)
            continue
        if event is not None:
            yield Step(event, tuple(findings))
        event, findings = item, []


def _in_scope(step: Step, judge: Judge) -> Step:
    included = (f for f in step.findings if judge.scope.includes(f.requirement, step.event))
    return step if not step.findings else Step(step.event, tuple(included))


__all__: Final = ["Capture", "Step", "compare_captures", "open_capture"]
