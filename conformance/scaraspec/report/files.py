"""Writing of report files: atomically, or never over another file."""

import os
from pathlib import Path
from uuid import uuid4

from scaraspec.operating_system import replace_file


def write_whole(path: Path, text: str) -> None:
    """Write `text` atomically as UTF-8 with LF: readers see the old or the complete new file.

    A lone surrogate, which UTF-8 cannot encode, is written as an escape sequence.

    Raises:
        OSError: The folder is missing, full or not writable; `path` is unchanged.
    """
    try:
        _write(path, text)
    except OSError as error:
        raise OSError(error.errno, error.strerror, f"{path}") from None


def write_new(path: Path, text: str) -> None:
    """Write `text` as UTF-8 with LF into a new file, which is removed if that fails.

    Raises:
        OSError: The file exists or cannot be written.
    """
    file = path.open("xb")
    try:
        with file:
            file.write(text.encode("utf-8", "backslashreplace"))
    except BaseException:
        path.unlink()  # after it is closed: Windows removes no open file
        raise


def _write(path: Path, text: str) -> None:
    part = path.with_name(f".{path.name}.{uuid4().hex}.part")
    try:
        with part.open("xb") as file:  # the umask decides on the access of others
            file.write(text.encode("utf-8", "backslashreplace"))
            file.flush()
            os.fsync(file.fileno())
        replace_file(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
