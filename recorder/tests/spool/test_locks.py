"""Where spools lie, who holds them, and that the dead hold none for ever."""

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
    """Where the system has files in memory."""
    path = tmp_path / "memory"
    path.mkdir()
    monkeypatch.setattr(locks, "_MEMORY", path)
    monkeypatch.setattr(locks, "_has_room", lambda size_bytes: size_bytes <= LIMIT_BYTES)
    return path


def killed(out_dir: Path, *, read: bool) -> Path:
    """The spool of a recorder that was killed."""
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
    """A recorder starts."""
    with locked_spool(out_dir, LIMIT_BYTES):
        pass


def test_the_spool_lies_in_memory_and_is_private(tmp_path: Path, memory: Path) -> None:
    """Where the system has files in memory with room enough; one folder for one output folder."""
    one, other = spool_folder(tmp_path / "a", 1), spool_folder(tmp_path / "b", 1)
    assert one.parent == other.parent == memory
    assert one != other
    assert one == spool_folder(tmp_path / "a", 1 << 60), "what was left there is found again"
    assert one.stat().st_mode & 0o777 == 0o700
    assert spool_folder(tmp_path / "c", 1 << 60) == tmp_path / "c" / ".spool"
    one.chmod(0o755)
    with pytest.raises(PermissionError, match="not a private folder of this user"):
        spool_folder(tmp_path / "a", 1)


def test_memory_that_cannot_be_written_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a container whose files are read-only: the spool lies beside the recordings."""
    monkeypatch.setattr(locks, "_MEMORY", tmp_path)
    assert spool_folder(tmp_path / "a", 1).parent == tmp_path
    monkeypatch.setattr(os, "access", lambda path, _mode: path != tmp_path)
    assert spool_folder(tmp_path / "b", 1) == tmp_path / "b" / ".spool"


def test_the_spool_of_the_dead_is_cleared_away_at_a_start(tmp_path: Path, memory: Path) -> None:
    """It lies in memory, and its folder may never see a recorder again."""
    spool = killed(tmp_path / "a", read=True)
    start(tmp_path / "b")
    assert list(memory.iterdir()) == [spool_folder(tmp_path / "b")] != [spool]


def test_what_is_unwritten_stays(tmp_path: Path, memory: Path) -> None:
    """The next recorder into that folder writes it."""
    spool = killed(tmp_path / "a", read=False)
    start(tmp_path / "b")
    assert spool in memory.iterdir()


@pytest.mark.parametrize("holder", [lock_spool, SpoolReader])
@pytest.mark.usefixtures("memory")
def test_what_somebody_holds_stays(tmp_path: Path, holder: Callable[[Path], object]) -> None:
    """A recorder, or a writer that ends what its killed recorder left."""
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
def test_a_spool_that_is_cleared_away_while_it_is_claimed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Is claimed anew: two recorders that start at once do not cost one its lock."""
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
