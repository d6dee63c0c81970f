"""Local files of downloads: written completely or not at all, never over a file (5.3/12).

Errors are `OSError` with the file name and a reason for the user.
"""

import contextlib
import errno
import os
import tempfile
from pathlib import Path


def check_regular(path: Path) -> None:
    """Check that a path is no FIFO or device, which may have no end.

    Raises:
        OSError: It is one.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "this is no regular file", str(path))


def check_new(path: Path) -> None:
    """Check, before a download starts, that the file can be created.

    Raises:
        OSError: The path exists, or its directory does not exist.
    """
    if os.path.lexists(path):
        raise _exists(path)
    if not path.parent.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "not a directory", str(path.parent))


def write_new(path: Path, content: bytes) -> None:
    """Create the file with its complete content. A failure leaves no file.

    Raises:
        OSError: The path exists, or the file cannot be written.
    """
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(handle)
        except OSError as error:  # a full disk; the error names no file
            raise OSError(error.errno, error.strerror, str(path)) from None
        try:
            os.link(temporary, path)  # unlike a rename, it never replaces a file
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
        errno.EEXIST, "the file exists and is not overwritten: use another name (L739)", str(path)
    )
