"""Batches change nothing in a file, and a defect of an output does not stop the raw layer."""

import errno
import io
from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scaraspec.judge.judge import Judge
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks import batches
from scaraspec_recorder.sinks.batches import BatchedOutput
from scaraspec_recorder.sinks.decoder import Decoder, Item
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sinks.text import Level, LogLine


class _Kept(io.BytesIO):
    """A file in memory whose content remains when it is closed."""

    content = b""

    def close(self) -> None:
        self.content = self.getvalue()
        super().close()


def write(events: list[WireEvent], ticks: set[int], marks: set[int], *, batched: bool) -> bytes:
    """Write an MCAP file with ticks and marks before some events; return its content."""
    file = _Kept()
    sink = McapSink(file)
    output = BatchedOutput(sink) if batched else sink
    decoder = Decoder([output], Judge())
    for number, event in enumerate(events):
        if number in ticks:
            decoder.tick(event.time_ns)
        if number in marks:
            output.mark(event.time_ns, LogLine(Level.WARN, "test", "a mark"))
        decoder.write(event)
    decoder.close()
    return file.content


@settings(max_examples=20)
@given(st.data())
def test_the_file_is_the_same(passed: list[WireEvent], data: st.DataObject) -> None:
    """Byte by byte, wherever ticks and marks are, and however long a batch may be."""
    numbers = st.sets(st.integers(1, len(passed) - 1))
    ticks, marks = data.draw(numbers), data.draw(numbers)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batches, "_MOST_WAITING", data.draw(st.sampled_from((1, 7, 512))))
        found = write(passed, ticks, marks, batched=True)
    assert found == write(passed, ticks, marks, batched=False)
    assert found


class Tape:
    """An output that keeps what it gets, and fails at the first exchange."""

    def __init__(self, error: Exception) -> None:
        self.events: list[WireEvent] = []
        self.items: list[Item] = []
        self.summary: Mapping[str, str] = {}
        self._error = error

    def write(self, event: WireEvent) -> None:
        self.events.append(event)

    def take(self, item: Item, _number: int, _line: LogLine | None) -> None:
        if isinstance(item, Exchange):
            raise self._error
        self.items.append(item)

    def mark(self, _time_ns: int, _line: LogLine) -> None: ...

    def tick(self, _now_ns: int) -> None: ...

    def close(self, summary: Mapping[str, str]) -> None:
        self.summary = summary


@pytest.mark.parametrize("ticks", [True, False])
def test_a_defect(shift: list[WireEvent], caplog: pytest.LogCaptureFixture, *, ticks: bool) -> None:
    """No more items are written, all raw events are, and the summary says so."""
    tape = Tape(KeyError("defect"))
    decoder = Decoder([BatchedOutput(tape)], Judge())
    for event in shift:
        decoder.write(event)
        if ticks:
            decoder.tick(event.time_ns)
    decoder.close()
    assert tape.events == shift
    assert len(tape.items) < 10
    expected = "decoding stopped because of a defect in this tool: KeyError('defect')"
    assert tape.summary["defect"] == expected
    assert "decoding stopped; recording continues" in caplog.text


def test_a_failing_disk(shift: list[WireEvent]) -> None:
    """The error reaches the caller: it begins again at the last tick."""
    decoder = Decoder([BatchedOutput(Tape(OSError(errno.ENOSPC, "full")))], Judge())
    for event in shift[:30]:
        decoder.write(event)
    with pytest.raises(OSError, match="full"):
        decoder.tick(shift[-1].time_ns)
