"""Optimizing: a .rrd file made small and quick to open, once it is complete.

Law: a convenience, done by the tool that the rerun package brings. What cannot be optimized, or
not in time, stays as it is.
"""

import os
import shutil
import subprocess
from concurrent.futures import Future, ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from threading import BoundedSemaphore
from typing import Final

MOST_WAITING: Final = 8
"""How many files may wait to be optimized; beyond that, they are left as they are."""

SUFFIX: Final = ".optimized"
"""What the name of a file in the making ends with."""

_TIMEOUT_S: Final = 600
_END: Final = b"RRF2FOOT"
_END_BYTES: Final = 12

_worker = ThreadPoolExecutor(1, thread_name_prefix="optimizer")  # a process waits for it to end
_room = BoundedSemaphore(MOST_WAITING)


def optimize(path: Path) -> bool:
    """Compact a recording in place, as far as the tool for it is there and willing.

    Returns:
        Whether it was done; otherwise the file stays as it is, which is larger and slower to open.
    """
    package = find_spec("rerun_cli")  # one on the PATH may be of another version
    folder = Path(package.origin).parent if package and package.origin else None
    tool = shutil.which("rerun", path=folder) if folder else None
    if not tool:
        return False
    compact = path.with_name(f".{path.name}{SUFFIX}")
    try:
        subprocess.run(  # noqa: S603 - the tool that the rerun package brings, and two paths
            [tool, "rrd", "optimize", str(path), "-o", str(compact)],
            check=True,
            capture_output=True,
            timeout=_TIMEOUT_S,
        )
        if whole := is_whole(compact):  # of a disk that is full the tool says nothing
            compact.replace(path)
    except (OSError, subprocess.SubprocessError):
        whole = False
    if not whole:
        compact.unlink(missing_ok=True)
    return whole


def is_whole(path: Path) -> bool:
    """Whether a .rrd file has its footer, which comes last.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        file.seek(-min(_END_BYTES, path.stat().st_size), os.SEEK_END)
        return _END in file.read()


def optimize_later(path: Path) -> Future[bool]:
    """Compact a recording while the next is made: that does not wait for it."""
    if not _room.acquire(blocking=False):
        left: Future[bool] = Future()
        left.set_result(False)
        return left
    begun = _worker.submit(optimize, path)
    begun.add_done_callback(lambda _: _room.release())
    return begun
