"""Writing a report file: whole or not at all."""

import os
import tempfile
from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Write `text` as UTF-8 with LF, so that a reader sees the old file or all of the new one.

    A lone surrogate, which UTF-8 cannot hold, is written as its escape.

    Raises:
        OSError: The folder is missing, full or not writable; `path` is then as it was.
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
        part.chmod(0o644)  # mkstemp leaves it to its owner alone
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
