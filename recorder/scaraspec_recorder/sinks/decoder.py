"""Decodes and judges a recording once, for all outputs.

The decoder passes each raw event to the outputs, followed by the items derived from it: traffic
events and findings. `scaraspec.judge` decides conformance.
"""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, Protocol

from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.events import Exchange, FrameSeen, TrafficEvent
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks import text as event_text
from scaraspec_recorder.sinks.clock_watch import LOG_SOURCE, ClockWatch
from scaraspec_recorder.sinks.gap_filler import GapFiller
from scaraspec_recorder.sinks.redaction import Redactor
from scaraspec_recorder.sinks.sink import ENVIRONMENT_FAILURES
from scaraspec_recorder.sinks.text import Level, LogLine
from scaraspec_recorder.units import show_duration

if TYPE_CHECKING:
    from scaraspec.judge.judge import Judge

_log = logging.getLogger(__name__)

_LOGGED_FINDINGS: Final = 10
"""Maximum number of log lines for findings of one requirement and verdict."""

Item = TrafficEvent | Finding


class Output(Protocol):
    """A file or viewer that receives raw events and derived items."""

    def write(self, event: WireEvent) -> None:
        """Write a raw event."""

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Write an item derived from the last raw event.

        Args:
            item: A traffic event or a finding.
            number: Number of the exchange for a request or an exchange; otherwise that of the last
                request. Numbers count the requests of the recording from 1.
            line: Log line of the item; None for single frames and repeated findings.
        """

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Write a line of the log that does not come from a raw event.

        Args:
            time_ns: The time of the line, in nanoseconds since the Unix epoch.
            line: The line.
        """

    def tick(self, now_ns: int) -> None:
        """Write pending data."""

    def close(self, summary: Mapping[str, str]) -> None:
        """Write the end of the output.

        Args:
            summary: Summary of the recording, as text.
        """


class Decoder:
    """A sink that decodes events and passes them to several outputs.

    Args:
        outputs: The outputs; their exceptions are not caught.
        judge: Judges the traffic.
        redactor: Masks passwords in raw bytes; None to keep them.
        clock: Detects steps of the clock and suspends of the machine, which are logged, also in the
            outputs; None for none.
    """

    def __init__(
        self,
        outputs: Sequence[Output],
        judge: "Judge",
        redactor: Redactor | None = None,
        clock: ClockWatch | None = None,
    ) -> None:
        self._judge = judge
        self._outputs = tuple(outputs)
        self._redactor = redactor
        self._clock = clock
        self._gap_filler = GapFiller()
        self._last = 0
        self._numbers: dict[int, int] = {}  # by id() of the request, until its exchange is complete
        self._defect = ""

    def write(self, event: WireEvent) -> None:
        """Process the next raw event."""
        if self._redactor:
            for redacted in self._redactor.feed(event):
                self._write(redacted)
        else:
            self._write(event)

    def tick(self, now_ns: int) -> None:
        """Make everything durable; `now_ns` since the Unix epoch."""
        self._flush()
        if self._clock:
            if step_ns := self._clock.step_ns():
                way = "forward" if step_ns > 0 else "back"
                self._mark(now_ns, f"the clock was set {way} by {show_duration(abs(step_ns))}")
            if suspended_ns := self._clock.suspended_ns():
                whole_ns = round(suspended_ns, -9)
                self._mark(now_ns, f"the machine was suspended for {show_duration(whole_ns)}")
        for output in self._outputs:
            output.tick(now_ns)

    def close(self) -> None:
        """Finish: pass on the remaining items, and close the outputs."""
        self._flush()
        self._hand_out(self._judge.close())
        summary = self.summary()
        for output in self._outputs:
            output.close(summary)

    def summary(self) -> dict[str, str]:
        """Return the summary of the recording so far, as text."""
        return {
            **judge_summary(self._judge),
            "exchanges": str(self._last),
            **({"defect": self._defect} if self._defect else {}),
        }

    def _mark(self, now_ns: int, text: str) -> None:
        _log.warning("%s", text)
        for output in self._outputs:
            output.mark(now_ns, LogLine(Level.WARN, LOG_SOURCE, text))

    def _flush(self) -> None:
        if self._redactor:
            for redacted in self._redactor.flush():
                self._write(redacted)

    def _write(self, event: WireEvent) -> None:
        for output in self._outputs:
            output.write(event)
        for filled in self._gap_filler.fill(event):
            self._hand_out(self._judge.feed(filled))

    def _hand_out(self, items: Iterable[Item]) -> None:
        """Pass items to the outputs. After a defect, only raw events are passed on."""
        if self._defect:
            return
        try:
            for item in items:
                number, line = self._number(item), self._line(item)
                for output in self._outputs:
                    output.take(item, number, line)
        except ENVIRONMENT_FAILURES:
            raise
        except Exception as error:  # noqa: BLE001 - the raw layer must continue
            self._defect = defect_text(error)
            _log.exception("decoding stopped; recording continues")

    def _number(self, item: Item) -> int:
        if isinstance(item, FrameSeen):
            if _is_request(item):
                self._last += 1
                self._numbers[id(item)] = self._last
        elif isinstance(item, Exchange):
            return self._numbers.pop(id(item.request), self._last)
        return self._last

    def _line(self, item: Item) -> LogLine | None:
        """Return the log line of an item; None for repeated findings beyond the limit."""
        if isinstance(item, Finding):
            found = self._judge.tallies[item.requirement].others
            if found[item.verdict] > _LOGGED_FINDINGS:
                return None
        return event_text.log_line(item)


def defect_text(error: Exception) -> str:
    """Return what the summary of a recording says about a defect of this tool."""
    return f"decoding stopped because of a defect in this tool: {error!r}"


def judge_summary(judge: "Judge") -> dict[str, str]:
    """Return the results of a judge since its tallies were last cleared, as text."""
    worst = Counter(stats.verdict for stats in judge.tallies.values())
    return {
        "conclusion": judge.conclusion.value,
        **{f"requirements {verdict.value}": str(count) for verdict, count in worst.items()},
        "client speaks": _dialect_text(judge.dialect_seen.of(A2C)),
        "controller speaks": _dialect_text(judge.dialect_seen.of(C2A)),
    }


def _is_request(seen: FrameSeen) -> bool:
    if seen.parsed:
        return seen.parsed.part == "request"
    return seen.frame.direction is A2C and not seen.frame.tagged


def _dialect_text(seen: Mapping[str, tuple[str, ...]]) -> str:
    return ", ".join(f"{key}={'/'.join(options)}" for key, options in seen.items())
