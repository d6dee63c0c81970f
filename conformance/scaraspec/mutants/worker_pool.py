"""Apart: work that is done on several processes at once, each of which is young.

Law: they work for whoever reads the results, and end with him, however he ends. What they keep in
temporary files ends with them.
"""

import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import Pipe, forkserver, get_context, resource_tracker
from multiprocessing.connection import Connection
from tempfile import TemporaryDirectory
from typing import TypeVar

from scaraspec_recorder.child_process import safe_import_path

T = TypeVar("T")
R = TypeVar("R")


def apart(work: Callable[[T], R], about: Sequence[T], *, jobs: int, runs: int) -> Generator[R]:
    """Work on several processes, and give the results in order; to be closed by who leaves early.

    All of them are replaced together: an executor that replaces each by itself may wait for ever
    for the next one (CPython gh-115634).

    Args:
        work: What is done, a function of a module.
        about: What it is done about.
        jobs: How many processes.
        runs: How often each of them may work.
    """
    with safe_import_path():
        resource_tracker.ensure_running()
        forkserver.ensure_running()
    line, far = Pipe(duplex=False)
    with line, far, TemporaryDirectory(prefix="scaraspec-") as scratch:
        for first in range(0, len(about), jobs * runs):
            here = about[first : first + jobs * runs]
            obeying = (line, scratch)
            with ProcessPoolExecutor(jobs, get_context("forkserver"), _obey, obeying) as pool:
                try:
                    # Its `map` would cancel what it has not done, and fail over that where it ends.
                    for done in [pool.submit(work, each) for each in here]:
                        yield done.result()
                except BaseException:  # also GeneratorExit: the executor would wait for its workers
                    far.close()
                    raise


def _obey(line: Connection, scratch: str) -> None:
    """Begin to work: what a terminal sends to all processes at once is not for this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = scratch
    threading.Thread(target=_end_with, args=(line, scratch), daemon=True).start()


def _end_with(line: Connection, scratch: str) -> None:
    """Be the thread that ends this process when whoever it works for has ended."""
    with suppress(EOFError, OSError):
        line.recv_bytes()
    shutil.rmtree(scratch, ignore_errors=True)
    os._exit(1)
