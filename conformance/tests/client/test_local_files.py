"""Local files: written completely or not at all, never over a file."""

import os
from pathlib import Path

import pytest

from scaraspec.client.local_files import check_new, check_regular, write_new


def names_in(directory: Path) -> list[str]:
    """Return the names in the directory, including hidden files."""
    return sorted(path.name for path in directory.iterdir())


def test_a_file_is_written_completely(tmp_path: Path) -> None:
    """No other file remains in the directory."""
    write_new(tmp_path / "a.rob", b"content")
    assert (tmp_path / "a.rob").read_bytes() == b"content"
    assert names_in(tmp_path) == ["a.rob"]


def test_existing_paths_are_not_overwritten(tmp_path: Path) -> None:
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
    """The error is raised before the transfer."""
    with pytest.raises(NotADirectoryError, match="not a directory"):
        check_new(tmp_path / "nowhere" / "a.rob")


def test_a_failure_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk is detected by fsync."""

    def fail(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space left") as raised:
        write_new(tmp_path / "a.rob", b"content")
    assert raised.value.filename == str(tmp_path / "a.rob")
    assert names_in(tmp_path) == []


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    """A FIFO may never end."""
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(OSError, match="no regular file"):
        check_regular(tmp_path / "fifo")
    (tmp_path / "file").touch()
    check_regular(tmp_path / "file")


def test_a_file_system_without_hard_links_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """FAT has none; a file that appears during the write is not overwritten there either."""

    def refuse(_source: str, _target: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    write_new(tmp_path / "a.rob", b"content")
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "a.rob", b"other")
    assert (tmp_path / "a.rob").read_bytes() == b"content"
    assert names_in(tmp_path) == ["a.rob"]
