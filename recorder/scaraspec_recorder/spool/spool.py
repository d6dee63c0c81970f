"""The spool: bounded hand-over from the tap process to the writer process.

Belongs here: the folder of segment files, its writer and its reader. Does not belong here: sockets,
event loops, capture formats. The spool writer never raises and never waits: it defers records that
it cannot write, with bytes replaced by gaps, and writes them as soon as possible.

A segment is a sequence of blocks (see `records`). Each writer starts new segments, and another one
after each failed write: only the end of a segment can be incomplete.
"""

import errno
import json
import logging
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

from scaraspec.operating_system import replace_file
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool import mark_requests
from scaraspec_recorder.spool.durability import sync
from scaraspec_recorder.spool.records import (
    CODES,
    HEAD_BYTES,
    MAX_BLOCK_BYTES,
    Block,
    ControlRecord,
    Record,
    gap_record,
    is_truncated,
    pack_head,
    read_blocks,
)

LIMIT_BYTES: Final = 256 << 20
"""Maximum size of the spool. Beyond it, traffic is not recorded."""

FLUSH_S: Final = 0.02
"""Maximum time that a record stays in memory, and can be lost if the tap is killed."""

RETRY_S: Final = 0.1
"""Interval at which a failed write is retried."""

READER_LOCK: Final = "reader.lock"
"""Name of the lock file of the spool's reader."""

_FLUSH_BYTES: Final = 64 << 10  # plus the largest read of an event loop fits in a block
_MAX_SEGMENT_BYTES: Final = 8 << 20
_MAX_DEFERRED: Final = 10_000
_SUFFIX: Final = ".spool"
_CHECKPOINT: Final = "checkpoint.json"
_BINARY: Final = getattr(os, "O_BINARY", 0)  # Windows would write CR LF for LF

_log = logging.getLogger(__name__)


