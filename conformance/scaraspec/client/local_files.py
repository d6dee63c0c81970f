"""Local files: read whole, and written whole or not at all, never over another (5.3/12).

Errors are `OSError` with a file name and a reason that a user understands.
"""

import contextlib
import errno
import os
import tempfile
from pathlib import Path


def check_new(path: Path) -> None:
    """Make sure that a file can be made there, before anything is asked for.

    Raises:
        OSError: Something is there already, or there is no such directory.
    """
    if os.path.lexists(path):
        raise _exists(path)
    if not path.parent.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "this is no directory", str(path.parent))


def write_new(path: Path, content: bytes) -> None:
    """Make the file, whole; after a failure nothing is left of it.

    Raises:
        OSError: Something is there already, or it cannot be written.
    """
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(handle)
        try:
            os.link(temporary, path)  # unlike a rename it never replaces a file
        except FileExistsError:
            raise _exists(path) from None
        except OSError:  # a file system without hard links
            check_new(path)
            Path(temporary).rename(path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            Path(temporary).unlink()


def _exists(path: Path) -> FileExistsError:
    return FileExistsError(
        errno.EEXIST, "it exists and is not overwritten, name another file (L739)", str(path)
    )
