"""Atomic writing of report files."""

import os
import tempfile
from pathlib import Path


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


def _write(path: Path, text: str) -> None:
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(text.encode("utf-8", "backslashreplace"))
            file.flush()
            os.fsync(file.fileno())
        part.chmod(0o644)  # mkstemp allows access only to the owner
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
