"""Records a link: starts, supervises and stops the tap process and the writer process.

The recorder's own process does not handle traffic. The tap process forwards, the writer process
writes, and the spool is the only connection between them.
"""

import asyncio
import errno
import socket
from collections.abc import AsyncIterator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, asynccontextmanager, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Final

from scaraspec.user_message import UserMessage
from scaraspec_recorder.child_process import ChildProcess
from scaraspec_recorder.fault_injection.connection import InjectedConnection
from scaraspec_recorder.fault_injection.rules import Injection
from scaraspec_recorder.recordings.upload_log import UploadState
from scaraspec_recorder.recordings.uploader import Upload, Uploader
from scaraspec_recorder.sinks import sink_runner
from scaraspec_recorder.sinks.own_files import PRIVATE_MODE, prepare_folder
from scaraspec_recorder.sinks.sink import SinkFactory
from scaraspec_recorder.sinks.sink_runner import Progress, count_unwritten
from scaraspec_recorder.spool import mark_requests
from scaraspec_recorder.spool.durability import SYNC_S, SpoolSync
from scaraspec_recorder.spool.locks import locked_spool, remove_spool, was_removed
from scaraspec_recorder.spool.spool import LIMIT_BYTES, WriteStall, read_checkpoint, stall_of
from scaraspec_recorder.tap import tap, tcp
from scaraspec_recorder.tap.routes import Route

DRAIN_S: Final = 60.0
"""Time limit for the writer process to write the rest when a recording ends."""

UPLOAD_S: Final = 60.0
"""Time limit for uploading finished files when a recording ends."""

_END_FAILURES: Final = 2
"""Failures of the writer process after which a recording that ends leaves the rest in the spool."""

_NO_SUCH_ADDRESS: Final = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
_POLL_S: Final = 0.25
_TAP_STOP_S: Final = tap.STOP_S + 3.0


class Recording:
    """A running or finished recording, created by `record`.

    Attributes:
        addresses: Hosts and ports that the tap listens on.
        spool: Folder of the spool.
        tap: The process that forwards.
        writer: The process that writes.
        drain_s: Time limit for writing the rest of the spool when the recording ends.
        uploader: Uploads finished files; None if they are not uploaded.
    """

    def __init__(
        self,
        addresses: Sequence[tuple[str, int]],
        spool: Path,
        tap: ChildProcess,
        writer: ChildProcess,
        uploader: Uploader | None = None,
    ) -> None:
        self.addresses = tuple(addresses)
        self.spool = spool
        self.tap = tap
        self.writer = writer
        self.drain_s = DRAIN_S
        self.uploader = uploader
        self._progress = Progress()
        self._ended = False
        self._spool_removed = False

    @property
    def address(self) -> tuple[str, int]:
        """The first of the addresses."""
        return self.addresses[0]

    @property
    def progress(self) -> Progress:
        """Progress of the writer process at its last tick."""
        if not self._ended:
            state = read_checkpoint(self.spool).get("state", {})
            progress = Progress.read(state)
            # An earlier recording may have finished after its recorder was killed.
            if state and not progress.finished:
                self._progress = progress
            self._note_removal()
        return self._progress

    @property
    def upload_state(self) -> UploadState | None:
        """State of the uploads; None if files are not uploaded."""
        return self.uploader.state if self.uploader else None

    async def stop_writer(self) -> None:
        """Let the writer process write the rest, for `drain_s`, or until it fails repeatedly."""
        stopping = asyncio.ensure_future(self.writer.stop(self.drain_s))
        failures, finished = self.writer.failures + _END_FAILURES, False
        try:
            while not stopping.done() and self.writer.failures < failures:
                await asyncio.wait((stopping,), timeout=_POLL_S)
            finished = stopping.done() and await stopping
        finally:
            stopping.cancel()
            await asyncio.gather(stopping, return_exceptions=True)
            self._end(finished=finished)

    def _end(self, *, finished: bool) -> None:
        """Read the final progress. The writer process has ended.

        Args:
            finished: Whether it has written everything.
        """
        try:
            self._progress = (
                Progress.read(read_checkpoint(self.spool).get("state", {}))
                if finished
                else count_unwritten(self.spool)
            )
        except (OSError, MemoryError) as error:  # the last progress remains
            problem = UserMessage(
                "the bytes that are not written yet cannot be counted: {reason}",
                reason=f"{error}" or UserMessage("there is not enough memory"),
            )
            self._progress.problems.append(problem)
        self._note_removal()
        self._ended = True

    def _note_removal(self) -> None:
        self._spool_removed = self._spool_removed or was_removed(self.spool)
        problem = (
            f"{self.spool} was removed during the recording: bytes may be lost and not counted"
        )
        if self._spool_removed and problem not in self._progress.problems:
            self._progress.problems.append(problem)

    def request_mark(self) -> None:
        """Request a mark in the recording. The writer process writes it as soon as it runs.

        Raises:
            OSError: The request cannot be written.
        """
        mark_requests.request_mark(self.spool)

    @property
    def stall(self) -> WriteStall | None:
        """Why the writer process is stalled; None if it is not stalled."""
        return stall_of(read_checkpoint(self.spool))


