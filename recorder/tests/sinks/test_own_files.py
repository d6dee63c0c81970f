"""Only files that this recorder wrote are recognized as its own, and removed."""

import os
from pathlib import Path

import pytest

from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.own_files import (
    OPTIMIZED,
    REBUILT,
    RECOVERED,
    is_own,
    remove_temporary_files,
    temporary_file,
    umask_of,
)
from scaraspec_recorder.sinks.rerun.optimizer import optimize
from scaraspec_recorder.sinks.sink import OutputFolder


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record nothing; return the folder."""
    folder = tmp_path_factory.mktemp("capture")
    capture_sink(OutputFolder(folder, [])).close()
    return folder


def test_recordings_are_own_files(capture: Path, tmp_path: Path) -> None:
    """Also a file whose end is missing, and an optimized one."""
    for name in ("capture.mcap", "capture.rrd"):
        assert is_own(capture / name)
        truncated = tmp_path / name
        truncated.write_bytes((capture / name).read_bytes()[:256])
        assert is_own(truncated)
    drawn = tmp_path / "capture.rrd"
    drawn.write_bytes((capture / "capture.rrd").read_bytes())
    assert optimize(drawn)
    assert is_own(drawn)


@pytest.mark.parametrize("content", [b"", b"scaraspec", MAGIC, b"RRF2" + bytes(300)])
def test_foreign_content(tmp_path: Path, content: bytes) -> None:
    """Empty files and files of other programs."""
    path = tmp_path / "capture.mcap"
    path.write_bytes(content)
    assert not is_own(path)


def test_links_and_pipes_are_foreign(capture: Path, tmp_path: Path) -> None:
    """A pipe is not opened: that would block."""
    link, pipe = tmp_path / "link.mcap", tmp_path / "pipe.mcap"
    link.symlink_to(capture / "capture.mcap")
    os.mkfifo(pipe)
    assert not is_own(link)
    assert not is_own(pipe)
    assert not is_own(tmp_path)
    assert not is_own(tmp_path / "missing.mcap")


def test_temporary_files_are_removed(
    capture: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Only those of this recorder; each removal is in the log."""
    removed = []
    for name, suffix in (("mcap", RECOVERED), ("rrd", OPTIMIZED), ("rrd", REBUILT)):
        content = (capture / f"capture.{name}").read_bytes()
        own = temporary_file(tmp_path / f"a.{name}", suffix)
        own.write_bytes(content)
        removed.append(own)
        (tmp_path / f".b.{name}{suffix}").touch()
        (tmp_path / f".c.{name}{suffix}").symlink_to(capture / f"capture.{name}")
        (tmp_path / f"d.{name}{suffix}").write_bytes(content)
    before = set(tmp_path.iterdir())
    remove_temporary_files(tmp_path)
    assert set(tmp_path.iterdir()) == before - set(removed)
    assert caplog.messages == [
        f"removed {path}: a temporary file of a killed process" for path in removed
    ]


def test_a_temporary_file_replaces_none(tmp_path: Path) -> None:
    """It has the access rights of the file that it will replace."""
    path = tmp_path / "capture.mcap"
    path.touch()
    path.chmod(0o640)
    first, second = (temporary_file(path, RECOVERED) for _ in range(2))
    assert first != second
    assert first.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("file_mode", "folder_mode"), [(0o600, 0o700), (0o640, 0o750), (0o664, 0o775), (0o622, 0o722)]
)
def test_the_access_rights_of_files(file_mode: int, folder_mode: int) -> None:
    """A folder can be searched by all who can read its files."""
    umask = umask_of(file_mode)
    assert (0o666 & ~umask, 0o777 & ~umask) == (file_mode, folder_mode)
