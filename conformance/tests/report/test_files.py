"""Atomic writing of report files."""

import os
from pathlib import Path

import pytest

from scaraspec.report.files import write_whole


def test_content(tmp_path: Path) -> None:
    """The file is UTF-8 with LF; no temporary file remains."""
    path = tmp_path / "results.json"
    write_whole(path, "符合\n\ud800\n")
    assert path.read_bytes() == "符合\n\\ud800\n".encode()
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_mode_respects_the_umask(tmp_path: Path, umask: int, mode: int) -> None:
    """Other users have the access that the umask permits."""
    path = tmp_path / "results.json"
    earlier_umask = os.umask(umask)
    try:
        write_whole(path, "{}")
    finally:
        os.umask(earlier_umask)
    assert path.stat().st_mode & 0o777 == mode


def test_failure_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If the disk is full, the old content remains."""
    path = tmp_path / "results.json"
    write_whole(path, "old")

    def full_disk(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
