"""Archive of a recorder that runs for weeks: rotation and disk space together."""

import errno
import gc
import json
import os
import pickle
from collections import Counter
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from scaraspec.protocol.direction import A2C
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.recordings import recording_index as index
from scaraspec_recorder.recordings.archive import Archive, archive_sink
from scaraspec_recorder.recordings.repair import repair
from scaraspec_recorder.recordings.retention import PERIOD_NS
from scaraspec_recorder.recordings.rotation import parse_rotation
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sinks.rerun.rerun_sink import RerunSink
from scaraspec_recorder.sinks.sink import OutputFolder, Sink, SinkFailed
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.units import SECOND_NS, parse_limits

GB = 10**9


class Recorder:
    """A sink with a clock and a disk, used like by the writer process."""

    def __init__(self, folder: Path, archive: Archive, now_ns: int, free_bytes: int = GB) -> None:
        self.folder = folder
        self.now_ns = now_ns
        self.free_bytes = free_bytes
        self.out = OutputFolder(folder, [])
        self.sink: Sink = archive_sink(
            self.out,
            archive=archive,
            now_ns=lambda: self.now_ns,
            free_bytes=lambda: self.free_bytes,
        )

    def feed(self, events: Iterable[WireEvent]) -> None:
        """Write events, with a tick every quarter of a second."""
        for event in events:
            while self.now_ns + SECOND_NS // 4 <= event.time_ns:
                self.now_ns += SECOND_NS // 4
                self.sink.tick(self.now_ns)
            self.sink.write(event)

    @property
    def listed(self) -> list[dict[str, Any]]:
        lines = (self.folder / "contents.jsonl").read_text().splitlines()
        return [json.loads(line) for line in lines]


def sinks() -> list[McapSink | RerunSink]:
    """Return the sinks that exist in this process."""
    return [each for each in gc.get_objects() if type(each) in (McapSink, RerunSink)]


def payload(paths: Iterable[Path]) -> bytes:
    return b"".join(event.data for path in paths for event in read_mcap(path))


def test_all_files_are_complete(tmp_path: Path, shift: list[WireEvent]) -> None:
    """Together they contain all traffic, and each is listed."""
    archive = Archive("cell 2", draw=False, rotate=parse_rotation("1s"), triggers=("refusal",))
    recorder = Recorder(tmp_path, archive, shift[0].time_ns)
    recorder.feed(shift)
    recorder.sink.close()
    files = [line["name"] for line in recorder.listed]
    assert len(files) > 2
    assert payload(tmp_path / name for name in files) == b"".join(event.data for event in shift)


def test_a_closed_file_is_released_immediately(tmp_path: Path, shift: list[WireEvent]) -> None:
    """No garbage collection is needed, which the writer process seldom runs."""
    recorder = Recorder(tmp_path, Archive("cell 2", rotate=parse_rotation("1s")), shift[0].time_ns)
    gc.collect()
    gc.disable()
    try:
        others = sinks()
        recorder.feed(shift)
        kinds = Counter(type(sink) for sink in sinks() if sink not in others)
    finally:
        gc.enable()
    recorder.sink.close()
    assert len(list(tmp_path.glob("*.mcap"))) > 2
    assert kinds == {McapSink: 1, RerunSink: 1}


def test_redaction_applies_to_all_files(tmp_path: Path, shift: list[WireEvent]) -> None:
    """No file contains a password."""
    archive = Archive("cell 2", draw=False, redact=True)
    recorder = Recorder(tmp_path, archive, shift[0].time_ns)
    recorder.feed(shift)
    recorder.sink.close()
    (line,) = recorder.listed
    data = payload([tmp_path / line["name"]])
    assert b"***********" in data
    assert b"open sesame" not in data


def test_restart_after_a_kill(tmp_path: Path, shift: list[WireEvent]) -> None:
    """The file is repaired and listed at the next start, before new events are written."""
    archive = Archive("cell 2", draw=False)
    recorder = Recorder(tmp_path, archive, shift[0].time_ns)
    recorder.feed(shift)
    recorder.sink.close()
    (name,) = (line["name"] for line in recorder.listed)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:-9])
    (tmp_path / "contents.jsonl").unlink()
    again = Recorder(tmp_path, archive, shift[-1].time_ns)
    (line,) = again.listed
    assert line["notes"]
    assert payload([tmp_path / name]) == b"".join(event.data for event in shift)
    again.sink.close()


