"""Files of this recorder: how they are recognized, and the removal of temporary ones.

Other programs may use the same folder, also for files with the same names. A file is the recorder's
own if its first bytes name the recorder. A symbolic link never is, and neither is an empty file.
"""

import logging
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final

from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC

RECOVERED: Final = ".recovered"
OPTIMIZED: Final = ".optimized"
REBUILT: Final = ".new"
"""Suffixes of temporary files: a repaired recording, an optimized and a rebuilt .rrd file."""

_TEMPORARY_FILES: Final = (f".*.mcap*{RECOVERED}", f".*.rrd*{OPTIMIZED}", f".*.rrd*{REBUILT}")
_MAGICS: Final = (MAGIC, b"RRF2")
_TOOL: Final = b"scaraspec"  # writing library of an .mcap file, application of an .rrd file
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


def temporary_file(path: Path, suffix: str) -> Path:
    """Create a hidden, empty file beside `path`, with a name that no other file has.

    It has the permissions of `path`; if there is no such file, only this user has access.

    Raises:
        OSError: The file cannot be created.
    """
    descriptor, name = tempfile.mkstemp(suffix, f".{path.name}.", path.parent)
    os.close(descriptor)
    with suppress(FileNotFoundError):
        shutil.copymode(path, name)
    return Path(name)


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
