"""Reads capture.mcap: the raw layer as wire events, even from a damaged file.

Only the raw layer is read; everything else is decoded again. A damaged file yields all its intact
records and notes about what is missing. Nothing is written.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from mcap.records import Channel, Header, McapRecord, Message, Metadata, Schema

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError, TornCaptureError
from scaraspec_recorder.sinks.byte_accounting import ByteAccountingCheck
from scaraspec_recorder.sinks.clock_watch import LOG_SOURCE
from scaraspec_recorder.sinks.file_names import utc_time
from scaraspec_recorder.sinks.gap_filler import GapFiller
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.mcap.mcap_sink import LINK, SCHEMA, SERIAL, SESSION
from scaraspec_recorder.sinks.mcap.schemas import foxglove
from scaraspec_recorder.sources.mcap_records import McapSummary, open_mcap, read_records
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk

_MAX_TIME_NS: Final = (1 << 63) - 1  # in the year 2262; a later one is damage
_SEQUENCES: Final = 1 << 32
_RECORDER: Final = "scaraspec"  # begins the library name of our recordings
_RAW_KINDS: Final[dict[str, type[schemas.Message]]] = {
    schemas.full_name(kind): kind
    for kind in (schemas.RawChunk, schemas.ConnectionEvent, schemas.Gap)
}


@dataclass(slots=True)
class _Channel:
    """A channel of the raw layer.

    Attributes:
        kind: The type of its messages.
        part: 0, or for a further channel of the same topic its number: two recordings were merged,
            and both may have a connection "1".
    """

    kind: type[schemas.Message]
    part: int


class RawLayerReader:
    """Converts records of the raw layer to wire events.

    Args:
        summary: The summary of the file that is read.

    Attributes:
        channels: The channels whose messages it needs, as far as they were declared.
        merged: Whether two channels of a topic have a connection of the same name: the file holds
            several recordings.
        clock_events: The lines of the log about the recorder's clock, with their times.
    """

    def __init__(self, summary: McapSummary) -> None:
        self.channels: set[int] = set()
        self.merged = False
        self.clock_events: list[str] = []
        self._summary = summary
        self._log_channels: set[int] = set()
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, _Channel] = {}
        self._topics: Counter[str] = Counter()
        self._parts: dict[str, int] = {}  # by connection
        self._sequences: dict[int, int] = {}  # the last one, by part
        self._missing = 0
        self._numbered = False  # the sequence numbers are those of our recorder

    def take(self, record: McapRecord) -> WireEvent | None:
        """Return the event of a record; None if it has no readable event."""
        if isinstance(record, Message):
            if channel := self._channels.get(record.channel_id):
                return self._event(record, channel)
            if record.channel_id in self._log_channels:
                self._read_log(record)
        elif isinstance(record, Header):
            self._numbered = record.library.startswith(_RECORDER)
        elif isinstance(record, Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, Channel) and self._schemas.get(record.schema_id) == foxglove.LOG:
            self._log_channels.add(record.id)
            self.channels.add(record.id)
        elif (
            isinstance(record, Channel)
            and record.id not in self._channels
            and (kind := _RAW_KINDS.get(self._schemas.get(record.schema_id, "")))
        ):
            self._channels[record.id] = _Channel(kind, self._topics[record.topic])
            self._topics[record.topic] += 1
            self.channels.add(record.id)
        return None

    def _event(self, message: Message, channel: _Channel) -> WireEvent | None:
        """Return the event of a message of the raw layer; None if it is not readable."""
        time_ns = min(message.log_time, _MAX_TIME_NS)
        try:
            decoded = schemas.decode(channel.kind, message.data)
            event = _event(time_ns, decoded, self._summary.messages)
        except ValueError:
            return None
        self._number(channel.part, message.sequence)
        if channel.part != self._parts.setdefault(event.connection, channel.part):
            self.merged = True
            name = f"{event.connection} of recording {channel.part + 1}"
            event = replace(event, connection=name)
        return event

    def _read_log(self, message: Message) -> None:
        with suppress(ValueError):
            source, text = foxglove.read_log(message.data)
            if source == LOG_SOURCE:
                time = utc_time(message.log_time)
                self.clock_events.append(f"{text} at {time:%Y-%m-%d %H:%M:%S} UTC")

    def _number(self, part: int, sequence: int) -> None:
        """Count missing numbers; numbers that are repeated or fall have another meaning."""
        ahead = (sequence - self._sequences.get(part, sequence - 1)) % _SEQUENCES
        self._numbered = self._numbered and 0 < ahead < _SEQUENCES // 2
        self._missing += ahead - 1
        self._sequences[part] = sequence

    def finish(self, path: Path) -> None:
        """Finish: add a note about missing events.

        Raises:
            CaptureError: The file has no raw layer.
        """
        if not self._channels:
            ours = _RAW_KINDS.keys() & set(self._schemas.values())
            if self._summary.finished or (self._schemas and not ours):
                raise CaptureError(
                    UserMessage(
                        "{path} has no raw bytes of a link: it was not written by scaraspec record",
                        path=path,
                    )
                )
            raise TornCaptureError(
                UserMessage("{path} ends before anything was recorded", path=path)
            )
        if self._missing and self._numbered:
            self._summary.notes.append(
                UserMessage("{count} raw events are missing in the file", count=self._missing)
            )


def _event(time_ns: int, message: schemas.Message, number: int) -> WireEvent:
    """Convert a message of the raw layer to an event.

    Raises:
        ValueError: The direction or the kind of the message is unknown.
    """
    if isinstance(message, schemas.RawChunk):
        connection, direction, offset, data, note, forwarded_ns, kernel = message
        raw = (time_ns, connection, Direction(direction), Kind.BYTES, data, offset, 0, note)
        if forwarded_ns or kernel:
            return ForwardedChunk(*raw, forwarded_ns or 0, kernel, packet=number)
        return WireEvent(*raw, packet=number)
    match message:
        case schemas.Gap(connection, direction, offset, length, note):
            kind, data = Kind.GAP, b""
        case schemas.ConnectionEvent(connection, direction, offset, name, note):
            kind, data, length = Kind(name), b"", 0
        case _:
            raise ValueError("no message of the raw layer")
    place = (time_ns, connection, Direction(direction))
    return WireEvent(*place, kind, data, offset, length, note, packet=number)


class McapCapture:
    """The wire events of a recording, in order. Each iteration reads the file again.

    Missing bytes between two events of a stream become a gap.

    Args:
        path: The file.
        wait: See `read_records`.

    Attributes:
        path: The file.
        summary: Complete when an iteration has ended.
    """

    def __init__(self, path: Path, wait: Callable[[], bool] | None = None) -> None:
        self.path = path
        self.summary = McapSummary()
        self._wait = wait

    @property
    def session(self) -> Mapping[str, str]:
        """The description of the session; see `mcap_sink`. Empty if the file has none.

        Raises:
            CaptureError: The file cannot be opened, is not an MCAP file, or its description has
                another version.
        """
        for record in read_records(self.path, McapSummary()):
            if isinstance(record, Metadata) and record.name == SESSION:
                if (schema := record.metadata.get("schema", SCHEMA)) != SCHEMA:
                    raise CaptureError(
                        UserMessage(
                            "{path} describes its session as {schema!r}, but this version of "
                            "scaraspec reads {supported}: use the version that wrote it",
                            path=self.path,
                            schema=schema[:40],
                            supported=SCHEMA,
                        )
                    )
                return record.metadata
            if isinstance(record, Message):
                break
        return {}

    @property
    def needs_login(self) -> bool:
        """Whether the link needs a login; False if the file states that it was serial (L83).

        Raises:
            CaptureError: See `session`.
        """
        return self.session.get(LINK) != SERIAL

    def __iter__(self) -> Iterator[WireEvent]:
        """Read the file.

        Raises:
            CaptureError: The file cannot be opened, is not an MCAP file, or has no raw layer.
        """
        self.summary = summary = McapSummary()
        raw, gap_filler, audit = RawLayerReader(summary), GapFiller(), ByteAccountingCheck()
        for record in read_records(self.path, summary, self._wait, channels=raw.channels):
            if isinstance(record, Metadata):
                audit.add_metadata(record.name, record.metadata)
            elif event := raw.take(record):
                audit.count(event)
                for filled in gap_filler.fill(event):
                    summary.events += 1
                    summary.losses += filled.is_loss
                    summary.last_ns = max(summary.last_ns, filled.time_ns)
                    yield filled
        raw.finish(self.path)
        if summary.finished:  # else its last accounts were not written
            audit.close()
        summary.merged = raw.merged
        summary.clock_events = raw.clock_events
        if not raw.merged:  # the accounts of merged recordings have the same names
            summary.wrong_accounts = audit.wrong
        if summary.wrong_accounts:
            summary.notes.append(
                UserMessage(
                    "{count} streams are not what the file's own accounts say of them: "
                    "it was damaged or changed after the recording",
                    count=summary.wrong_accounts,
                )
            )
        summary.notes += summary.earlier_losses()


def read_mcap(path: Path, wait: Callable[[], bool] | None = None) -> McapCapture:
    """Open a recording; see `McapCapture`.

    Returns:
        Its events; see `McapCapture`.

    Raises:
        CaptureError: The file cannot be opened or is not an MCAP file.
    """
    with open_mcap(path):
        return McapCapture(path, wait)
