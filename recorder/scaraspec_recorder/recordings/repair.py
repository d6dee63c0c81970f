"""Repairs a recording whose writer was killed or whose disk was full.

All intact records are kept, and nothing is guessed. The repaired file replaces the damaged one
atomically. If more than its end was damaged, the damaged file is kept beside it. Lost data is
described in the report and in the file (metadata ``recovered``).
"""

import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.recording_stats import RERUN_SUFFIX
from scaraspec_recorder.sinks import own_files
from scaraspec_recorder.sinks.byte_accounting import ByteAccounting
from scaraspec_recorder.sinks.mcap.chunk_writer import ChunkWriter
from scaraspec_recorder.sinks.rerun.optimizer import is_whole
from scaraspec_recorder.sources.mcap_reader import RawLayerReader
from scaraspec_recorder.sources.mcap_records import RECOVERED, McapSummary, read_records

_ORIGINAL: Final = ".damaged"
_FULL_DISK_BYTES: Final = 1 << 16


@dataclass(frozen=True, slots=True)
class RepairReport:
    """Result of a repair.

    Attributes:
        path: The file.
        repaired: Whether the file was rewritten; False if it was intact.
        events: Number of raw events in the file.
        last_ns: Time of the last event, in nanoseconds since the Unix epoch; 0 without events.
        notes: One sentence for each kind of data that was or may have been lost, also if an
            earlier repair noted it.
        original: The damaged file, if it was kept.
    """

    path: Path
    repaired: bool
    events: int
    last_ns: int
    notes: tuple[str, ...]
    original: Path | None = None


def repair(path: Path) -> RepairReport:
    """Repair a recording in place if necessary. Needs disk space for a second copy.

    Raises:
        CaptureError: The file cannot be read, is not a recording of this tool, or has data that
            this version cannot read.
        OSError: The repaired file cannot be written; the damaged one remains unchanged.
    """
    summary, original = inspect(path), None
    earlier = tuple(summary.earlier_losses())
    if not summary.intact:
        if summary.unsupported:
            raise CaptureError(
                UserMessage(
                    "{path} is damaged and was not repaired: {notes}",
                    path=path,
                    notes="; ".join(summary.notes),
                )
            )
        repaired = own_files.temporary_file(path, own_files.RECOVERED)
        try:
            with repaired.open("wb") as file:
                _copy(path, file)
                os.fsync(file.fileno())
            if summary.damaged:
                original = _keep(path)
            repaired.replace(path)
        finally:
            repaired.unlink(missing_ok=True)
        _sync_folder(path.parent)
    return RepairReport(
        path,
        not summary.intact,
        summary.events,
        summary.last_ns,
        (*summary.notes, *earlier),
        original,
    )


def incomplete_rrd(path: Path) -> str:
    """Return that the .rrd file of a recording is incomplete, and what to do; empty if it is not.

    Raises:
        OSError: The .rrd file cannot be read.
    """
    drawn = path.with_suffix(RERUN_SUFFIX)
    if drawn.is_symlink() or not drawn.is_file():
        return ""
    torn = not drawn.stat().st_size or (own_files.is_own(drawn) and not is_whole(drawn))
    if not torn:
        return ""
    return UserMessage(
        "{drawn} is incomplete: scaraspec recover {path} writes it again", drawn=drawn, path=path
    )


def inspect(path: Path) -> McapSummary:
    """Read a recording without its repair; `summary.intact` states whether it needs one.

    Raises:
        CaptureError: The file cannot be read, or is not a recording of this tool.
    """
    return _copy(path, None)


def _keep(path: Path) -> Path:
    """Give the damaged file a second name, or copy it. Return the path."""
    original, number = path.with_name(f"{path.name}{_ORIGINAL}"), 1
    while original.exists():
        number += 1
        original = path.with_name(f"{path.name}{_ORIGINAL}-{number}")
    try:
        original.hardlink_to(path)
    except OSError:  # a file system without links
        shutil.copy2(path, original)
    return original


def is_full(folder: Path) -> bool:
    """Whether the disk of a folder is full."""
    return shutil.disk_usage(folder).free < _FULL_DISK_BYTES


def _copy(path: Path, file: BinaryIO | None) -> McapSummary:
    """Copy the intact records of a recording to `file`, if given. Return the summary."""
    summary, accounts = McapSummary(), ByteAccounting()
    raw = RawLayerReader(summary)
    copier: _Copier | None = None
    headed = False
    for record in read_records(path, summary):
        if isinstance(record, Header):
            headed, copier = True, _Copier(file, record) if file else None
        if not headed:
            break  # without a header, the records are not reliable
        if copier:
            copier.copy(record)
        if event := raw.take(record):
            summary.events += 1
            summary.last_ns = max(summary.last_ns, event.time_ns)
            accounts.add(event)
    raw.finish(path)
    if copier:
        copier.finish(summary, accounts)
    return summary


class _Copier:
    """Copies records into another file with new schema and channel numbers."""

    def __init__(self, file: BinaryIO, header: Header) -> None:
        self._writer = ChunkWriter(file, header.library, header.profile)
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._metadata: set[str] = set()

    def copy(self, record: McapRecord) -> None:
        """Copy a record. Index and summary records are created again at the end."""
        writer = self._writer
        match record:
            case Message():
                if number := self._channels.get(record.channel_id):
                    writer.message(
                        number,
                        record.log_time,
                        record.data,
                        record.sequence,
                        record.publish_time,
                    )
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
                writer.attachment(
                    record.log_time,
                    record.name,
                    record.media_type,
                    record.data,
                    create_time_ns=record.create_time,
                )
            case Metadata():
                self._metadata.add(record.name)
                writer.metadata(record.name, record.metadata)

    def finish(self, summary: McapSummary, accounts: ByteAccounting) -> None:
        """Write the missing accounts, the notes and the end of the file."""
        for name, entries in accounts.close().items():
            if name not in self._metadata:
                self._writer.metadata(name, entries)
        notes = {str(number): note for number, note in enumerate(summary.notes, start=1)}
        self._writer.metadata(RECOVERED, notes)
        self._writer.finish()


def _sync_folder(folder: Path) -> None:
    """Make a file replacement durable, if the system supports it."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
