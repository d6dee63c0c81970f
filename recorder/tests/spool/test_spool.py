"""The spool: the reader gets all appended records, or a gap that describes the loss."""

import errno
import os
import shutil
from collections.abc import Callable
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool import spool
from scaraspec_recorder.spool.records import ControlRecord, Record, stream_number
from scaraspec_recorder.spool.spool import SpoolReader, SpoolWriter

STREAM = stream_number(1, A2C)
OTHER = stream_number(1, C2A)


class Timer:
    """Runs callbacks when the test fires it."""

    def __init__(self) -> None:
        self.waiting: list[Callable[[], None]] = []

    def __call__(self, _delay_s: float, callback: Callable[[], None]) -> None:
        self.waiting.append(callback)

    def fire(self) -> None:
        due, self.waiting = self.waiting, []
        for callback in due:
            callback()


class Disk:
    """Writes like `os.write` until it is set to refuse."""

    def __init__(self) -> None:
        self.refuses = False
        self.room_bytes: int | None = None

    def write(self, descriptor: int, data: bytes | bytearray) -> int:
        if self.refuses or self.room_bytes == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if self.room_bytes is not None:
            data = data[: self.room_bytes]
            self.room_bytes -= len(data)
        return os.write(descriptor, data)


class Bench:
    """A writer with its timer and its disk."""

    def __init__(self, directory: Path, **options: int) -> None:
        self.timer, self.disk = Timer(), Disk()
        self.directory = directory
        self.writer = SpoolWriter(
            directory, self.timer, write=self.disk.write, now_ns=lambda: 7, **options
        )
        self.sent = {STREAM: 0, OTHER: 0}

    def send(self, data: bytes, stream: int = STREAM) -> None:
        self.writer.append(Kind.BYTES, stream, self.sent[stream] + 100, self.sent[stream], data)
        self.sent[stream] += len(data)

    def read(self) -> list[Record]:
        with closing(SpoolReader(self.directory)) as reader:
            return drain(reader)


def drain(reader: SpoolReader) -> list[Record]:
    records: list[Record] = []
    while new := reader.read():
        records += new
    return records


def summaries(records: list[Record]) -> list[tuple[Kind | ControlRecord, int, int]]:
    """Return kind, offset and length of each record."""
    return [
        (r.kind, r.offset_bytes, r.length_bytes or len(r.payload) * (r.kind is Kind.BYTES))
        for r in records
    ]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path / "spool")


record_fields = st.tuples(
    st.sampled_from([*Kind, *ControlRecord]),
    st.integers(0, 2**64 - 1),
    st.integers(0, 2**64 - 1),
    st.integers(0, 2**64 - 1),
    st.binary(max_size=300),
    st.integers(0, 2**64 - 1),
    st.booleans(),
)


@given(st.lists(record_fields, max_size=30), st.sets(st.integers(0, 30)))
def test_records_are_unchanged(
    tmp_path_factory: pytest.TempPathFactory, fields: list[tuple], flushes: set[int]
) -> None:
    """Every field of every record, in order, for any division into blocks."""
    bench = Bench(tmp_path_factory.mktemp("spool"))
    for number, record in enumerate(fields):
        bench.writer.append(*record)
        if number in flushes:
            bench.timer.fire()
    bench.writer.close()
    assert bench.read()[1:] == [Record(*record) for record in fields]


def test_a_writer_begins_with_a_restart(bench: Bench) -> None:
    """The reader learns that connection numbers start again."""
    bench.writer.close()
    assert bench.read() == [
        Record(ControlRecord.RESTART, 0, 7, 0, b"the forwarding process started")
    ]


def test_a_removed_spool_is_continued(bench: Bench) -> None:
    """The reader gets what it had not read yet, and what follows."""
    bench.send(b"abc")
    bench.writer.flush()
    with closing(SpoolReader(bench.directory)) as reader:
        assert len(drain(reader)) == 2
        reader.acknowledge({"connections": 1})
        bench.send(b"def")
        bench.writer.flush()
        shutil.rmtree(bench.directory)
        bench.send(b"ghi")
        bench.writer.flush()
        assert [record.payload for record in drain(reader)] == [b"def", b"ghi"]
        reader.restore()
    assert spool.read_checkpoint(bench.directory)["state"] == {"connections": 1}


