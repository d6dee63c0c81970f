"""A sink for tests that start processes: it must be importable, unlike a fixture.

It writes events as JSON lines. `Trouble` is a sink whose disk can be full.
"""

import errno
import json
import os
from pathlib import Path
from typing import Any

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.sink import OutputFolder


class Journal:
    def __init__(self, folder: OutputFolder) -> None:
        self._file = folder.new("journal.jsonl").open("w")

    def write(self, event: WireEvent) -> None:
        line = [
            event.connection,
            event.direction.value,
            event.kind.value,
            event.data.hex(),
            event.offset_bytes,
            event.length_bytes,
            event.note,
        ]
        self._file.write(json.dumps(line) + "\n")

    def tick(self, now_ns: int) -> None:  # noqa: ARG002 - it flushes always
        self._file.flush()

    def close(self) -> None:
        self._file.close()


class Trouble(Journal):
    """A journal whose disk is full as long as a file named `full` exists."""

    def __init__(self, folder: OutputFolder) -> None:
        super().__init__(folder)
        self._full = folder.path / "full"

    def tick(self, now_ns: int) -> None:
        self._refuse()
        super().tick(now_ns)

    def close(self) -> None:
        self._refuse()
        super().close()

    def _refuse(self) -> None:
        if self._full.exists():
            self._full.with_name("refused").touch()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def lines(out_dir: Path) -> list[list[Any]]:
    """All complete lines of all journals, in the order of their creation."""
    journals = sorted(out_dir.glob("journal*.jsonl"), key=lambda path: (len(path.name), path.name))
    text = "".join(path.read_text() for path in journals)
    return [json.loads(line) for line in text.splitlines() if line.endswith("]")]