@contextmanager
def _listening(route: Route, listen: Sequence[tuple[str, int]]) -> Iterator[list[socket.socket]]:
    """Open the listening sockets. A host such as localhost has several addresses.

    Raises:
        OSError: An address cannot be used. An address of a host is skipped if the system does not
            have its kind and the host has another one.
    """
    with ExitStack() as stack:
        listeners: list[socket.socket] = []
        for host, port in listen:
            first = len(listeners)
            missing: OSError | None = None
            for each in tcp.listening_hosts(host):
                try:
                    sock = stack.enter_context(route.listen(each, port))
                except OSError as error:
                    if error.errno not in _NO_SUCH_ADDRESS:
                        raise
                    missing = error
                else:
                    listeners.append(sock)
                    port = sock.getsockname()[1]  # noqa: PLW2901 - the same for all addresses
            if missing and first == len(listeners):
                raise missing
        yield listeners


async def _sync(spool: Path) -> None:
    """Write the spool through to the device until cancelled, in one thread."""
    spool_sync, loop = SpoolSync(spool), asyncio.get_running_loop()
    thread = ThreadPoolExecutor(1)
    try:
        while True:
            with suppress(RuntimeError):  # no memory for a thread: the next turn reports the delay
                await loop.run_in_executor(thread, spool_sync.sync)
            await asyncio.sleep(SYNC_S)
    finally:
        thread.shutdown(wait=False)


@asynccontextmanager
async def record(  # noqa: PLR0913 - independent options
    route: Route,
    listen: Sequence[tuple[str, int]],
    out_dir: Path,
    sinks: Sequence[SinkFactory],
    *,
    limit_bytes: int = LIMIT_BYTES,
    injection: Injection | None = None,
    kernel_time: bool = False,
    file_mode: int = PRIVATE_MODE,
    durable: bool = False,
    upload: Upload | None = None,
) -> AsyncIterator[Recording]:
    """Relay and record connections while the context is active.

    If an earlier recorder of the same folder was killed, the rest of its spool is written first. At
    the end, open connections are closed and the writer process writes the rest. If this takes too
    long, `Recording.progress` is not finished and the spool remains for the next recorder. Then
    finished files are uploaded, for `UPLOAD_S` at most.

    Args:
        route: Target of the connections; `routes.Upstream` for one controller.
        listen: Hosts and ports to listen on; for port 0, the system chooses one.
        out_dir: Output folder of the sinks; created if missing.
        sinks: Factories of the sinks.
        limit_bytes: Maximum size of the spool. Beyond it, traffic is forwarded but not recorded.
        injection: Faults to inject; None to forward everything unchanged.
        kernel_time: Whether to use kernel timestamps; otherwise the time of the read call.
        file_mode: Access rights of the files; the folder can be searched by all who can read them.
        durable: Whether a power failure costs a second at most. The spool is then on the disk.
        upload: Where finished files are uploaded to; None for nowhere.

    Raises:
        OSError: The address or the folder cannot be used, or another recorder uses the folder.
    """
    prepare_folder(out_dir, file_mode)
    with (
        _listening(route, listen) as listeners,
        locked_spool(out_dir, limit_bytes, durable=durable) as spool,
    ):
        writer_arguments = (spool, out_dir, tuple(sinks), file_mode, durable)
        writer = ChildProcess("writer", sink_runner.run_writer, *writer_arguments)
        connect = partial(InjectedConnection, injection) if injection else None
        tap_arguments = (listeners, route, spool, limit_bytes, connect, kernel_time)
        tap_child = ChildProcess("tap", tap.run, *tap_arguments, writer.control_socket)
        addresses = [listener.getsockname()[:2] for listener in listeners]
        uploader = Uploader(upload, out_dir, spool) if upload else None
        recording = Recording(addresses, spool, tap_child, writer, uploader)
        syncing = asyncio.create_task(_sync(spool)) if durable else None
        try:
            writer.start()
            tap_child.start()
            yield recording
        finally:
            try:
                await tap_child.stop(_TAP_STOP_S)
            except asyncio.CancelledError:  # do not wait for the writer process, either
                recording.drain_s = 0.0
                raise
            finally:  # always stop the writer process
                for listener in listeners:
                    listener.close()
                try:
                    await recording.stop_writer()
                except asyncio.CancelledError:
                    recording.drain_s = 0.0
                    raise
                finally:
                    if uploader:
                        await uploader.finish(min(recording.drain_s, UPLOAD_S))
                if syncing:
                    syncing.cancel()
            if recording.progress.finished:
                with suppress(FileNotFoundError):  # another process has removed it
                    remove_spool(spool)
