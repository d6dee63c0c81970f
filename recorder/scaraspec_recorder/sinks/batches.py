"""An output that passes events and items to another output in batches.

The judge and the outputs take turns less often. Each then runs longer in the caches of the
processor, which makes the same work faster.
"""

import logging
from collections.abc import Mapping
from typing import Final

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.decoder import Item, Output, defect_text
from scaraspec_recorder.sinks.sink import ENVIRONMENT_FAILURES
from scaraspec_recorder.sinks.text import LogLine

_MOST_WAITING: Final = 512  # an event has 64 KiB at most

_log = logging.getLogger(__name__)


class BatchedOutput:
    """Passes everything on in its order, at the next tick at the latest.

    After a defect of the other output, only raw events are passed on.

    Args:
        output: The other output.
    """

    def __init__(self, output: Output) -> None:
        self._output = output
        self._waiting: list[WireEvent | tuple[Item, int, LogLine | None]] = []
        self._defect: Exception | None = None

    def write(self, event: WireEvent) -> None:
        """Write a raw event."""
        self._waiting.append(event)
        if len(self._waiting) >= _MOST_WAITING:
            self._flush()

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Write an item derived from the last raw event.

        Raises:
            Exception: The other output has a defect.
        """
        if self._defect:
            raise self._defect
        self._waiting.append((item, number, line))

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Write a line of the log that does not come from a raw event."""
        self._flush()
        self._output.mark(time_ns, line)

    def tick(self, now_ns: int) -> None:
        """Write pending data."""
        self._flush()
        self._output.tick(now_ns)

    def close(self, summary: Mapping[str, str]) -> None:
        """Write the end of the output."""
        self._flush()
        defect = {"defect": defect_text(self._defect)} if self._defect else {}
        self._output.close({**defect, **summary})

    def _flush(self) -> None:
        waiting, self._waiting = self._waiting, []
        write, take = self._output.write, self._output.take
        for each in waiting:
            if isinstance(each, WireEvent):
                write(each)
            elif not self._defect:
                try:
                    take(*each)
                except ENVIRONMENT_FAILURES:
                    raise
                except Exception as error:  # noqa: BLE001 - the raw layer must continue
                    self._defect = error
                    _log.exception("decoding stopped; recording continues")