def test_the_timer_writes_records(bench: Bench) -> None:
    """Without further traffic a record is written when the timer fires, not before."""
    bench.send(b"abc")
    assert bench.read() == []
    bench.timer.fire()
    assert summaries(bench.read())[1:] == [(Kind.BYTES, 0, 3)]
    assert bench.timer.waiting == []


def test_a_reader_follows_a_live_writer(bench: Bench) -> None:
    """Without new records the result is empty; later records are returned later."""
    with closing(SpoolReader(bench.directory)) as reader:
        assert reader.read() == []
        for offset in range(0, 3000, 3):
            bench.send(b"abc")
            bench.writer.flush()
            assert summaries(drain(reader))[-1] == (Kind.BYTES, offset, 3)
        assert reader.read() == []


def test_a_reader_continues_after_its_last_acknowledgment(bench: Bench) -> None:
    """Unacknowledged records are returned again; the state is stored with the position."""
    bench.send(b"abc")
    bench.writer.flush()
    with closing(SpoolReader(bench.directory)) as first:
        assert first.state == {}
        assert len(drain(first)) == 2
        first.acknowledge({"made": ["a"]})
        bench.send(b"de")
        bench.writer.flush()
        assert summaries(drain(first)) == [(Kind.BYTES, 3, 2)]
    with closing(SpoolReader(bench.directory)) as second:
        assert second.state == {"made": ["a"]}
        assert summaries(drain(second)) == [(Kind.BYTES, 3, 2)]


def test_an_unreadable_checkpoint(bench: Bench) -> None:
    """After a loss of power it may be garbage: all segments are read again."""
    bench.send(b"abc")
    bench.writer.close()
    (bench.directory / "checkpoint.json").write_bytes(b"\0\0{")
    assert summaries(bench.read())[-1] == (Kind.BYTES, 0, 3)


def test_acknowledged_segments_are_deleted(tmp_path: Path) -> None:
    """The spool does not grow with the recording."""
    bench = Bench(tmp_path / "spool", limit_bytes=160_000)
    with closing(SpoolReader(bench.directory)) as reader:
        for _ in range(100):
            bench.send(bytes(5_000))
            bench.writer.flush()
            drain(reader)
            reader.acknowledge({})
            assert spool.backlog_bytes(bench.directory) < 30_000
    assert bench.sent[STREAM] == 500_000


def test_a_second_reader_is_refused(bench: Bench) -> None:
    """While one reader is open, no other can open the spool."""
    with closing(SpoolReader(bench.directory)), pytest.raises(BlockingIOError):
        spool.lock(bench.directory / "reader.lock", wait=False)
    os.close(spool.lock(bench.directory / "reader.lock", wait=False))


def newest(directory: Path) -> Path:
    return max(directory.glob("*.spool"), key=lambda path: int(path.stem))


def test_a_truncated_block_at_the_end(tmp_path: Path) -> None:
    """A writer is killed during a write: earlier records and later writers are read."""
    complete = Bench(tmp_path / "whole")
    complete.send(b"first")
    complete.writer.flush()
    kept_bytes = newest(complete.directory).stat().st_size
    complete.send(b"second")
    complete.writer.close()
    content = newest(complete.directory).read_bytes()
    for size in range(kept_bytes, len(content)):
        directory = tmp_path / str(size)
        directory.mkdir()
        (directory / "1.spool").write_bytes(content[:size])
        with closing(SpoolReader(directory)) as reader:
            assert summaries(drain(reader))[1:] == [(Kind.BYTES, 0, 5)]
            later = Bench(directory)
            later.send(b"third")
            later.writer.close()
            assert summaries(drain(reader)) == [(ControlRecord.RESTART, 0, 0), (Kind.BYTES, 0, 5)]


