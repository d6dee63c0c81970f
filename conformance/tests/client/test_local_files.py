"""Local files: whole or not at all, never over another."""

import os
from pathlib import Path

import pytest

from scaraspec.client.local_files import check_new, write_new


def names_in(directory: Path) -> list[str]:
    """What is there, hidden files included."""
    return sorted(path.name for path in directory.iterdir())


def test_a_file_is_written_whole_and_alone(tmp_path: Path) -> None:
    """Nothing else stays in the directory."""
    write_new(tmp_path / "a.rob", b"content")
    assert (tmp_path / "a.rob").read_bytes() == b"content"
    assert names_in(tmp_path) == ["a.rob"]


def test_what_is_there_stays(tmp_path: Path) -> None:
    """5.3/12: a file, a directory, a link to nowhere."""
    (tmp_path / "file").write_bytes(b"old")
    (tmp_path / "directory").mkdir()
    (tmp_path / "link").symlink_to("nowhere")
    for name in ("file", "directory", "link"):
        with pytest.raises(FileExistsError, match="not overwritten"):
            check_new(tmp_path / name)
        with pytest.raises(FileExistsError, match="not overwritten"):
            write_new(tmp_path / name, b"new")
    assert (tmp_path / "file").read_bytes() == b"old"
    assert names_in(tmp_path) == ["directory", "file", "link"]


def test_a_directory_is_needed(tmp_path: Path) -> None:
    """It is told before anything is asked of a controller."""
    with pytest.raises(NotADirectoryError, match="no directory"):
        check_new(tmp_path / "nowhere" / "a.rob")


def test_nothing_is_left_after_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk shows when the bytes are to be made durable."""

    def fail(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space left"):
        write_new(tmp_path / "a.rob", b"content")
    assert names_in(tmp_path) == []


def test_a_file_system_without_hard_links_will_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """FAT has none; a file that appears meanwhile stays even there."""

    def refuse(_source: str, _target: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    write_new(tmp_path / "a.rob", b"content")
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "a.rob", b"other")
    assert (tmp_path / "a.rob").read_bytes() == b"content"
    assert names_in(tmp_path) == ["a.rob"]
