"""Repair of files whose writer was killed, with a note of the loss."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import A2C
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.repair import repair
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sources.mcap_reader import read_mcap


def record(path: Path, events: Iterable[WireEvent]) -> list[tuple[int, int]]:
    """Record with a tick every fifth event; return file size and event count at each tick."""
    decoder = Decoder([McapSink(path.open("wb"))], Judge())
    ticks = []
    for count, event in enumerate(events, start=1):
        decoder.write(event)
        if count % 5 == 0:
            decoder.tick(event.time_ns)
            ticks.append((path.stat().st_size, count))
    decoder.close()
    return ticks


def test_a_complete_file_is_not_changed(shift: list[WireEvent], tmp_path: Path) -> None:
    """Nothing is written."""
    path = tmp_path / "capture.mcap"
    record(path, shift)
    before, stamp = path.read_bytes(), path.stat().st_mtime_ns
    report = repair(path)
    assert (report.repaired, report.events, report.notes) == (False, len(shift), ())
    assert (path.read_bytes(), path.stat().st_mtime_ns) == (before, stamp)
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_truncated_anywhere_keeps_every_tick(
    shift: list[WireEvent], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The repaired file is complete and has all events up to the last tick."""
    monkeypatch.setattr("os.fsync", lambda _: None)  # a thousand temporary files
    path = tmp_path / "capture.mcap"
    ticks = record(path, shift[:15])
    data = path.read_bytes()
    broken_off = 0
    sizes = {*range(1, len(data), 41), *(size + d for size, _ in ticks for d in (-1, 0, 1))}
    for size in sorted(sizes):
        path.write_bytes(data[:size])
        expected = max((count for at, count in ticks if at <= size), default=0)
        try:
            report = repair(path)
        except CaptureError:
            assert expected == 0
            assert path.stat().st_size == size
            broken_off += 1
            continue
        assert report.repaired
        assert report.notes
        assert report.events >= expected
        back = read_mcap(path)
        assert list(back) == shift[: report.events]
        assert back.summary.intact
        assert not back.summary.whole
    assert 0 < broken_off < len(sizes) - 10


def test_the_repaired_file_satisfies_the_strict_reader(
    shift: list[WireEvent], tmp_path: Path
) -> None:
    """Index, checksums, summary, attachments and accounts are restored."""
    path = tmp_path / "capture.mcap"
    ticks = record(path, shift)
    size, count = ticks[-2]
    path.write_bytes(path.read_bytes()[: size + 30])
    report = repair(path)
    assert report.events == count
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        raw = [m for _, c, m in reader.iter_messages() if c.topic in ("/raw/a2c", "/raw/c2a")]
        names = {record.name: record.metadata for record in reader.iter_metadata()}
        (attachment,) = reader.iter_attachments()
    assert len(raw) == sum(event.kind is Kind.BYTES for event in shift[:count])
    assert attachment.name == "upload pick.rob"
    assert set(names) == {"session", "stream/1/A2C", "stream/1/C2A", "recovered"}
    sent = sum(len(e.data) for e in shift[:count] if e.direction is A2C)
    assert names["stream/1/A2C"]["recorded_bytes"] == str(sent)
    assert list(names["recovered"].values()) == list(report.notes)


def test_repairing_twice(shift: list[WireEvent], tmp_path: Path) -> None:
    """The repaired file is complete; the second repair does not change it."""
    path = tmp_path / "capture.mcap"
    record(path, shift)
    path.write_bytes(path.read_bytes()[:-9])
    assert repair(path).repaired
    repaired = path.read_bytes()
    assert not repair(path).repaired
    assert path.read_bytes() == repaired


def test_a_damaged_chunk(
    shift: list[WireEvent], tmp_path: Path, damage_chunk: Callable[[Path, int], None]
) -> None:
    """A closed file with a damaged chunk is repaired, and contains a note of the loss."""
    path = tmp_path / "capture.mcap"
    record(path, shift)
    damage_chunk(path, 3)
    damaged = path.read_bytes()
    report = repair(path)
    assert report.repaired
    assert len(report.notes) == 3
    assert report.events == len(shift) - 5
    assert report.original
    assert report.original.read_bytes() == damaged


