"""Deriver: decodes and judges a recording once, for every file that is made of it.

Law: it passes on, in order, the raw event and then what it brought about. What an output makes of
that is the output's affair; whether it was right is the judge's.
"""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, Protocol

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.events import Exchange, FrameSeen, TrafficEvent
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks import text as event_text
from scaraspec_recorder.sinks.gap_filler import GapFiller
from scaraspec_recorder.sinks.redaction import Redactor
from scaraspec_recorder.sinks.sink import SinkFailed
from scaraspec_recorder.sinks.text import LogLine

_log = logging.getLogger(__name__)

_LOGGED_FINDINGS: Final = 10
"""How often a log names findings of one requirement and verdict."""

Item = TrafficEvent | Finding


class Output(Protocol):
    """A file or a viewer that takes the raw layer and the derived one."""

    def write(self, event: WireEvent) -> None:
        """Take a raw event."""

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Take what the last raw event brought about.

        Args:
            item: What happened, or a finding on it.
            number: The exchange's number, for a request and an exchange; else that of the last
                request so far. Numbers count the requests of the recording from 1.
            line: What a log says of it; None for single frames and for what it has said too often.
        """

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Write a line of the log that does not come from a raw event.

        Args:
            time_ns: The time of the line, in nanoseconds since the Unix epoch.
            line: The line.
        """

    def tick(self, now_ns: int) -> None:
        """Time has passed: write what is due."""

    def close(self, summary: Mapping[str, str]) -> None:
        """Write the end.

        Args:
            summary: What the recording amounts to, in words.
        """


class Decoder:
    """A sink that feeds several outputs.

    Args:
        outputs: What takes the recording; a failing one's error goes through.
        judge: Follows the connections.
        redactor: Hides passwords in the raw layer too, where it is given.
    """

    def __init__(
        self, outputs: Sequence[Output], judge: Judge, redactor: Redactor | None = None
    ) -> None:
        self._judge = judge
        self._outputs = tuple(outputs)
        self._redactor = redactor
        self._gap_filler = GapFiller()
        self._last = 0
        self._numbers: dict[int, int] = {}  # by identity of the request, until its exchange comes
        self._defect = ""

    def write(self, event: WireEvent) -> None:
        """Take the next raw event."""
        if self._redactor:
            for redacted in self._redactor.feed(event):
                self._write(redacted)
        else:
            self._write(event)

    def tick(self, now_ns: int) -> None:
        """Make everything durable; `now_ns` since the Unix epoch."""
        self._flush()
        for output in self._outputs:
            output.tick(now_ns)

    def close(self) -> None:
        """The recording has ended: hand out what is still open, and close the outputs."""
        self._flush()
        self._hand_out(self._judge.close())
        summary = self.summary()
        for output in self._outputs:
            output.close(summary)

    def summary(self) -> dict[str, str]:
        """What the recording amounts to so far, in words."""
        return {
            **judge_summary(self._judge),
            "exchanges": str(self._last),
            **({"defect": self._defect} if self._defect else {}),
        }

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
        """Derive: a defect here costs the rest of the derived layer, and never the raw one."""
        if self._defect:
            return
        try:
            for item in items:
                number, line = self._number(item), self._line(item)
                for output in self._outputs:
                    output.take(item, number, line)
        except (OSError, SinkFailed):
            raise
        except Exception as error:  # noqa: BLE001 - whatever it is, the raw layer goes on
            self._defect = f"decoding stopped at a defect of this tool: {error!r}"
            _log.exception("decoding stopped, recording goes on")

    def _number(self, item: Item) -> int:
        if isinstance(item, FrameSeen):
            if _is_request(item):
                self._last += 1
                self._numbers[id(item)] = self._last
        elif isinstance(item, Exchange):
            return self._numbers.pop(id(item.request), self._last)
        return self._last

    def _line(self, item: Item) -> LogLine | None:
        """What the log says of it: the same finding only so often, or it would say nothing else."""
        if isinstance(item, Finding):
            found = self._judge.tallies[item.requirement].others
            if found[item.verdict] > _LOGGED_FINDINGS:
                return None
        return event_text.log_line(item)


def judge_summary(judge: Judge) -> dict[str, str]:
    """What a judge has come to since its tallies were last cleared, in words."""
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
