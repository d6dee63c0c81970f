"""Shows a recording in a Rerun viewer while it is made.

The recording never waits for the viewer: drawing runs in a separate process with a bounded queue.
Events that do not fit are dropped, and the drawing then contains a gap.
"""

import logging
import multiprocessing
import os
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, Final

from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.child_process import ignore_signals
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.sink import OutputFolder

VIEWER_TIMEOUT_S: Final = 30.0
"""Timeout of a viewer that accepts no data; it then gets no more."""

CLOSE_TIMEOUT_S: Final = 5.0
"""Time limit for drawing the rest when the recording ends."""

_BATCH_BYTES: Final = 64 << 10
_EVENT_BYTES: Final = 200  # size that an event without bytes counts
_MOST_BATCHES: Final = 128

_log = logging.getLogger(__name__)
_processes = multiprocessing.get_context("spawn")

_Batch = tuple[int, list[WireEvent]]


def live_sink(folder: OutputFolder, *, url: str, needs_login: bool = True) -> "LiveSink":  # noqa: ARG001 - a `SinkFactory`
    """Create the sink that draws in a viewer (a `SinkFactory`); it writes no file.

    Args:
        folder: Not used.
        url: The viewer, for example ``rerun+http://127.0.0.1:9876/proxy``.
        needs_login: False for a serial link (L83).
    """
    return LiveSink(draw, url, needs_login)


class LiveSink:
    """A sink that passes events to another process and drops them if that is too slow.

    Args:
        run: Main function of the process: receives the connection for batches, like `draw`, and
            `arguments`.
        arguments: Further arguments.
        most_batches: Maximum number of queued batches, each at most 64 KiB plus one event.

    Attributes:
        lost_events: Number of dropped events.
    """

    def __init__(
        self, run: Callable[..., None], *arguments: Any, most_batches: int = _MOST_BATCHES
    ) -> None:
        self.lost_events = 0
        self._events: list[WireEvent] = []
        self._size_bytes = 0
        self._now_ns = 0
        self._queue: queue.Queue[_Batch | None] = queue.Queue(most_batches)
        far, self._near = _processes.Pipe(duplex=False)
        self._process = _processes.Process(target=run, args=(far, *arguments), daemon=True)
        self._pump = threading.Thread(target=self._send, daemon=True)
        try:
            self._process.start()
            self._pump.start()
        except OSError as error:  # no more processes, for now
            _log.warning("live drawing is not available: %s", error)
        far.close()

    def write(self, event: WireEvent) -> None:
        """Queue the next event."""
        self._events.append(event)
        self._size_bytes += _EVENT_BYTES + len(event.data)
        if self._size_bytes >= _BATCH_BYTES:
            self._hand_over()

    def tick(self, now_ns: int) -> None:
        """Pass queued events to the process."""
        self._now_ns = now_ns
        self._hand_over()

    def close(self) -> None:
        """Wait until the rest is drawn, with a timeout."""
        self._hand_over()
        if not self._pump.ident:
            return
        try:
            self._queue.put(None, timeout=CLOSE_TIMEOUT_S)
        except queue.Full:
            pass  # the process does not respond
        else:
            self._process.join(CLOSE_TIMEOUT_S)
        if self._process.is_alive():
            _log.warning("the viewer does not show the end of the recording: it took too long")
        if self.lost_events:
            _log.warning(
                "the viewer was too slow for %d events; all are recorded", self.lost_events
            )
        self._process.kill()
        self._process.join()

    def _hand_over(self) -> None:
        batch = self._now_ns, self._events
        try:
            if self._pump.is_alive():
                self._queue.put_nowait(batch)
        except queue.Full:
            self.lost_events += len(self._events)
        self._events, self._size_bytes = [], 0

    def _send(self) -> None:
        """Thread that sends batches to the process."""
        try:
            while batch := self._queue.get():
                self._near.send(batch)
        except OSError:
            _log.warning("the viewer is closed: recording continues without drawing")
        self._near.close()


def draw(line: Connection, url: str, needs_login: bool) -> None:  # noqa: FBT001 - passed on to a process
    """Main function of the drawing process: draw until the line or the viewer is closed."""
    ignore_signals()
    from scaraspec_recorder.sinks.rerun.rerun_sink import RerunSink  # noqa: PLC0415 - an optional extra

    drawing = RerunSink.to_viewer(url)
    decoder = Decoder([drawing], Judge(needs_login=needs_login))
    try:
        with suppress(EOFError):
            while True:
                now_ns, events = line.recv()
                for event in events:
                    decoder.write(event)
                decoder.tick(now_ns)
                drawing.wait(VIEWER_TIMEOUT_S)
        _exit_after(VIEWER_TIMEOUT_S)
        decoder.close()
    except RuntimeError:  # a flush failed: the viewer was closed, or hangs
        _exit_after(0)


def _exit_after(delay_s: float) -> None:
    """Exit this process after a delay, even if the viewer's library blocks."""
    timer = threading.Timer(delay_s, os._exit, (0,))
    timer.daemon = True
    timer.start()
