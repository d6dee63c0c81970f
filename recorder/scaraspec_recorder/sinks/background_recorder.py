"""Records the links of the calling program in the background.

The program writes to a spool; a writer process writes the files. The program waits only at the end.
"""

import socket
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.child_process import spawn
from scaraspec_recorder.sinks import sink_runner
from scaraspec_recorder.sinks.own_files import PRIVATE_MODE
from scaraspec_recorder.sinks.sink import SinkFactory, SinkFailed
from scaraspec_recorder.spool.locks import locked_spool, remove_spool
from scaraspec_recorder.spool.records import stream_number
from scaraspec_recorder.spool.spool import LIMIT_BYTES, SpoolWriter, read_checkpoint, stall_of

DRAIN_S: Final = 600.0
"""Time limit to write the rest at the end."""


class BackgroundRecorder:
    """Records the wire events that the program passes to `write`.

    Args:
        out_dir: Output folder of the sinks.
        sinks: Factories of the sinks, called in the writer process.

    Raises:
        OSError: The folder cannot be used, or another recorder uses it.
    """

    def __init__(self, out_dir: Path, sinks: Sequence[SinkFactory]) -> None:
        self._pending_calls: list[
            tuple[float, Callable[[], None]]
        ] = []  # time and callback, for the spool
        self._numbers: dict[str, int] = {}  # connection numbers, in the order of opening
        with ExitStack() as stack:
            self._spool = stack.enter_context(locked_spool(out_dir, LIMIT_BYTES))
            self._line, far = socket.socketpair()
            with far:
                self._writer_process = spawn(
                    "writer",
                    sink_runner.run_writer,
                    self._spool,
                    out_dir,
                    tuple(sinks),
                    PRIVATE_MODE,
                    False,  # noqa: FBT003 - the arguments of a process
                    far,
                )
            self._lock_stack = stack.pop_all()
        self._spool_writer = SpoolWriter(self._spool, self._call_later)

    def write(self, event: WireEvent) -> None:
        """Record the next event."""
        number = self._numbers.setdefault(event.connection, len(self._numbers) + 1)
        stream = stream_number(number, event.direction)
        payload = event.data if event.kind is Kind.BYTES else event.note.encode()
        self._spool_writer.append(event.kind, stream, event.time_ns, event.offset_bytes, payload)
        now_s = time.monotonic()
        due = [act for time_s, act in self._pending_calls if time_s <= now_s]
        if due:
            self._pending_calls = [entry for entry in self._pending_calls if entry[0] > now_s]
            for act in due:
                act()

    def close(self) -> None:
        """Wait until everything is written.

        Raises:
            SinkFailed: Writing failed; the text gives the reason.
        """
        with self._lock_stack:
            self._spool_writer.close()
            self._line.close()
            self._writer_process.join(DRAIN_S)
            if self._writer_process.exitcode != 0:
                stall = stall_of(read_checkpoint(self._spool))
                self._writer_process.kill()
                raise SinkFailed(stall.reason if stall else "the writer process does not end")
            remove_spool(self._spool)

    def _call_later(self, delay_s: float, act: Callable[[], None]) -> None:
        """Run a callback at the first event after the delay."""
        self._pending_calls.append((time.monotonic() + delay_s, act))
