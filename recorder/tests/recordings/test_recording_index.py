"""The index of a folder is correct, however the recorders ended."""

import errno
import json
import os
import shutil
from collections.abc import Iterable
from concurrent.futures import Future
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.recordings import recording_files
from scaraspec_recorder.recordings.recording_files import RecordingFolder
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.rotation import Rotation, RotationPolicy
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.file_names import INDEX_NAME, file_stem, is_recording_name, safe_name
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.sink import OutputFolder

NAME = "2026-11-20T22-58-37Z_line-3.mcap"


def new_shelf(folder: Path, *, draw: bool = False) -> RecordingFolder:
    index = RecordingIndex(folder)
    index.save()
    return RecordingFolder(OutputFolder(folder, []), index, "line 3", draw=draw)


def begin(recording_folder: RecordingFolder) -> Decoder:
    judge = Judge()
    return Decoder([Rotation(recording_folder, judge, RotationPolicy())], judge)


def record(folder: Path, events: Iterable[WireEvent], *, draw: bool = False) -> None:
    recording_folder = new_shelf(folder, draw=draw)
    sink = begin(recording_folder)
    for event in events:
        sink.write(event)
    sink.close()
    recording_folder.list_completed(wait=True)


def lines(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / INDEX_NAME).read_text().splitlines()]


def refuse(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, shift: list[WireEvent]) -> Path:
    """Return a folder with the recorded shift; tests only read it."""
    folder = tmp_path_factory.mktemp("recorded")
    record(folder, shift, draw=True)
    return folder


def test_content_of_an_entry(recorded: Path, shift: list[WireEvent]) -> None:
    """Times, counts, problems, the checksum of each stream, and the files."""
    (entry,) = lines(recorded)
    picture = NAME.replace(".mcap", ".rrd")
    assert (entry["name"], entry["files"]) == (NAME, [NAME, picture])
    sizes = [(recorded / name).stat().st_size for name in entry["files"]]
    assert entry["size_bytes"] == sum(sizes)
    assert (entry["begin_ns"], entry["end_ns"]) == (shift[0].time_ns, shift[-1].time_ns)
    assert (entry["connections"], entry["gaps"], entry["lost_bytes"]) == (1, 1, 37)
    assert entry["exchanges"] == 190
    assert entry["findings"]["fail"] == 1
    for direction in Direction:
        data = b"".join(event.data for event in shift if event.direction is direction)
        stream = entry["streams"][f"1/{direction.value}"]
        assert entry[f"{direction.value.lower()}_bytes"] == stream["recorded_bytes"] == len(data)
        assert stream["sha256_recorded"] == sha256(data).hexdigest()


@pytest.mark.parametrize("table", [b"null\n{}\n", b'{"name": "x"', b"\xff\x00\n[1]\n"])
def test_a_damaged_index_is_rebuilt(recorded: Path, tmp_path: Path, table: bytes) -> None:
    """The files are sufficient for an index with the same content."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    (tmp_path / INDEX_NAME).write_bytes(table)
    RecordingIndex(tmp_path).save()
    assert lines(tmp_path) == lines(recorded)
    assert not list(tmp_path.glob(".*"))


def test_a_deleted_index_is_rebuilt(recorded: Path, tmp_path: Path) -> None:
    """An index is also made if there never was one."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    (tmp_path / INDEX_NAME).unlink()
    RecordingIndex(tmp_path).save()
    assert lines(tmp_path) == lines(recorded)


