"""Uploads by a process of their own: faults, restarts, and what is reported."""

import asyncio
import json
import os
import signal
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.monitoring.health import health_problems
from scaraspec_recorder.recordings import uploader
from scaraspec_recorder.recordings.archive import Archive, archive_sink
from scaraspec_recorder.recordings.upload_log import UploadLog, UploadState
from scaraspec_recorder.recordings.uploader import Upload, Uploader
from scaraspec_recorder.sinks.sink import OutputFolder
from scaraspec_recorder.spool.locks import spool_folder
from scaraspec_recorder.spool.spool import SpoolReader

pytest.importorskip("fsspec")
TIMEOUT_S = 120
VERY_SLOW = 1  # byte a second: such an upload goes on until its process is killed


class Folders:
    """A store, and a folder with a spool and recordings."""

    def __init__(self, path: Path) -> None:
        self.store, self.out = path / "store", path / "out"
        self.store.mkdir()
        self.out.mkdir()
        self.spool = spool_folder(self.out, durable=True)

    def record(self, events: list[WireEvent]) -> Path:
        """Write a recording."""
        before = {*self.out.glob("*.mcap")}
        sink = archive_sink(OutputFolder(self.out, []), archive=Archive("line-3", draw=False))
        for event in events:
            sink.write(event)
        sink.close()
        (new,) = {*self.out.glob("*.mcap")} - before
        return new

    def upload(self, rate_bytes: int = 10**9) -> Uploader:
        url = f"file://{self.store}"
        return Uploader(Upload(url, "line-3", rate_bytes), self.out, self.spool)

    @property
    def stored(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in self.store.rglob("*.mcap")}

    @property
    def archived(self) -> set[str]:
        return {*UploadLog(self.out, f"file://{self.store}").names()}


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    return Folders(tmp_path)


def run(test: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(test(), TIMEOUT_S))


async def until(condition: Callable[[], object]) -> None:
    while not condition():  # noqa: ASYNC110 - files of other processes change
        await asyncio.sleep(0.01)


def test_finished_recordings_are_uploaded(folders: Folders, shift: list[WireEvent]) -> None:
    """Those of earlier recorders, and those that are finished while the recorder runs."""

    async def test() -> None:
        paths = [folders.record(shift)]
        uploads = folders.upload()
        await until(lambda: uploads.state.archived == 1)
        paths.append(folders.record(shift))
        await uploads.finish(TIMEOUT_S)
        assert folders.stored == {path.name: path.read_bytes() for path in paths}
        assert folders.archived == {*folders.stored}
        state = uploads.state
        assert (state.archived, state.waiting, state.failure) == (2, 0, "")
        assert {path.parent.parent.name for path in folders.store.rglob("*.mcap")} == {"line-3"}

    run(test)


def test_a_store_that_cannot_be_reached(
    folders: Folders, shift: list[WireEvent], caplog: pytest.LogCaptureFixture
) -> None:
    """It is in the log and in the health check until the store can be reached again."""

    async def test() -> None:
        folders.record(shift)
        folders.store.rmdir()
        SpoolReader(folders.spool).acknowledge({"progress": {"a2c": {}, "c2a": {}}})
        now_s = (folders.spool / "checkpoint.json").stat().st_mtime
        uploads = folders.upload()
        await until(lambda: uploads.state.failure)
        (problem,) = health_problems(folders.out, lambda: now_s)
        assert problem.startswith("archiving fails, 1 file (")
        assert problem.endswith(f"waiting: {folders.store} is not a folder: create it")
        await until(lambda: f"line-3: {problem}" in caplog.text)
        folders.store.mkdir()
        await uploads.finish(TIMEOUT_S)
        assert health_problems(folders.out, lambda: now_s) == []
        assert "line-3: archiving continues" in caplog.text
        assert len(folders.stored) == 1

    run(test)


def test_a_killed_upload(folders: Folders, shift: list[WireEvent]) -> None:
    """The store has no part of the file. The next recorder uploads it."""

    async def test() -> None:
        path = folders.record(shift)
        uploads = folders.upload(VERY_SLOW)
        await until(lambda: list(folders.store.rglob("*.part")))
        os.kill(archiver(), signal.SIGKILL)
        await until(lambda: uploads.state.failure)
        assert uploads.state.failure == "the archiving process ended with status -9"
        await uploads.finish(0)
        assert not folders.stored
        assert not folders.archived
        again = folders.upload()
        await again.finish(TIMEOUT_S)
        assert folders.stored == {path.name: path.read_bytes()}
        assert not list(folders.store.rglob("*.part"))

    run(test)


