"""A report file is there whole, or as it was."""

import os
from pathlib import Path

import pytest

from scaraspec.report.files import write_whole


def test_a_file_is_written_as_it_is_told(tmp_path: Path) -> None:
    """UTF-8, LF, and nothing left beside it."""
    path = tmp_path / "results.json"
    write_whole(path, "符合\n\ud800\n")
    assert path.read_bytes() == "符合\n\\ud800\n".encode()
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o644


def test_a_failure_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk costs the new text and not the old one."""
    path = tmp_path / "results.json"
    write_whole(path, "old")

    def full_disk(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
