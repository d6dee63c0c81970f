"""Children: the processes of a recorder, and how they are kept alive and ended.

Law: a child obeys its line and nothing else. The line is a socket pair; its near end closes when
the recorder closes it or dies, and that is the order to finish. Signals that a terminal or a
service manager sends to all processes at once are for the recorder alone.
"""

import asyncio
import logging
import multiprocessing
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

MIN_RESTART_DELAY_S: Final = 0.1
MAX_RESTART_DELAY_S: Final = 5.0
"""How long a child that dies again and again stays dead."""

REPORTED_EXIT_STATUS: Final = 75
"""Exit status of a child that has said itself why it must be started again."""

_SAFE_PATH: Final = "PYTHONSAFEPATH"
_SHOWN: Final = Path("/proc/self/comm")  # what ps and top call a process

_log = logging.getLogger(__name__)
_processes = multiprocessing.get_context("spawn")


_TO_ALL: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1")


def ignore_signals() -> None:
    """To be called first in a child: leave it to the recorder when to end."""
    for number in _numbers(_TO_ALL):
        signal.signal(number, signal.SIG_IGN)


def spawn(name: str, run: Callable[..., None], *arguments: Any) -> "BaseProcess":
    """Start a process that is called so where the system lists processes.

    Raises:
        Exception: An argument cannot be pickled; whatever pickle says of it.
        OSError: The system has no room for another process.
    """
    process = _processes.Process(target=_be, args=(name, run, *arguments))
    with safe_import_path(), _blocked_signals():
        process.start()
    return process


@contextmanager
def safe_import_path() -> Iterator[None]:
    """What Python is started herein imports nothing that lies in the folder where somebody works.

    Else a file there that is called like a module of Python would be run in its place.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        del os.environ[_SAFE_PATH]
        if before is not None:
            os.environ[_SAFE_PATH] = before


class ChildProcess:
    """A process that is started again whenever it fails, until it is stopped.

    Args:
        name: What it is, for the log.
        run: The process's function; its last argument is the far end of its line. It returns when
            the near end is closed and its work is done.
        arguments: Its other arguments.

    Attributes:
        control_socket: The parent's end of the line. Other children may hold it, too: this child
            stops when all of them have closed it.
    """

    def __init__(self, name: str, run: Callable[..., None], *arguments: Any) -> None:
        self.control_socket, self._child_socket = socket.socketpair()
        self.pid: int | None = None
        self._name = name
        self._run = run
        self._arguments = arguments
        self._supervisor: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start the process, from within a running event loop.

        Raises:
            Exception: An argument cannot be pickled; whatever pickle says of it.
            OSError: The system has no room for another process.
        """
        self._supervisor = asyncio.get_running_loop().create_task(self._supervise(self._spawn()))

    async def stop(self, timeout_s: float) -> bool:
        """Order it to finish; kill it where it has not after so long. Return whether it has."""
        self.control_socket.close()
        try:
            if self._supervisor:
                await asyncio.wait_for(self._supervisor, timeout_s)
        except TimeoutError:
            return False
        finally:
            self._child_socket.close()
        return True

    def _spawn(self) -> "BaseProcess":
        process = spawn(self._name, self._run, *self._arguments, self._child_socket)
        self.pid = process.pid
        return process

    async def _supervise(self, process: "BaseProcess") -> None:
        """Wait for the process's end; where that is a failure, start it again, and so on."""
        loop = asyncio.get_running_loop()
        delay_s = MIN_RESTART_DELAY_S
        while True:
            started_s = loop.time()
            status = await _end_of(process)
            if status == 0:
                return
            if loop.time() - started_s > MAX_RESTART_DELAY_S:
                delay_s = MIN_RESTART_DELAY_S
            if status != REPORTED_EXIT_STATUS:
                _log.warning("the %s ended with status %s and is started again", self._name, status)
            while True:
                await asyncio.sleep(delay_s)
                delay_s = min(2 * delay_s, MAX_RESTART_DELAY_S)
                try:
                    process = self._spawn()
                except OSError as error:  # too many processes or files, for now
                    _log.warning("the %s cannot be started: %s", self._name, error)
                else:
                    break


def _numbers(names: Iterable[str]) -> set[signal.Signals]:
    return {getattr(signal, name) for name in names if hasattr(signal, name)}  # Windows knows fewer


@contextmanager
def _blocked_signals() -> Iterator[None]:
    """Whoever is started herein is not ended by a signal before it knows what to do with it."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # which lets signals through again, when it is first started
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _numbers(_TO_ALL))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _be(name: str, run: Callable[..., None], *arguments: Any) -> None:
    """Be a child, and be called so where the system lists processes."""
    with suppress(OSError):  # only Linux has such a file
        _SHOWN.write_text(f"scara-{name}")
    try:
        run(*arguments)
    except SystemExit as ended:
        if ended.code == REPORTED_EXIT_STATUS:  # at once: a library's thread may wait for ever
            os._exit(REPORTED_EXIT_STATUS)
        raise


async def _end_of(process: "BaseProcess") -> int | None:
    """Wait for a process's end, or kill it where nobody wants to wait any longer."""
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[list[Any]] = loop.run_in_executor(None, wait, [process.sentinel])
    try:
        await asyncio.shield(ended)
    finally:
        process.kill()
        await ended
        process.join()
        status = process.exitcode
        process.close()
    return status