def test_disk_space_is_freed_before_a_repair(
    tmp_path: Path, shift: list[WireEvent], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a full disk the oldest recording is removed first; otherwise the repair would wait
    forever."""
    for _ in range(2):
        recorder = Recorder(tmp_path, Archive("cell 2", draw=False), shift[0].time_ns)
        recorder.feed(shift)
        recorder.sink.close()
    old, truncated = sorted(tmp_path.glob("*.mcap"), key=lambda path: path.stat().st_mtime_ns)
    truncated.write_bytes(truncated.read_bytes()[:-9])
    lines = (tmp_path / "contents.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "contents.jsonl").write_text(lines[0])

    def repair_where_there_is_room(path: Path) -> Any:
        if old.exists():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return repair(path)

    monkeypatch.setattr(index, "repair", repair_where_there_is_room)
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=0))
    expected = Archive("cell 2", draw=False, min_free_bytes=GB + 1)
    again = Recorder(tmp_path, expected, shift[-1].time_ns)
    assert [line.get("removed", line.get("name")) for line in again.listed] == [
        old.name,
        truncated.name,
    ]
    again.sink.close()


def test_disk_space_is_freed_during_a_recording(tmp_path: Path, talk: Any) -> None:
    """Checked every few seconds; the current file is kept."""
    keep = parse_limits("30s")
    archive = Archive("x", draw=False, rotate=parse_rotation("5s"), keep=keep)
    talk.mark(A2C, Kind.OPENED)
    for _ in range(90):
        talk.time_ns += SECOND_NS
        talk.ask("get_status", None, "00")
    recorder = Recorder(tmp_path, archive, talk.events[0].time_ns)
    recorder.feed(talk.events)
    recorder.sink.close()
    begun = sorted(line["begin_ns"] for line in recorder.listed if "removed" not in line)
    left = sorted(tmp_path.glob("*.mcap"))
    removed = {line["removed"] for line in recorder.listed if "removed" in line}
    assert len(left) + len(removed) == len(begun)
    assert not removed & {path.name for path in left}
    assert 6 <= len(left) <= 10


def test_a_full_disk_ends_the_files(tmp_path: Path, talk: Any) -> None:
    """In order, so that written events are safe; the next file starts when there is space again."""
    archive = Archive("x", draw=False, min_free_bytes=2 * GB)
    talk.mark(A2C, Kind.OPENED)
    talk.ask("get_status", None, "00")
    recorder = Recorder(tmp_path, archive, talk.time_ns, free_bytes=3 * GB)
    recorder.feed(talk.events[:2])
    recorder.free_bytes = GB
    recorder.sink.tick(talk.time_ns + PERIOD_NS)
    (line,) = recorder.listed
    sentence = "less than 2 GB of disk space is free, and no recording can be removed"
    with pytest.raises(SinkFailed, match=sentence):
        recorder.sink.write(talk.events[2])
    with pytest.raises(SinkFailed, match=sentence):
        recorder.sink.tick(talk.time_ns + 2 * PERIOD_NS)
    recorder.sink.close()
    assert line["a2c_bytes"] == len(talk.events[1].data)
    with pytest.raises(SinkFailed, match=sentence):
        Recorder(tmp_path, archive, talk.time_ns, free_bytes=GB)
    Recorder(tmp_path, archive, talk.time_ns, free_bytes=3 * GB).sink.close()


def test_the_sink_is_picklable() -> None:
    """The writer is another process."""
    archive = Archive(
        "x", rotate=parse_rotation("1h"), keep=parse_limits("30d"), triggers=("refusal",)
    )
    make = pickle.loads(pickle.dumps(partial(archive_sink, archive=archive)))
    assert make.keywords == {"archive": archive}


def test_each_recording_has_its_rrd_file(tmp_path: Path, shift: list[WireEvent]) -> None:
    """It is removed with its recording."""
    rotate, keep = parse_rotation("connection"), parse_limits("1h")
    recorder = Recorder(tmp_path, Archive("x", rotate=rotate, keep=keep), shift[0].time_ns)
    recorder.feed(shift)
    recorder.sink.close()
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".jsonl", ".mcap", ".rrd"]
    archive = Archive("x", rotate=rotate, keep=keep)
    Recorder(tmp_path, archive, shift[-1].time_ns + 3601 * SECOND_NS).sink.close()
    assert [path.name for path in tmp_path.iterdir()] == ["contents.jsonl"]
