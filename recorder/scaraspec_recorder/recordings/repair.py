"""Recover: a recording whose writer was killed or whose disk was full becomes a whole file again.

Law: nothing is guessed and nothing whole is lost. The repaired file takes the place of the damaged
one in one step; until then that one stays as it was. What cannot be kept is told, in the report and
in the file (metadata ``recovered``).
"""

import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from scaraspec_recorder.sinks.byte_accounting import ByteAccounting
from scaraspec_recorder.sinks.mcap.chunk_writer import ChunkWriter
from scaraspec_recorder.sinks.rerun.optimizer import SUFFIX as OPTIMIZED
from scaraspec_recorder.sources.mcap_reader import McapSummary, RawLayerReader, read_records

RECOVERED: Final = "recovered"

_SUFFIX: Final = ".recovered"
_LITTLE_BYTES: Final = 1 << 16
_IN_THE_MAKING: Final = (f".*.mcap{_SUFFIX}", f".*.rrd{OPTIMIZED}", ".*.rrd.new")


@dataclass(frozen=True, slots=True)
class RepairReport:
    """What became of a file.

    Attributes:
        path: The file.
        repaired: Whether it was written anew; false where it was whole.
        events: Raw events that it holds.
        last_ns: Time of the latest of them, in nanoseconds since the Unix epoch; 0 without one.
        notes: One sentence for each kind of thing that was lost, or may have been.
    """

    path: Path
    repaired: bool
    events: int
    last_ns: int
    notes: tuple[str, ...]


def repair(path: Path) -> RepairReport:
    """Repair a recording in place, if it needs it: that takes as much room on the disk again.

    Raises:
        CaptureError: The file cannot be read, or is no recording of this tool.
        OSError: The repaired file cannot be written; the damaged one is as it was.
    """
    repaired = path.with_name(f".{path.name}{_SUFFIX}")
    summary = _copy(path, None)
    if not summary.whole:
        try:
            with repaired.open("wb") as file:
                summary = _copy(path, file)
                os.fsync(file.fileno())
            repaired.replace(path)
        finally:
            repaired.unlink(missing_ok=True)
        _sync_folder(path.parent)
    notes = tuple(summary.notes)
    return RepairReport(path, not summary.whole, summary.events, summary.last_ns, notes)


def remove_temporary_files(folder: Path) -> None:
    """Remove what a process that was killed had in the making beside the files of a folder.

    Raises:
        OSError: It cannot be removed.
    """
    for pattern in _IN_THE_MAKING:
        for path in folder.glob(pattern):
            path.unlink(missing_ok=True)


def is_full(folder: Path) -> bool:
    """Whether the disk of a folder has no room for anything."""
    return shutil.disk_usage(folder).free < _LITTLE_BYTES


def remove_if_empty(path: Path) -> bool:
    """Remove a file whose recorder was killed before it wrote anything; return whether it was so.

    Raises:
        OSError: It cannot be removed.
    """
    empty = not path.stat().st_size
    if empty:
        path.unlink()
    return empty


def _copy(path: Path, file: BinaryIO | None) -> McapSummary:
    """Write what is whole in a recording to another file, or to none; return what was found."""
    summary, raw, accounts = McapSummary(), RawLayerReader(), ByteAccounting()
    copier: _Copier | None = None
    headed = False
    for record in read_records(path, summary):
        if isinstance(record, Header):
            headed, copier = True, _Copier(file, record) if file else None
        if not headed:
            break  # without its header nothing else is what it seems
        if copier:
            copier.copy(record)
        if event := raw.take(record):
            summary.events += 1
            summary.last_ns = max(summary.last_ns, event.time_ns)
            accounts.add(event)
    raw.finish(path, summary)
    if copier:
        copier.finish(summary, accounts)
    return summary


class _Copier:
    """Writes records into another file, where they get numbers of their own."""

    def __init__(self, file: BinaryIO, header: Header) -> None:
        self._writer = ChunkWriter(file, header.library)
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._metadata: set[str] = set()

    def copy(self, record: McapRecord) -> None:
        """Copy a record; one that only tells of others is made anew at the end."""
        writer = self._writer
        match record:
            case Message():
                if number := self._channels.get(record.channel_id):
                    writer.message(number, record.log_time, record.data, record.sequence)
            case Schema():
                if record.id not in self._schemas:
                    number = writer.schema(record.name, record.encoding, record.data)
                    self._schemas[record.id] = number
            case Channel():
                if record.id not in self._channels and record.schema_id in self._schemas:
                    number = self._schemas[record.schema_id]
                    self._channels[record.id] = writer.channel(
                        record.topic, record.message_encoding, number, record.metadata
                    )
            case Attachment():
                writer.attachment(record.log_time, record.name, record.media_type, record.data)
            case Metadata():
                self._metadata.add(record.name)
                writer.metadata(record.name, record.metadata)

    def finish(self, summary: McapSummary, accounts: ByteAccounting) -> None:
        """Write the accounts that the file still owes, what was lost, and its end."""
        for name, entries in accounts.close().items():
            if name not in self._metadata:
                self._writer.metadata(name, entries)
        notes = {str(number): note for number, note in enumerate(summary.notes, start=1)}
        self._writer.metadata(RECOVERED, notes)
        self._writer.finish()


def _sync_folder(folder: Path) -> None:
    """Make a replacement survive a loss of power, where the system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