@pytest.mark.parametrize("at", [0, 5, 9, 20], ids=["magic", "length", "CRC", "record"])
def test_a_damaged_block_ends_its_segment(bench: Bench, at: int) -> None:
    """A RESTART record replaces a complete block with wrong content."""
    bench.send(b"first")
    bench.writer.flush()
    begin = newest(bench.directory).stat().st_size
    bench.send(b"second")
    bench.writer.close()
    content = bytearray(newest(bench.directory).read_bytes())
    content[begin + at] ^= 0x01
    newest(bench.directory).write_bytes(content)
    later = Bench(bench.directory)
    later.writer.close()
    records = bench.read()
    assert summaries(records)[1] == (Kind.BYTES, 0, 5)
    assert [r.note for r in records[2:]][-1] == "the forwarding process started"
    if at != 5:  # a longer block looks truncated; the later writer's restart ends it
        assert records[2].note == "the spool is damaged"


def test_a_missing_segment(tmp_path: Path) -> None:
    """Records before and after a missing segment are not joined."""
    for _ in range(3):
        Bench(tmp_path).writer.close()
    (tmp_path / "2.spool").unlink()
    with closing(SpoolReader(tmp_path)) as reader:
        notes = [record.note for record in drain(reader)]
    started = "the forwarding process started"
    assert notes == [started, "the spool is damaged", started]


def test_a_full_disk_makes_gaps_for_all_bytes(bench: Bench) -> None:
    """ENOSPC: dropped bytes become one gap per direction, in the right place."""
    bench.send(b"abc")
    bench.writer.flush()
    bench.disk.refuses = True
    for _ in range(50):
        bench.send(b"12345")
        bench.send(b"678", OTHER)
        bench.writer.flush()
    bench.timer.fire()
    bench.disk.refuses = False
    bench.send(b"more")  # still dropped: the gap must be written first
    bench.timer.fire()
    bench.send(b"after")
    bench.send(b"after", OTHER)
    bench.writer.close()
    records = bench.read()
    assert summaries(records)[1:] == [
        (Kind.BYTES, 0, 3),
        (Kind.GAP, 3, 254),
        (Kind.GAP, 0, 150),
        (Kind.BYTES, 257, 5),
        (Kind.BYTES, 150, 5),
    ]
    assert [r.note for r in records if r.kind is Kind.GAP] == ["No space left on device"] * 2
    assert records[2].time_ns == 103  # the time of its first byte


def test_connection_events_are_kept(bench: Bench) -> None:
    """Openings and endings are not lost with the bytes around them."""
    bench.disk.refuses = True
    bench.writer.append(Kind.OPENED, STREAM, 1, 0, b"a > b")
    bench.send(b"12345")
    bench.writer.append(Kind.HALF_CLOSED, STREAM, 2, 5)
    bench.send(b"678", OTHER)
    bench.writer.flush()
    bench.disk.refuses = False
    bench.writer.close()
    assert summaries(bench.read())[1:] == [
        (Kind.OPENED, 0, 0),
        (Kind.GAP, 0, 5),
        (Kind.HALF_CLOSED, 5, 0),
        (Kind.GAP, 0, 3),
    ]


def test_each_write_error_has_its_own_gaps(bench: Bench) -> None:
    """Records between two write errors are between the gaps."""
    for _ in range(3):
        bench.disk.refuses = True
        bench.send(b"678", OTHER)
        bench.send(b"12345")
        bench.timer.fire()
        bench.disk.refuses = False
        bench.timer.fire()
        bench.send(b"abc")
        bench.timer.fire()
    assert summaries([r for r in bench.read() if r.stream == STREAM]) == [
        piece
        for offset in (0, 8, 16)
        for piece in ((Kind.GAP, offset, 5), (Kind.BYTES, offset + 5, 3))
    ]