def lock(path: Path, *, wait: bool) -> int:
    """Lock the file `path` until the returned descriptor is closed or the process ends.

    Raises:
        BlockingIOError: Another process has the lock, and `wait` is false.
    """
    descriptor = os.open(path, os.O_CREAT | os.O_RDWR, 0o600)
    try:
        _lock(descriptor, wait=wait)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _lock(descriptor: int, *, wait: bool) -> None:
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415 - exists only on Windows

        while True:
            try:
                msvcrt.locking(descriptor, msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
            except OSError:
                if not wait:
                    raise BlockingIOError from None
            else:  # LK_LOCK gives up after ten seconds
                return
    import fcntl  # noqa: PLC0415 - absent on Windows

    fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


class WriteStall(NamedTuple):
    """The writer process acknowledges nothing.

    Attributes:
        since_ns: Start, in nanoseconds since the Unix epoch.
        reason: The error text.
    """

    since_ns: int
    reason: str


class SpoolWriter:
    """Writing end of the spool, used by the tap process. It never raises.

    Args:
        directory: The spool folder; created with the first block.
        call_later: Runs a callback after a delay in seconds, like the method of an event loop.
        limit_bytes: Maximum size of the spool.
        write: Writes to a descriptor and returns the number of bytes, like `os.write`.
        now_ns: The clock.
    """

    def __init__(
        self,
        directory: Path,
        call_later: Callable[[float, Callable[[], None]], object],
        *,
        limit_bytes: int = LIMIT_BYTES,
        write: Callable[[int, bytearray], int] = os.write,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._directory = directory
        self._call_later = call_later
        self._limit_bytes = limit_bytes
        self._segment_limit_bytes = min(limit_bytes // 16, _MAX_SEGMENT_BYTES)
        self._write = write
        self._segment: int | None = None  # its descriptor
        self._number = 0
        self._segment_bytes = 0
        self._spooled_bytes = 0  # upper bound: deletions are noticed later
        self._block = Block()
        self._add = self._block.parts.append
        self._flush_scheduled = False
        self._write_error = ""
        self._deferred: list[Record] = []
        self._deferred_gaps: dict[int, int] = {}  # by stream: index of its last gap in `_owed`
        self.append(ControlRecord.RESTART, 0, now_ns(), 0, b"the forwarding process started")

    def append(  # noqa: PLR0913, PLR0917 - a record's fields, for the fewest calls
        self,
        kind: Kind | ControlRecord,
        stream: int,
        time_ns: int,
        offset_bytes: int,
        payload: bytes = b"",
        forwarded_ns: int = 0,
        kernel_time: bool = False,  # noqa: FBT001, FBT002 - as above
    ) -> None:
        """Append one record (fields as in `Record`); it is written within `FLUSH_S`."""
        block, add, size_bytes = self._block, self._add, len(payload)
        # `Block.add` inlined: all traffic passes here.
        add(
            pack_head(
                size_bytes, CODES[kind], stream, time_ns, offset_bytes, forwarded_ns, kernel_time
            )
        )
        add(payload)
        block.size_bytes += HEAD_BYTES + size_bytes
        if not self._flush_scheduled:
            self._flush_scheduled = True
            self._call_later(FLUSH_S, self._on_flush_timer)
        if block.size_bytes > _FLUSH_BYTES:
            self.flush()

    def flush(self) -> None:
        """Write the appended records, or defer them."""
        if self._block.empty:
            return
        if not self._deferred:
            try:
                self._append_block(self._block)
            except OSError as error:
                self._write_error = error.strerror or str(error)
                self._call_later(RETRY_S, self._retry_deferred)
                self._defer(self._block)
        else:
            self._defer(self._block)
        self._block.clear()

    def close(self) -> None:
        """Write the remaining records; log those that cannot be written."""
        self._limit_bytes = (
            sys.maxsize
        )  # the deferred records are small, and this is the last attempt
        self.flush()
        self._write_deferred()
        if self._deferred:
            lost_bytes = sum(record.length_bytes for record in self._deferred)
            _log.error("the last %d bytes are not recorded: %s", lost_bytes, self._write_error)
        self._end_segment()

    def _on_flush_timer(self) -> None:
        self._flush_scheduled = False
        self.flush()

    def _defer(self, block: Block) -> None:
        """Defer the records of a block; bytes extend the gap of their stream."""
        for record in block.records():
            kind, stream, time_ns, offset_bytes, payload, *_ = record
            if kind is not Kind.BYTES:
                self._deferred.append(record)
            elif (index := self._deferred_gaps.get(stream)) is not None:
                _, _, time_ns, begin_bytes, *_ = self._deferred[index]
                length_bytes = offset_bytes + len(payload) - begin_bytes
                self._deferred[index] = gap_record(
                    stream, time_ns, begin_bytes, length_bytes, self._write_error
                )
            else:
                self._deferred_gaps[stream] = len(self._deferred)
                self._deferred.append(
                    gap_record(stream, time_ns, offset_bytes, len(payload), self._write_error)
                )
            if len(self._deferred) > _MAX_DEFERRED:
                self._deferred_gaps.clear()
                self._deferred = [
                    Record(ControlRecord.RESTART, 0, time_ns, 0, self._write_error.encode())
                ]

    def _retry_deferred(self) -> None:
        self.flush()
        self._write_deferred()
        if self._deferred:
            self._call_later(RETRY_S, self._retry_deferred)

    def _write_deferred(self) -> None:
        """Write deferred records, as far as possible."""
        while self._deferred:
            written, block = 0, Block()
            while written < len(self._deferred) and block.size_bytes < _FLUSH_BYTES:
                block.add(self._deferred[written])
                written += 1
            try:
                self._append_block(block)
            except OSError:
                return  # still deferred
            del self._deferred[:written]
            self._deferred_gaps.clear()  # indices changed; a written gap cannot be extended

    def _append_block(self, block: Block) -> None:
        """Append one block with one write call.

        Raises:
            OSError: The write failed. The segment is closed, because its end may be incomplete. An
                empty one is kept, so that a full disk does not fill with empty files.
        """
        data = block.seal()
        size_bytes = len(data)
        self._make_room(size_bytes)
        try:
            if self._segment is not None and not os.fstat(self._segment).st_nlink:
                self._end_segment()  # another process has removed the spool
            if self._segment is None:
                self._segment = self._begin_segment()
            while data:
                data = data[self._write(self._segment, data) :]
        except OSError:
            if self._segment_bytes or len(data) < size_bytes:
                self._end_segment()
            raise
        self._segment_bytes += size_bytes
        self._spooled_bytes += size_bytes
        if self._segment_bytes >= self._segment_limit_bytes:
            self._end_segment()

    def _make_room(self, size_bytes: int) -> None:
        if self._deferred:
            size_bytes += (
                self._segment_limit_bytes
            )  # after a loss, resume only with enough free space
        if self._spooled_bytes + size_bytes <= self._limit_bytes:
            return
        self._spooled_bytes = backlog_bytes(self._directory)
        if self._spooled_bytes + size_bytes > self._limit_bytes:
            raise OSError(
                errno.EDQUOT, f"the spool has reached its limit of {self._limit_bytes} bytes"
            )

    def _begin_segment(self) -> int:
        self._directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._number = max([self._number, *_segments(self._directory)]) + 1
        path = _path(self._directory, self._number)
        self._segment_bytes = 0
        return os.open(path, os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_WRONLY | _BINARY, 0o600)

    def _end_segment(self) -> None:
        if self._segment is not None:
            os.close(self._segment)
            self._segment = None


class SpoolReader:
    """Reading end of the spool. It resumes at the acknowledged position.

    The constructor waits until no other reader has the spool.

    Args:
        directory: The spool folder; created if missing.
        durable: Whether a position is on the device before segments are deleted.

    Attributes:
        state: State that was acknowledged with the position; empty in a new spool.
        stall: Why nothing has been acknowledged since then, see `note_stall`.

    Raises:
        OSError: The folder cannot be created, read or locked.
    """

    def __init__(self, directory: Path, *, durable: bool = False) -> None:
        self._durable = durable
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._directory = directory
        self._lock = lock(directory / READER_LOCK, wait=True)
        checkpoint = read_checkpoint(directory)
        self.state: dict[str, Any] = checkpoint.get("state", {})
        self.stall = stall_of(checkpoint)
        self._checkpoint = checkpoint
        self._number, self._at = checkpoint.get("segment", 0), checkpoint.get("offset_bytes", 0)
        self._file: BinaryIO | None = None
        if self._number in _segments(directory):
            self._file = _path(directory, self._number).open("rb", buffering=0)
        else:
            self._number = self._at = 0
        self._damaged = False

    def read(self) -> list[Record]:
        """Return the next records, about 1 MiB at most; an empty list if there are none yet.

        Raises:
            OSError: The spool cannot be read.
        """
        while True:
            # List first: if a newer segment exists, the current one is complete when it is read.
            newer = min((n for n in _segments(self._directory) if n > self._number), default=None)
            rest = self._remaining()
            records, size_bytes = read_blocks(rest)
            self._at += size_bytes
            if records:
                if self._damaged:
                    restart = Record(
                        ControlRecord.RESTART, 0, records[0].time_ns, 0, b"the spool is damaged"
                    )
                    records.insert(0, restart)
                    self._damaged = False
                return records
            if newer is None:
                return []
            self._damaged |= newer != self._number + 1 or not is_truncated(rest)
            self._close_file()
            self._file = _path(self._directory, newer).open("rb", buffering=0)
            self._number, self._at = newer, 0

    def acknowledge(self, state: Mapping[str, Any]) -> None:
        """Save the position and `state` (JSON): all records read so far are durable elsewhere.

        Segments before the position are deleted.

        Raises:
            OSError: The position cannot be written.
        """
        checkpoint = {"segment": self._number, "offset_bytes": self._at, "state": state}
        _write_checkpoint(self._directory, checkpoint, durable=self._durable)
        self._checkpoint = checkpoint
        self.stall = None
        for number in _segments(self._directory):
            if number < self._number:
                _path(self._directory, number).unlink()

    def restore(self) -> None:
        """Write the last acknowledged position and state again if the spool was removed.

        Raises:
            OSError: They cannot be written.
        """
        if not read_checkpoint(self._directory):
            _write_checkpoint(self._directory, self._checkpoint)

    def mark_request_count(self) -> int:
        """Return the number of mark requests, see `mark_requests`."""
        return mark_requests.mark_request_count(self._directory)

    def close(self) -> None:
        """Close the spool, so that another reader can open it."""
        self._close_file()
        os.close(self._lock)

    def _close_file(self) -> None:
        if self._file:
            self._file.close()
            self._file = None

    def _remaining(self) -> bytes:
        """Return the bytes after the current position in this segment."""
        if self._file is None:
            return b""
        self._file.seek(self._at)
        return self._file.read(MAX_BLOCK_BYTES)


def read_checkpoint(directory: Path) -> dict[str, Any]:
    """Return the last acknowledged checkpoint of a spool; empty if there is none."""
    try:
        checkpoint = json.loads((directory / _CHECKPOINT).read_bytes())
    except (FileNotFoundError, ValueError):  # unreadable after a power failure
        return {}
    return checkpoint if isinstance(checkpoint, dict) else {}


def checkpoint_time_s(directory: Path) -> float | None:
    """Return when the checkpoint was written, in seconds since the Unix epoch; None if never."""
    try:
        return (directory / _CHECKPOINT).stat().st_mtime
    except FileNotFoundError:
        return None


def replace_state(directory: Path, state: Mapping[str, Any]) -> None:
    """Replace the acknowledged state; the position remains.

    Raises:
        OSError: The checkpoint cannot be written.
    """
    _write_checkpoint(directory, {**read_checkpoint(directory), "state": state})


def note_stall(directory: Path, time_ns: int, reason: str) -> bool:
    """Save the reason of a stall until the next acknowledgment; return whether it is new."""
    checkpoint = read_checkpoint(directory)
    known = stall_of(checkpoint)
    if known and known.reason == reason:
        return False
    checkpoint["trouble"] = (known.since_ns if known else time_ns, reason)
    with suppress(OSError):  # the spool itself may be on a failing disk
        _write_checkpoint(directory, checkpoint)
    return True


def stall_of(checkpoint: Mapping[str, Any]) -> WriteStall | None:
    """Return the stall that `note_stall` saved in a checkpoint."""
    noted = checkpoint.get("trouble")
    return WriteStall(*noted) if noted else None


def _write_checkpoint(
    directory: Path, checkpoint: Mapping[str, Any], *, durable: bool = False
) -> None:
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)  # if another process has removed it
    temporary = directory / (_CHECKPOINT + ".new")
    temporary.write_text(json.dumps(checkpoint), "utf-8")
    if durable:
        sync((temporary,))
    replace_file(temporary, directory / _CHECKPOINT)
    if durable:
        sync((directory,))


def backlog_bytes(directory: Path) -> int:
    """Return the total size of the segments in a spool, read or unread."""
    return _size_bytes(directory, _segments(directory))


def unread_bytes(directory: Path) -> int:
    """Return the number of bytes in a spool after the acknowledged position."""
    checkpoint = read_checkpoint(directory)
    numbers, read_bytes = _segments(directory), 0
    if (partly_read := checkpoint.get("segment")) in numbers:
        numbers = [number for number in numbers if number >= partly_read]
        read_bytes = checkpoint.get("offset_bytes", 0)
    return max(_size_bytes(directory, numbers) - read_bytes, 0)


def _size_bytes(directory: Path, numbers: Iterable[int]) -> int:
    total = 0
    for number in numbers:
        with suppress(FileNotFoundError):  # deleted by the reader
            total += _path(directory, number).stat().st_size
    return total


def _segments(directory: Path) -> list[int]:
    """Return the numbers of the segments in a spool, in order."""
    try:
        names = [path.name for path in directory.iterdir()]
    except FileNotFoundError:
        return []
    return sorted(int(name.removesuffix(_SUFFIX)) for name in names if name.endswith(_SUFFIX))


def _path(directory: Path, number: int) -> Path:
    return directory / f"{number}{_SUFFIX}"