@pytest.mark.parametrize("bit", [0, 5, 17, 40, 63])
def test_a_wrong_length_loses_nothing(shift: list[WireEvent], tmp_path: Path, bit: int) -> None:
    """The lengths inside the records correct it; every damaged file is kept under its own name."""
    path = tmp_path / "capture.mcap"
    record(path, shift[:12])
    data, starts = path.read_bytes(), [len(MAGIC)]
    while (end := starts[-1] + 9 + int.from_bytes(data[starts[-1] + 1 :][:8], "little")) < len(
        data
    ) - len(MAGIC):
        starts.append(end)
    for number, start in enumerate(starts[1:], start=1):
        damaged = bytearray(data)
        damaged[start + 1 + bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        capture = read_mcap(path)
        assert list(capture) == shift[:12]
        assert not capture.summary.whole
        report = repair(path)
        assert report.original or start == starts[-1]
        assert list(read_mcap(path)) == shift[:12]
        assert len(list(tmp_path.glob("capture.mcap.damaged*"))) in {number, number - 1}


def test_records_of_another_writer_keep_their_times(tmp_path: Path) -> None:
    """The repaired file has the publish times and creation times of the damaged one."""
    path = tmp_path / "capture.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start("profile", "another tool")
        schema = writer.register_schema(schemas.full_name(schemas.Gap), "protobuf", b"")
        other = writer.register_channel("/other", "json", 0)
        writer.register_channel("/gap", "protobuf", schema)
        writer.add_attachment(10, 20, "note", "text/plain", b"text")
        writer.add_message(other, 40, b"{}", publish_time=30)
        writer.finish()  # type: ignore[no-untyped-call]  # it has no types
    path.write_bytes(path.read_bytes()[:-1])
    assert repair(path).repaired
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        (note,) = reader.iter_attachments()
        assert (note.create_time, note.log_time) == (10, 20)
        ((_, _, message),) = reader.iter_messages()
        assert (message.log_time, message.publish_time) == (40, 30)
        assert reader.get_header().profile == "profile"


def test_foreign_files_are_not_changed(tmp_path: Path) -> None:
    """No copy remains."""
    path = tmp_path / "notes.mcap"
    path.write_text("mine")
    with pytest.raises(CaptureError, match="is not an MCAP file"):
        repair(path)
    assert path.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_keeps_the_damaged_file(
    shift: list[WireEvent], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is replaced only after the repaired file is on the disk."""
    path = tmp_path / "capture.mcap"
    record(path, shift)
    truncated = path.read_bytes()[:-9]
    path.write_bytes(truncated)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        repair(path)
    assert path.read_bytes() == truncated
    assert list(tmp_path.iterdir()) == [path]


WRITER = """
import sys
from pathlib import Path
from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.protocol.direction import A2C
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink

decoder = Decoder([McapSink(Path(sys.argv[1]).open("wb"))], Judge())
frame = bytes.fromhex("AA 09 00 CC")
for number in range(100_000):
    decoder.write(WireEvent(number, "1", A2C, Kind.BYTES, frame, 4 * number))
    if number % 7 == 0:
        decoder.tick(number)
        print(number + 1, flush=True)
"""


@pytest.mark.parametrize("ticks", [1, 2, 5, 20])
def test_sigkill_loses_at_most_one_tick(tmp_path: Path, ticks: int) -> None:
    """All events up to the last tick are in the file."""
    path = tmp_path / "capture.mcap"
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, path], stdout=subprocess.PIPE, text=True
    ) as writer:
        assert writer.stdout
        expected = [int(writer.stdout.readline()) for _ in range(ticks)][-1]
        writer.send_signal(signal.SIGKILL)
    report = repair(path)
    assert report.repaired
    assert report.events >= expected
    back = read_mcap(path)
    assert [event.offset_bytes for event in back] == list(range(0, 4 * report.events, 4))
    assert back.summary.intact
