"""Child processes of a recorder: start, restart after a failure, and stop.

The parent stops a child through a socket pair, the *line*. The parent's end closes when the
recorder closes it or dies; the child then finishes its work and exits. Children ignore the signals
that a terminal or a service manager sends to all processes; only the recorder handles them.
"""

import asyncio
import errno
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
"""Limits of the delay before a child is restarted; it doubles with each failure."""

REPORTED_EXIT_STATUS: Final = 75
"""Exit status of a child that has already reported why it must be restarted."""

_LACKS: Final = (errno.EMFILE, errno.ENFILE, errno.ENOMEM)
_SAFE_PATH: Final = "PYTHONSAFEPATH"
_PROCESS_NAME: Final = Path("/proc/self/comm")  # the name that ps and top show

_log = logging.getLogger(__name__)
_processes = multiprocessing.get_context("spawn")


_GROUP_SIGNALS: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1")


def ignore_signals() -> None:
    """Ignore signals to the process group. A child must call this first."""
    for number in _numbers(_GROUP_SIGNALS):
        signal.signal(number, signal.SIG_IGN)


def spawn(name: str, run: Callable[..., None], *arguments: Any) -> "BaseProcess":
    """Start a process that the system's process list shows under `name`.

    Raises:
        Exception: An argument cannot be pickled; the exception is that of pickle.
        OSError: The system cannot start another process.
    """
    process = _processes.Process(target=_child_main, args=(name, run, *arguments))
    with safe_import_path(), _blocked_signals():
        process.start()
    return process


@contextmanager
def safe_import_path() -> Iterator[None]:
    """Prevent Python processes started in this context from importing from the working directory.

    Otherwise a file there with the name of a standard module would be imported instead of it.
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
    """A process that is restarted after each failure until it is stopped.

    Args:
        name: Name of the process, used in the log.
        run: Main function of the process; its last argument is the child's end of the line. It
            returns when the parent's end is closed and its work is done.
        arguments: The other arguments.

    Attributes:
        control_socket: The parent's end of the line. Other children may hold it, too: this child
            stops when all of them have closed it.
        failures: How often the process has failed.
    """

    def __init__(self, name: str, run: Callable[..., None], *arguments: Any) -> None:
        self.control_socket, self._child_socket = socket.socketpair()
        self.pid: int | None = None
        self.failures = 0
        self._stopping = asyncio.Event()
        self._name = name
        self._run = run
        self._arguments = arguments
        self._supervisor: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start the process. An event loop must be running.

        Raises:
            Exception: An argument cannot be pickled; the exception is that of pickle.
            OSError: The system cannot start another process.
        """
        self._supervisor = asyncio.get_running_loop().create_task(self._supervise(self._spawn()))

    async def stop(self, timeout_s: float) -> bool:
        """Stop the process, and kill it after `timeout_s`. Return whether it stopped in time.

        A suspended process (SIGSTOP) is continued first.
        """
        self._stopping.set()
        self.control_socket.close()
        if self.pid and self._supervisor and not self._supervisor.done():
            with suppress(ProcessLookupError, AttributeError):  # it has just ended; Windows
                os.kill(self.pid, signal.SIGCONT)
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
        """Restart the process each time it fails, until it ends with status 0."""
        loop = asyncio.get_running_loop()
        delay_s = MIN_RESTART_DELAY_S
        while True:
            started_s = loop.time()
            status = await end_of(process)
            if status == 0:
                return
            self.failures += 1
            if loop.time() - started_s > MAX_RESTART_DELAY_S:
                delay_s = MIN_RESTART_DELAY_S
            if status != REPORTED_EXIT_STATUS:
                _log.warning(
                    "the %s process ended with status %s and is restarted", self._name, status
                )
            while True:
                with suppress(TimeoutError):  # do not wait for long at the end
                    await asyncio.wait_for(self._stopping.wait(), delay_s)
                    await asyncio.sleep(MIN_RESTART_DELAY_S)
                delay_s = min(2 * delay_s, MAX_RESTART_DELAY_S)
                try:
                    process = self._spawn()
                except (OSError, MemoryError) as error:  # too many processes or files at the moment
                    _log.warning("the %s process cannot be started: %s", self._name, error)
                else:
                    break


def _numbers(names: Iterable[str]) -> set[signal.Signals]:
    return {
        getattr(signal, name) for name in names if hasattr(signal, name)
    }  # Windows has fewer signals


@contextmanager
def _blocked_signals() -> Iterator[None]:
    """Block group signals, so that a new process is not killed before it ignores them."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # its first start would unblock the signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _numbers(_GROUP_SIGNALS))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _child_main(name: str, run: Callable[..., None], *arguments: Any) -> None:
    """Main function of a child: set its name in the process list, then run it.

    A lack of files or memory is one sentence: the process is started again.
    """
    with suppress(OSError):  # only Linux has such a file
        _PROCESS_NAME.write_text(f"scara-{name}")
    try:
        run(*arguments)
    except SystemExit as ended:
        if ended.code == REPORTED_EXIT_STATUS:  # immediately: a library's thread may never end
            os._exit(REPORTED_EXIT_STATUS)
        raise
    except (OSError, MemoryError) as error:
        if isinstance(error, OSError) and error.errno not in _LACKS:
            raise
        raise SystemExit(f"the {name} process cannot continue: {error or 'no memory'}") from None


def _watch(process: "BaseProcess") -> asyncio.Future[Any]:
    """Return a future that is done when a process has ended.

    No thread is needed where the event loop can watch the process: without memory, none starts.
    """
    loop = asyncio.get_running_loop()
    if sys.platform == "win32":
        return loop.run_in_executor(None, wait, [process.sentinel])
    ended: asyncio.Future[Any] = loop.create_future()
    sentinel = process.sentinel

    def end() -> None:
        loop.remove_reader(sentinel)
        ended.set_result(None)

    loop.add_reader(sentinel, end)
    return ended


async def end_of(process: "BaseProcess") -> int | None:
    """Wait for the end of a process; kill it if the wait is cancelled."""
    ended = _watch(process)
    try:
        await asyncio.shield(ended)
    finally:
        if process.is_alive():  # to kill a process that has ended can change its exit status
            process.kill()
        await ended
        process.join()
        status = process.exitcode
        process.close()
    return status