def test_an_index_truncated_anywhere_is_rebuilt(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever the second of two entries is truncated, both exist after the next start."""
    monkeypatch.setattr("os.fsync", lambda _: None)
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    second = "2026-11-20T23-58-37Z_line-3.mcap"
    shutil.copy(tmp_path / NAME, tmp_path / second)
    RecordingIndex(tmp_path).save()
    complete = (tmp_path / INDEX_NAME).read_bytes()
    for size in (*range(complete.index(b"\n") + 1, len(complete), 97), len(complete) - 1):
        (tmp_path / INDEX_NAME).write_bytes(complete[:size])
        RecordingIndex(tmp_path).save()
        assert (tmp_path / INDEX_NAME).read_bytes() == complete


def test_a_correct_index_is_not_rewritten(recorded: Path) -> None:
    """The file is unchanged."""
    before = (recorded / INDEX_NAME).stat()
    RecordingIndex(recorded).save()
    assert (recorded / INDEX_NAME).stat() == before


def test_the_file_of_a_killed_recorder_is_repaired_and_listed(
    recorded: Path, tmp_path: Path
) -> None:
    """The entry describes the loss; the .rrd file is kept."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    capture = tmp_path / NAME
    capture.write_bytes(capture.read_bytes()[:-9])
    (tmp_path / INDEX_NAME).unlink()
    RecordingIndex(tmp_path).save()
    (entry,) = lines(tmp_path)
    (before,) = lines(recorded)
    assert entry["notes"] == [
        "the file was not closed: its end, after all data, is torn or damaged"
    ]
    assert entry["size_bytes"] == sum((tmp_path / name).stat().st_size for name in entry["files"])
    assert {**entry, "notes": [], "size_bytes": 0} == {**before, "size_bytes": 0}


def test_an_incomplete_rrd_file_is_noted(
    recorded: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """In the index and in the log."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    drawn = (tmp_path / NAME).with_suffix(".rrd")
    drawn.write_bytes(drawn.read_bytes()[:-9])
    (tmp_path / INDEX_NAME).unlink()
    RecordingIndex(tmp_path).save()
    (entry,) = lines(tmp_path)
    (note,) = entry["notes"]
    assert note.startswith(f"{drawn} is incomplete: ")
    assert caplog.messages == [f"{tmp_path / NAME}: {note}"]


@pytest.mark.parametrize("free_bytes", [0, 10**6])
def test_a_file_is_repaired_when_there_is_space(
    recorded: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    free_bytes: int,
) -> None:
    """Too little space for this file does not delay other files."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    capture = tmp_path / NAME
    truncated = capture.read_bytes()[:-9]
    capture.write_bytes(truncated)
    (tmp_path / INDEX_NAME).unlink()
    with monkeypatch.context() as full:
        full.setattr(Path, "replace", refuse)
        full.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=free_bytes))
        index = RecordingIndex(tmp_path)
        if free_bytes:
            index.repair()
            assert f"{capture} is not repaired yet: [Errno 28] No space left" in caplog.text
        else:
            with pytest.raises(OSError, match="No space left"):
                index.repair()
    assert capture.read_bytes() == truncated
    index.repair()
    notes = [f"{capture}: {note}" for note in index.entries[NAME].notes]
    assert notes
    assert caplog.messages[free_bytes > 0 :] == notes


def test_unreadable_files_are_listed(tmp_path: Path) -> None:
    """They use disk space, so retention must know them."""
    (tmp_path / NAME).write_bytes(MAGIC + b"\xff" * 9 + b"scaraspec 0.1.0")
    RecordingIndex(tmp_path).save()
    (entry,) = lines(tmp_path)
    assert entry["notes"][0].startswith(f"{tmp_path / NAME} ")
    assert entry["begin_ns"] == entry["end_ns"] == (tmp_path / NAME).stat().st_mtime_ns


@pytest.mark.parametrize("content", [b"", b"mine", MAGIC + b"\x01" + bytes(8)])
def test_a_foreign_file_with_the_name_of_a_recording(tmp_path: Path, content: bytes) -> None:
    """It is neither listed nor removed, also if it is empty or of another MCAP writer."""
    (tmp_path / NAME).write_bytes(content)
    RecordingIndex(tmp_path).save()
    assert lines(tmp_path) == []
    assert (tmp_path / NAME).read_bytes() == content


def test_a_symbolic_link_to_a_recording(recorded: Path, tmp_path: Path) -> None:
    """It is not listed, also if the index names it."""
    (tmp_path / NAME).symlink_to(recorded / NAME)
    assert RecordingIndex(tmp_path).entries == {}
    shutil.copy(recorded / INDEX_NAME, tmp_path)
    assert RecordingIndex(tmp_path).entries == {}


