"""What a file says of its streams is held against what it holds."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sources.mcap_reader import McapSummary, read_mcap


def read(path: Path) -> McapSummary:
    """The summary of a recording that was read to its end."""
    capture = read_mcap(path)
    assert list(capture)
    return capture.summary


def written(path: Path, events: list[WireEvent], lie: WireEvent | None = None) -> Path:
    """A recording; a lie is in its accounts and not in its raw layer."""
    sink = McapSink(path.open("wb"))
    for number, event in enumerate(events):
        sink.write(event)
        if number % 40 == 0:
            sink.tick(event.time_ns)
    if lie:
        sink._byte_accounting.add(lie)
    sink.close({})
    return path


@pytest.mark.parametrize("count", [1, 50, None])
def test_an_honest_file(shift: list[WireEvent], tmp_path: Path, count: int | None) -> None:
    """Streams that have ended, and streams that are open at the end of the file."""
    summary = read(written(tmp_path / "a.mcap", shift[:count]))
    assert (summary.wrong_accounts, summary.notes) == (0, [])


@pytest.mark.parametrize(
    "change",
    [
        lambda event: replace(event, kind=Kind.BYTES, data=b"\x00"),
        lambda event: replace(event, kind=Kind.GAP, data=b"", length_bytes=5),
        lambda event: replace(event, connection="2"),
    ],
)
def test_a_file_that_lies(
    shift: list[WireEvent], tmp_path: Path, change: Callable[[WireEvent], WireEvent]
) -> None:
    """Other bytes, a gap that is not there, a stream that is not there: told in a note."""
    lie = change(next(event for event in reversed(shift[:60]) if event.kind is Kind.BYTES))
    summary = read(written(tmp_path / "a.mcap", shift[:60], lie))
    assert summary.wrong_accounts == 1
    (note,) = summary.notes
    assert note.startswith("1 streams are not what the file's own accounts say of them")


def test_a_torn_file_is_not_accused(shift: list[WireEvent], tmp_path: Path) -> None:
    """Its last accounts were never written: it is torn, and that is all."""
    path = written(tmp_path / "a.mcap", shift[:100])
    path.write_bytes(path.read_bytes()[:-2000])
    summary = read(path)
    assert summary.wrong_accounts == 0
    assert not summary.finished


def test_a_damaged_chunk_shows_in_the_accounts(
    shift: list[WireEvent], tmp_path: Path, damage_chunk: Callable[[Path, int], None]
) -> None:
    """What is left out of the reading is missing in the count too."""
    path = written(tmp_path / "a.mcap", shift)
    damage_chunk(path, 2)
    assert read(path).wrong_accounts > 0
