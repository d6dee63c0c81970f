"""Location and locks of spools; a dead process holds no lock."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool import locks
from scaraspec_recorder.spool.locks import lock_spool, locked_spool, spool_folder
from scaraspec_recorder.spool.spool import LIMIT_BYTES, SpoolReader, SpoolWriter, lock


@pytest.fixture
def memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set the folder for files in memory."""
    path = tmp_path / "memory"
    path.mkdir()
    monkeypatch.setattr(locks, "_MEMORY", path)
    monkeypatch.setattr(locks, "_has_room", lambda size_bytes: size_bytes <= LIMIT_BYTES)
    return path


def killed(out_dir: Path, *, read: bool) -> Path:
    """Return the spool of a killed recorder."""
    with locked_spool(out_dir, LIMIT_BYTES) as spool:
        writer = SpoolWriter(spool, lambda _delay, _callback: None)
        writer.append(Kind.OPENED, 2, 1, 0, b"a > b")
        writer.close()
        if read:
            reader = SpoolReader(spool)
            assert reader.read()
            reader.acknowledge({})
            reader.close()
    return spool


def start(out_dir: Path) -> None:
    """Start a recorder."""
    with locked_spool(out_dir, LIMIT_BYTES):
        pass


def test_the_spool_is_in_memory_and_private(tmp_path: Path, memory: Path) -> None:
    """If files in memory have enough space; each output folder has its own spool."""
    one, other = spool_folder(tmp_path / "a", 1), spool_folder(tmp_path / "b", 1)
    assert one.parent == other.parent == memory
    assert one != other
    assert one == spool_folder(tmp_path / "a", 1 << 60), "what was left there is found again"
    assert one.stat().st_mode & 0o777 == 0o700
    assert spool_folder(tmp_path / "c", 1 << 60) == tmp_path / "c" / ".spool"
    one.chmod(0o755)
    with pytest.raises(PermissionError, match="not a private folder of this user"):
        spool_folder(tmp_path / "a", 1)


def test_read_only_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a container with read-only files the spool is next to the recordings."""
    monkeypatch.setattr(locks, "_MEMORY", tmp_path)
    assert spool_folder(tmp_path / "a", 1).parent == tmp_path
    monkeypatch.setattr(os, "access", lambda path, _mode: path != tmp_path)
    assert spool_folder(tmp_path / "b", 1) == tmp_path / "b" / ".spool"


def test_the_spool_of_a_dead_recorder_is_removed(tmp_path: Path, memory: Path) -> None:
    """It uses memory, and its output folder may never have a recorder again."""
    spool = killed(tmp_path / "a", read=True)
    start(tmp_path / "b")
    assert list(memory.iterdir()) == [spool_folder(tmp_path / "b")] != [spool]


def test_an_unwritten_spool_is_kept(tmp_path: Path, memory: Path) -> None:
    """The next recorder with that folder writes it."""
    spool = killed(tmp_path / "a", read=False)
    start(tmp_path / "b")
    assert spool in memory.iterdir()


@pytest.mark.parametrize("holder", [lock_spool, SpoolReader])
@pytest.mark.usefixtures("memory")
def test_a_locked_spool_is_kept(tmp_path: Path, holder: Callable[[Path], object]) -> None:
    """A recorder, or the writer of a killed recorder, holds the lock."""
    spool = killed(tmp_path / "a", read=True)
    held = holder(spool)
    start(tmp_path / "b")
    assert spool.exists()
    if isinstance(held, SpoolReader):
        held.close()
    else:
        assert isinstance(held, int)
        os.close(held)
    start(tmp_path / "b")
    assert not spool.exists()


@pytest.mark.usefixtures("memory")
def test_a_spool_that_is_removed_while_it_is_locked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is locked again: two recorders that start at once do not lose their locks."""
    clears = iter([True])

    def lock_then_lose(path: Path, *, wait: bool) -> int:
        held = lock(path, wait=wait)
        if next(clears, False):
            shutil.rmtree(path.parent)
        return held

    monkeypatch.setattr(locks, "lock", lock_then_lose)
    spool = spool_folder(tmp_path / "a")
    held = lock_spool(spool)
    with pytest.raises(BlockingIOError):
        lock_spool(spool)
    os.close(held)