@pytest.mark.parametrize("room_bytes", [1, 11, 12, 40, 60])
def test_a_partial_write_is_a_gap(bench: Bench, room_bytes: int) -> None:
    """The disk becomes full within a block: no part of the block counts as recorded."""
    bench.send(b"abc")
    bench.writer.flush()
    bench.disk.room_bytes = room_bytes
    bench.send(b"0123456789" * 10)
    bench.writer.flush()
    bench.disk.room_bytes = None
    bench.timer.fire()
    bench.send(b"after")
    bench.writer.close()
    assert summaries(bench.read())[1:] == [
        (Kind.BYTES, 0, 3),
        (Kind.GAP, 3, 100),
        (Kind.BYTES, 103, 5),
    ]


def test_retries_create_no_further_files(bench: Bench) -> None:
    """Hours of retries leave one segment."""
    bench.disk.refuses = True
    bench.send(b"abc")
    for _ in range(1000):
        bench.timer.fire()
    assert len(list(bench.directory.glob("*.spool"))) == 1


def test_a_spool_folder_that_cannot_be_created(tmp_path: Path) -> None:
    """A file has the name of the folder: records are pending until the file is removed."""
    place = tmp_path / "spool"
    place.touch()
    bench = Bench(place)
    bench.send(b"abc")
    bench.timer.fire()
    place.unlink()
    bench.writer.close()
    assert summaries(bench.read())[1:] == [(Kind.GAP, 0, 3)]


def test_a_slow_reader_causes_gaps(tmp_path: Path) -> None:
    """The size limit holds, the gap is exact; recording continues when the reader catches up."""
    limit_bytes = 200_000
    bench = Bench(tmp_path / "spool", limit_bytes=limit_bytes)
    with closing(SpoolReader(bench.directory)) as reader:
        for _ in range(100):
            bench.send(bytes(4_000))
            bench.timer.fire()
            assert spool.backlog_bytes(bench.directory) <= limit_bytes
        records = drain(reader)
        reader.acknowledge({})
        bench.timer.fire()
        bench.send(b"after")
        bench.writer.close()
        records += drain(reader)
    pieces = summaries(records)[1:]
    for (_, begin, length), (_, following, _) in pairwise(pieces):
        assert begin + length == following
    kinds = [kind for kind, _, _ in pieces]
    assert kinds == [Kind.BYTES] * kinds.index(Kind.GAP) + [Kind.GAP, Kind.BYTES]
    assert pieces[-1] == (Kind.BYTES, 400_000, 5)
    assert records[-2].note == "the spool has reached its limit of 200000 bytes"


def test_a_gap_is_written_at_the_end(tmp_path: Path) -> None:
    """At the end of a recording pending gaps are written beyond the size limit."""
    bench = Bench(tmp_path, limit_bytes=100_000)
    for _ in range(30):
        bench.send(bytes(5_000))
        bench.timer.fire()
    bench.writer.close()
    (_, begin, length), (kind, gap_begin, gap_length) = summaries(bench.read())[-2:]
    assert (kind, gap_begin, gap_begin + gap_length) == (Kind.GAP, begin + length, 150_000)


def test_a_rest_that_cannot_be_written_is_logged(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    """The process ends after this attempt."""
    bench.disk.refuses = True
    bench.send(b"abc")
    bench.send(b"de", OTHER)
    bench.writer.close()
    assert caplog.messages == ["the last 5 bytes are not recorded: No space left on device"]


def test_pending_records_are_bounded(bench: Bench) -> None:
    """If many connections are opened while the disk is full, one RESTART record replaces their
    records."""
    bench.disk.refuses = True
    for number in range(1, 30_000):
        bench.writer.append(Kind.OPENED, stream_number(number, A2C), 1, 0)
    bench.writer.flush()
    assert len(bench.writer._deferred) <= spool._MAX_DEFERRED
    bench.disk.refuses = False
    bench.writer.close()
    records = bench.read()
    assert records[0].kind is ControlRecord.RESTART
    assert records[-1].connection == 29_999
