"""Worker pool: runs a function in several processes and replaces them after a number of runs.

The workers end when the process that reads the results ends, even if it is killed. Their temporary
files are deleted at the same time.
"""

import os
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import Pipe, get_context, resource_tracker
from multiprocessing.connection import Connection
from tempfile import TemporaryDirectory
from typing import TypeVar

from scaraspec_recorder.child_process import safe_import_path

_processes = get_context("spawn" if sys.platform == "win32" else "forkserver")

T = TypeVar("T")
R = TypeVar("R")


def in_processes(
    work: Callable[[T], R], about: Sequence[T], *, jobs: int, runs: int
) -> Generator[R]:
    """Run `work` in several processes and yield the results in the order of the arguments.

    A caller that does not read all results must close the generator. All workers are replaced
    together: an executor that replaces them one by one can wait forever (CPython gh-115634).

    Args:
        work: A function at the top level of a module.
        about: The arguments, one per call.
        jobs: Number of processes.
        runs: Number of calls after which each process is replaced, on average.
    """
    with safe_import_path():
        if sys.platform != "win32":
            from multiprocessing import forkserver  # noqa: PLC0415 - absent on Windows

            resource_tracker.ensure_running()
            forkserver.ensure_running()
    line, far = Pipe(duplex=False)
    with line, far, TemporaryDirectory(prefix="scaraspec-") as scratch:
        for first in range(0, len(about), jobs * runs):
            here = about[first : first + jobs * runs]
            obeying = (line, scratch)
            with ProcessPoolExecutor(jobs, _processes, _obey, obeying) as pool:
                try:
                    # `pool.map` cancels its pending calls when it is closed, and fails over that.
                    for done in [pool.submit(work, each) for each in here]:
                        yield done.result()
                except BaseException:  # also GeneratorExit: the executor would wait for its workers
                    far.close()
                    raise


def _obey(line: Connection, scratch: str) -> None:
    """Initialize a worker: ignore Ctrl-C, which a terminal sends to all processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = scratch
    threading.Thread(target=_end_with, args=(line, scratch), daemon=True).start()


def _end_with(line: Connection, scratch: str) -> None:
    """End this worker when the parent process ends or closes the pipe; runs as a thread."""
    with suppress(EOFError, OSError):
        line.recv_bytes()
    shutil.rmtree(scratch, ignore_errors=True)
    os._exit(1)