def test_a_file_is_listed_after_its_rrd_file_is_optimized(
    tmp_path: Path, shift: list[WireEvent], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The recorder does not wait for that; a start in between finds the file."""
    optimized = Future[bool]()
    monkeypatch.setattr(recording_files, "optimize_later", lambda _: optimized)
    recording_folder = new_shelf(tmp_path, draw=True)
    sink = begin(recording_folder)
    for event in shift:
        sink.write(event)
    sink.close()
    recording_folder.list_completed()
    assert lines(tmp_path) == []
    drawn = (tmp_path / NAME).with_suffix(".rrd")
    assert (
        recording_folder.unlisted_bytes == (tmp_path / NAME).stat().st_size + drawn.stat().st_size
    )
    drawn.write_bytes(b"small")
    optimized.set_result(True)
    recording_folder.list_completed()
    (entry,) = lines(tmp_path)
    assert entry["size_bytes"] == (tmp_path / NAME).stat().st_size + 5
    assert recording_folder.unlisted_bytes == 0


def test_foreign_files_are_not_listed(tmp_path: Path) -> None:
    """Files without the name of a recording are not counted, repaired or removed."""
    for name in ("capture.mcap", "precious.mcap", "2026-11-20_line-3.mcap"):
        (tmp_path / name).write_bytes(b"mine")
    index = RecordingIndex(tmp_path)
    index.save()
    assert index.entries == {}
    assert lines(tmp_path) == []


def test_a_missing_file_is_noted(recorded: Path, tmp_path: Path) -> None:
    """A user deleted it while no recorder was running."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    (tmp_path / NAME).unlink()
    index = RecordingIndex(tmp_path)
    index.save()
    assert index.entries == {}
    (line,) = lines(tmp_path)
    assert (line["removed"], line["reason"]) == (NAME, "it was not there any more")


def test_removals_are_kept(recorded: Path, tmp_path: Path) -> None:
    """They are appended, and kept when the index is rewritten; the entry is not."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    index = RecordingIndex(tmp_path)
    for path in tmp_path.glob("2026*"):
        path.unlink()
    index.remove(NAME, 42, "older than 30 days")
    removal = {"removed": NAME, "time_ns": 42, "reason": "older than 30 days"}
    assert lines(tmp_path) == [*lines(recorded), removal]
    with (tmp_path / INDEX_NAME).open("ab") as file:
        file.write(b"torn")
    RecordingIndex(tmp_path).save()
    assert lines(tmp_path) == [removal]


@pytest.mark.parametrize("file", ["../outside", "..", "", "precious.mcap", 7, ["x"]])
def test_an_entry_with_foreign_files_is_ignored(tmp_path: Path, file: Any) -> None:
    """Retention removes the files of entries."""
    entry = {"name": NAME, "files": [NAME], "notes": [], "begin_ns": 0, "end_ns": 0}
    for key, value in (("files", [NAME, file]), ("name", file)):
        line = {**entry, "size_bytes": 7, key: value}
        (tmp_path / INDEX_NAME).write_text(json.dumps(line) + "\n")
        index = RecordingIndex(tmp_path)
        index.save()
        assert lines(tmp_path) == []


def test_a_full_disk_keeps_the_index(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is replaced atomically."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    truncated = (tmp_path / INDEX_NAME).read_bytes() + b"torn"
    (tmp_path / INDEX_NAME).write_bytes(truncated)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    index = RecordingIndex(tmp_path)
    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        index.save()
    assert (tmp_path / INDEX_NAME).read_bytes() == truncated


def test_many_connections_are_counted_and_not_all_listed(tmp_path: Path) -> None:
    """A health check every second for weeks fills neither the index nor the memory."""
    sink = begin(new_shelf(tmp_path))
    for number in range(1500):
        for kind in (Kind.OPENED, Kind.CLOSED):
            for direction in Direction if kind is Kind.OPENED else (Direction.A2C,):
                sink.write(WireEvent(1 + number, str(number), direction, kind))
    sink.close()
    (entry,) = lines(tmp_path)
    assert entry["connections"] == 1500
    assert (len(entry["streams"]), entry["streams_left_out"]) == (2000, 1000)


def test_file_names() -> None:
    """The name has the time in UTC with seconds, and the robot."""
    time_ns = 1_795_219_199_999_999_999
    assert file_stem(time_ns, "line-3") == "2026-11-20T23-59-59Z_line-3"
    assert file_stem(time_ns, "3号线") == "2026-11-20T23-59-59Z_3号线"
    assert file_stem(0, "../..") == "1970-01-01T00-00-00Z_robot"


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("line 3 / cell #2", "line-3-cell-2"),
        ("../../etc/passwd", "etc-passwd"),
        (".hidden", "hidden"),
        ("C:\\robots\\a.b", "C-robots-a.b"),
        ("a\x00b\nc\u202ed", "a-b-c-d"),
        ("\ud800", ""),
        ("…", ""),
    ],
)
def test_hostile_names(name: str, safe: str) -> None:
    """The file name has no path and no control character, and is not hidden."""
    assert safe_name(name) == safe


@given(st.text(st.characters()))
def test_any_robot_name(tmp_path_factory: pytest.TempPathFactory, robot: str) -> None:
    """The file can be created, and its name is recognized."""
    name = f"{file_stem(1, robot)}.mcap"
    path = OutputFolder(tmp_path_factory.getbasetemp(), []).new(name)
    assert path.parent == tmp_path_factory.getbasetemp()
    assert is_recording_name(path.name)
    path.unlink()


def test_two_files_of_one_second_have_two_names(tmp_path: Path, talk: Any) -> None:
    """No file is overwritten, and both are listed."""
    talk.mark(Direction.A2C, Kind.OPENED)
    for _ in range(2):
        record(tmp_path, talk.events)
    assert list(RecordingIndex(tmp_path).entries) == [NAME, NAME.replace(".mcap", "-2.mcap")]
