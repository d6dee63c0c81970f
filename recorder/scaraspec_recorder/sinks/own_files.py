"""Files of this recorder: access rights, how they are recognized, removal of temporary ones.

Other programs may use the same folder, also for files with the same names. A file is the recorder's
own if its first bytes name the recorder. A symbolic link never is, and neither is an empty file.
"""

import errno
import logging
import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Final
from uuid import uuid4

from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC

PRIVATE_MODE: Final = 0o600
"""Access rights of recordings, which may contain passwords, unless the user sets others."""

RECOVERED: Final = ".recovered"
OPTIMIZED: Final = ".optimized"
REBUILT: Final = ".new"
"""Suffixes of temporary files: a repaired recording, an optimized and a rebuilt .rrd file."""

_TEMPORARY_FILES: Final = (f".*.mcap*{RECOVERED}", f".*.rrd*{OPTIMIZED}", f".*.rrd*{REBUILT}")
_MAGICS: Final = (MAGIC, b"RRF2")
_TOOL: Final = b"scaraspec"  # writing library of an .mcap file, application of an .rrd file
_TRANSIENT: Final = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
_HEAD_BYTES: Final = 256  # they are in the first hundred

_log = logging.getLogger(__name__)


def is_own(path: Path) -> bool:
    """Whether the content of an .mcap or .rrd file shows that this recorder wrote it.

    Raises:
        OSError: The file cannot be read.
    """
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    return head.startswith(_MAGICS) and _TOOL in head


def umask_of(file_mode: int) -> int:
    """Return the umask of a process whose files get these access rights.

    Its folders can be searched by all who can read its files.
    """
    return 0o777 & ~(file_mode | (file_mode & 0o444) >> 2)


def prepare_folder(path: Path, file_mode: int) -> None:
    """Create an output folder, and check that files can be created in it.

    A full or failing disk is no error: it may recover, and the spool keeps the data until then.

    Raises:
        OSError: The folder cannot be created or written.
    """
    try:
        path.mkdir(0o777 & ~umask_of(file_mode), parents=True, exist_ok=True)
        temporary_file(path / "test", REBUILT).unlink()
    except FileExistsError:
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)) from None
    except OSError as error:
        if error.errno not in _TRANSIENT:
            raise


def temporary_file(path: Path, suffix: str) -> Path:
    """Create a hidden, empty file beside `path`, with a name that no other file has.

    It has the access rights of `path`; if there is no such file, those of the umask.

    Raises:
        OSError: The file cannot be created.
    """
    temporary = path.with_name(f".{path.name}.{uuid4().hex}{suffix}")
    temporary.touch(exist_ok=False)
    with suppress(FileNotFoundError):
        shutil.copymode(path, temporary)
    return temporary


def remove_temporary_files(folder: Path) -> None:
    """Remove the temporary files of killed processes in a folder, and log each.

    Raises:
        OSError: A file cannot be read or removed.
    """
    for pattern in _TEMPORARY_FILES:
        for path in folder.glob(pattern):
            if is_own(path):
                path.unlink(missing_ok=True)
                _log.warning("removed %s: a temporary file of a killed process", path)
