"""Writes a spool on disk through to the device, so that a power failure costs a second at most.

A process other than the tap process does this: the tap process never waits for a disk.
"""

import logging
import os
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

SYNC_S: Final = 0.25
"""Interval at which a spool is written through."""

BOUND_S: Final = 1.0
"""Age of the oldest data that a power failure costs, if the disk is fast enough."""

_REPORT_S: Final = 60.0

_log = logging.getLogger(__name__)


def sync(paths: Iterable[Path]) -> None:
    """Write files or folders through to the device; those that were removed are skipped.

    Raises:
        OSError: The device failed.
    """
    for path in paths:
        with suppress(FileNotFoundError):
            descriptor = os.open(path, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)


class SpoolSync:
    """Writes the segments of a spool through that have grown since the last call.

    Args:
        spool: The spool folder.
        now_s: A clock that is not set.
    """

    def __init__(self, spool: Path, now_s: Callable[[], float] = time.monotonic) -> None:
        self._spool = spool
        self._now_s = now_s
        self._sizes: dict[Path, int] = {}
        self._done_s = now_s()
        self._reported_s = self._done_s - _REPORT_S

    def sync(self) -> None:
        """Write the spool through. A failure, or data older than `BOUND_S`, is logged."""
        began_s = self._now_s()
        try:
            sizes = self._read_sizes()
            sync(path for path, size in sizes.items() if size != self._sizes.get(path))
            if sizes.keys() - self._sizes.keys():
                sync((self._spool, self._spool.parent))
        except OSError as error:
            self._report(began_s, str(error))
            return
        if began_s - self._done_s > BOUND_S:
            self._report(began_s, f"the disk needed {began_s - self._done_s:.1f} s")
        self._sizes, self._done_s = sizes, began_s

    def _read_sizes(self) -> dict[Path, int]:
        sizes = {}
        for path in self._spool.glob("*.spool"):
            with suppress(FileNotFoundError):  # the writer process has removed it
                sizes[path] = path.stat().st_size
        return sizes

    def _report(self, now_s: float, reason: str) -> None:
        if now_s - self._reported_s >= _REPORT_S:
            self._reported_s = now_s
            _log.warning("a power failure would cost more than %g s: %s", BOUND_S, reason)
