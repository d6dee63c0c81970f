"""Optimizes complete .rrd files, so that they are smaller and open faster.

Uses the tool of the rerun package. If it fails or takes too long, the file remains unchanged.
"""

import os
import shutil
import subprocess
from concurrent.futures import Future, ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from threading import BoundedSemaphore
from typing import Final

from scaraspec_recorder.sinks.own_files import OPTIMIZED, temporary_file

MOST_WAITING: Final = 8
"""Maximum number of files that wait for optimization; further files remain unchanged."""

_TIMEOUT_S: Final = 600
_END: Final = b"RRF2FOOT"
_END_BYTES: Final = 12

_worker = ThreadPoolExecutor(1, thread_name_prefix="optimizer")  # a process waits for it to end
_room = BoundedSemaphore(MOST_WAITING)


def optimize(path: Path) -> bool:
    """Optimize a .rrd file in place, if the tool is available.

    Returns:
        Whether the file was optimized; otherwise it is unchanged.
    """
    package = find_spec("rerun_cli")  # one on the PATH may be of another version
    folder = Path(package.origin).parent if package and package.origin else None
    tool = shutil.which("rerun", path=folder) if folder else None
    if not tool:
        return False
    try:
        compact = temporary_file(path, OPTIMIZED)
    except OSError:
        return False
    try:
        subprocess.run(  # noqa: S603 - the tool that the rerun package brings, and two paths
            [tool, "rrd", "optimize", str(path), "-o", str(compact)],
            check=True,
            capture_output=True,
            timeout=_TIMEOUT_S,
        )
        if whole := is_whole(compact):  # the tool does not report a full disk
            compact.replace(path)
    except (OSError, subprocess.SubprocessError):
        whole = False
    if not whole:
        compact.unlink(missing_ok=True)
    return whole


def is_whole(path: Path) -> bool:
    """Whether a .rrd file is complete: its footer is written last.

    Raises:
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        file.seek(-min(_END_BYTES, path.stat().st_size), os.SEEK_END)
        return _END in file.read()


def optimize_later(path: Path) -> Future[bool]:
    """Optimize a .rrd file in the background."""
    if not _room.acquire(blocking=False):
        left: Future[bool] = Future()
        left.set_result(False)
        return left
    begun = _worker.submit(optimize, path)
    begun.add_done_callback(lambda _: _room.release())
    return begun