def test_an_upload_without_progress(
    folders: Folders, shift: list[WireEvent], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is given up, and counts as a failure."""
    monkeypatch.setattr(uploader, "HUNG_NS", 0)

    async def test() -> None:
        folders.record(shift)
        uploads = folders.upload(VERY_SLOW)
        await until(lambda: uploads.state.failure)
        assert uploads.state.failure == "the archiving process ended with status -9"
        await uploads.finish(0)

    run(test)


def test_pauses_grow(
    folders: Folders, shift: list[WireEvent], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They double with each failure up to a limit, and are short again after a success."""
    pauses_s: list[float] = []
    timeout = asyncio.timeout

    def pause(time_s: float) -> asyncio.Timeout:
        pauses_s.append(time_s)
        if len(pauses_s) == 4:
            folders.store.mkdir()
        return timeout(0 if len(pauses_s) < 5 else TIMEOUT_S)

    async def test() -> None:
        folders.record(shift)
        folders.store.rmdir()
        monkeypatch.setattr(uploader, "MAX_PAUSE_S", 60)
        monkeypatch.setattr(asyncio, "timeout", pause)
        uploads = folders.upload()
        await until(lambda: len(pauses_s) == 5)
        assert pauses_s == [20, 40, 60, 60, 10]
        await uploads.finish(TIMEOUT_S)

    asyncio.run(test())


def test_a_removed_recording(
    folders: Folders, shift: list[WireEvent], capfd: pytest.CaptureFixture[str]
) -> None:
    """It is reported once, and the others are uploaded."""

    async def test() -> None:
        removed, other = folders.record(shift), folders.record(shift)
        removed.unlink()
        for _ in range(2):
            await folders.upload().finish(TIMEOUT_S)
        assert [*folders.stored] == [other.name]
        assert capfd.readouterr().err.count(f"{removed} was removed before it was archived") == 1

    run(test)


def test_one_recording_that_cannot_be_read(folders: Folders, shift: list[WireEvent]) -> None:
    """The others are uploaded."""

    async def test() -> None:
        bad, good = folders.record(shift), folders.record(shift)
        bad.unlink()
        bad.mkdir()
        uploads = folders.upload()
        await until(lambda: uploads.state.failure)
        await uploads.finish(TIMEOUT_S)
        assert [*folders.stored] == [good.name]
        assert (uploads.state.waiting, uploads.state.failure) == (1, "Is a directory")

    run(test)


def archiver() -> int:
    """The process of an upload that this process has started."""
    names = {
        int(path.parent.name): path.read_text().strip()
        for path in Path("/proc").glob("[0-9]*/comm")
    }
    stats = {
        pid: Path(f"/proc/{pid}/stat").read_text()
        for pid, name in names.items()
        if name == "scara-archiver"
    }
    (pid,) = (
        pid for pid, stat in stats.items() if int(stat.rpartition(")")[2].split()[1]) == os.getpid()
    )
    return pid


def test_the_log_of_a_store(tmp_path: Path) -> None:
    """It names the recordings of one store, also after the end of a line is lost."""
    log = UploadLog(tmp_path, "s3://user@robots")
    assert not log.names()
    log.add("a.mcap", stored="s3://robots/a.mcap")
    UploadLog(tmp_path, "file:///store").add("b.mcap")
    assert {*log.names()} == {"a.mcap"}
    with (tmp_path / "archived.jsonl").open("ab") as file:
        file.write(b'{"name": "c.mcap", "url": "s3')
    assert {*log.names()} == {"a.mcap"}


def test_the_log_is_bounded(tmp_path: Path) -> None:
    """Lines of removed recordings are removed when there are many."""
    log = UploadLog(tmp_path, "s3://robots")
    lines = [{"name": f"{number}.mcap", "url": "s3://robots"} for number in range(1001)]
    (tmp_path / "archived.jsonl").write_text("\n".join(map(json.dumps, lines)))
    log.forget({"7.mcap", "8.mcap"})
    assert len(log.names()) == 1001
    log.forget({"7.mcap"})
    assert {*log.names()} == {"7.mcap"}
    assert [path.name for path in tmp_path.iterdir()] == ["archived.jsonl"]


def test_a_stalled_upload() -> None:
    """It is reported after two minutes without progress."""
    state = UploadState(waiting=2, waiting_bytes=5000, time_ns=10**9)
    assert state.problem(121 * 10**9) == ""
    assert state.problem(130 * 10**9) == "archiving is stalled for 129 s, 2 files (5 kB) waiting"
