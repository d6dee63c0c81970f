"""The byte counts in a file are compared with its content."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.sources.mcap_records import McapSummary


def read(path: Path) -> McapSummary:
    """Return the summary of a recording after it was read completely."""
    capture = read_mcap(path)
    assert list(capture)
    return capture.summary


def write_recording(
    path: Path, events: list[WireEvent], false_event: WireEvent | None = None
) -> Path:
    """Write a recording; `false_event` is only in its byte counts, not in the raw layer."""
    sink = McapSink(path.open("wb"))
    for number, event in enumerate(events):
        sink.write(event)
        if number % 40 == 0:
            sink.tick(event.time_ns)
    if false_event:
        sink._byte_accounting.add(false_event)
    sink.close({})
    return path


@pytest.mark.parametrize("count", [1, 50, None])
def test_correct_accounts(shift: list[WireEvent], tmp_path: Path, count: int | None) -> None:
    """The counts are right for ended streams and for streams that are open at the end of the
    file."""
    summary = read(write_recording(tmp_path / "a.mcap", shift[:count]))
    assert (summary.wrong_accounts, summary.notes) == (0, [])


@pytest.mark.parametrize(
    "change",
    [
        lambda event: replace(event, kind=Kind.BYTES, data=b"\x00"),
        lambda event: replace(event, kind=Kind.GAP, data=b"", length_bytes=5),
        lambda event: replace(event, connection="2"),
    ],
)
def test_wrong_accounts(
    shift: list[WireEvent], tmp_path: Path, change: Callable[[WireEvent], WireEvent]
) -> None:
    """Different bytes, a missing gap or a missing stream cause a note."""
    false_event = change(next(event for event in reversed(shift[:60]) if event.kind is Kind.BYTES))
    summary = read(write_recording(tmp_path / "a.mcap", shift[:60], false_event))
    assert summary.wrong_accounts == 1
    (note,) = summary.notes
    assert note.startswith("1 streams are not what the file's own accounts say of them")


def test_a_truncated_file_has_no_wrong_accounts(shift: list[WireEvent], tmp_path: Path) -> None:
    """The last counts were not written; the only note is that the file is truncated."""
    path = write_recording(tmp_path / "a.mcap", shift[:100])
    path.write_bytes(path.read_bytes()[:-2000])
    summary = read(path)
    assert summary.wrong_accounts == 0
    assert not summary.finished


def test_a_damaged_chunk_causes_wrong_accounts(
    shift: list[WireEvent], tmp_path: Path, damage_chunk: Callable[[Path, int], None]
) -> None:
    """Skipped bytes are missing in the count."""
    path = write_recording(tmp_path / "a.mcap", shift)
    damage_chunk(path, 2)
    assert read(path).wrong_accounts > 0
