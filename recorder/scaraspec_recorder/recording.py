"""Recording: a link, recorded. Starts the tap and the scribe, keeps them alive, and ends them.

Law: the recorder's own process does none of the work. The tap forwards, the scribe writes, each in
a process of its own, and only the spool lies between them; here they are watched.
"""

import asyncio
import shutil
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Final

from scaraspec_recorder.child_process import ChildProcess
from scaraspec_recorder.fault_injection.connection import InjectedConnection
from scaraspec_recorder.fault_injection.rules import Injection
from scaraspec_recorder.sinks import sink_runner
from scaraspec_recorder.sinks.sink import SinkFactory
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.spool import mark_requests
from scaraspec_recorder.spool.locks import locked_spool
from scaraspec_recorder.spool.spool import LIMIT_BYTES, WriteStall, read_checkpoint, stall_of
from scaraspec_recorder.tap import tap
from scaraspec_recorder.tap.routes import Route

DRAIN_S: Final = 60.0
"""How long the scribe may take to write what is left when a recording ends."""

_TAP_STOP_S: Final = tap.STOP_S + 3.0


class Recording:
    """A recording under way, or ended. Made by `record`.

    Attributes:
        address: Where the tap listens: host and port.
        spool: The folder of the spool.
        tap: The process that forwards.
        writer: The process that writes.
        drain_s: How long the scribe may take to write what is left when the recording ends.
    """

    def __init__(
        self, address: tuple[str, int], spool: Path, tap: ChildProcess, writer: ChildProcess
    ) -> None:
        self.address = address
        self.spool = spool
        self.tap = tap
        self.writer = writer
        self.drain_s = DRAIN_S
        self._progress = Progress()

    @property
    def progress(self) -> Progress:
        """How far the scribe had come at its last tick; all of it once the recording has ended."""
        if state := read_checkpoint(self.spool).get("state"):
            self._progress = Progress.read(state)
        return self._progress

    def request_mark(self) -> None:
        """Ask for a mark: it is written as soon as the writing process runs.

        Raises:
            OSError: The request cannot be written.
        """
        mark_requests.request_mark(self.spool)

    @property
    def stall(self) -> WriteStall | None:
        """Why nothing is written just now; None where nothing hinders it."""
        return stall_of(read_checkpoint(self.spool))


@asynccontextmanager
async def record(  # noqa: PLR0913 - what may be chosen, each on its own
    route: Route,
    listen: tuple[str, int],
    out_dir: Path,
    sinks: Sequence[SinkFactory],
    *,
    limit_bytes: int = LIMIT_BYTES,
    injection: Injection | None = None,
    kernel_time: bool = False,
) -> AsyncIterator[Recording]:
    """Relay connections and record them, for as long as the context lasts.

    What an earlier recorder into the same folder left in its spool when it was killed is written
    first. At the end, connections that are open are closed, and the scribe writes what is left. If
    it cannot in time, `Recording.progress` is not finished, and the spool stays for the next
    recorder.

    Args:
        route: Where to; `routes.Upstream` for one controller.
        listen: Host and port to listen on; port 0 takes a free one, see `Recording.address`.
        out_dir: Where the sinks write; made where it is not there.
        sinks: Make the sinks.
        limit_bytes: How far the writing may lag before recording is dropped.
        injection: Faults on purpose, see `injection`; None to pass everything on unchanged.
        kernel_time: Whether to ask the system when bytes came in; else that is when they are read.

    Raises:
        OSError: The address or the folder cannot be used, or another recorder uses the folder.
    """
    with route.listen(*listen) as listener, locked_spool(out_dir, limit_bytes) as spool:
        writing = ChildProcess("writer", sink_runner.run_writer, spool, out_dir, tuple(sinks))
        connect = partial(InjectedConnection, injection) if injection else None
        relayed = (listener, route, spool, limit_bytes, connect, kernel_time)
        relaying = ChildProcess("tap", tap.run, *relayed, writing.control_socket)
        host, port = listener.getsockname()[:2]
        recording = Recording((host, port), spool, relaying, writing)
        try:
            writing.start()
            relaying.start()
            yield recording
        finally:
            try:
                await relaying.stop(_TAP_STOP_S)
            except asyncio.CancelledError:  # nobody waits any longer, for the scribe either
                recording.drain_s = 0.0
                raise
            finally:  # whatever comes in between, the scribe gets its order
                listener.close()
                await writing.stop(recording.drain_s)
            if recording.progress.finished:
                shutil.rmtree(spool)
