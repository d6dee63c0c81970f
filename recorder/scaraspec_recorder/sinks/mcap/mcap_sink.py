"""Writes capture.mcap: raw traffic and decoded items.

The file has two layers. The raw layer (`/raw/…`, `/connection`, `/gap`) is the reference: it is
written as received, and everything else can be derived from it again. The derived layer comes from
a `Decoder` and contains no passwords. Metadata records describe the session (`SESSION`), the bytes
of each stream and the result. `mcap_reader` reads the file. After a write error,
nothing more is written to the file.
"""

import math
import os
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import version
from io import UnsupportedOperation
from pathlib import Path
from typing import Any, BinaryIO, Final

from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.commands import JointValues, Pose
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import show
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.redaction import mask_unframed
from scaraspec.protocol.transfer import TransferState
from scaraspec.traffic.events import (
    Exchange,
    FrameSeen,
    InvalidBytes,
    Transfer,
)
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks import text as event_text
from scaraspec_recorder.sinks.byte_accounting import ByteAccounting
from scaraspec_recorder.sinks.decoder import Item
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.mcap.chunk_writer import ChunkWriter
from scaraspec_recorder.sinks.mcap.schemas import foxglove, ros2
from scaraspec_recorder.sinks.rerun import arm_model
from scaraspec_recorder.sinks.sink import FileRemoved
from scaraspec_recorder.sinks.text import LogLine
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk, LatencyTracker

RAW_TOPICS: Final = {A2C: "/raw/a2c", C2A: "/raw/c2a"}
CONNECTION_TOPIC: Final = "/connection"
GAP_TOPIC: Final = "/gap"

SESSION: Final = "session"
"""Name of the metadata record that describes the session; it precedes all messages."""

SCHEMA: Final = "scaraspec.session/1"
"""Version of that record, in its key ``schema``; files of scaraspec 0.1.0 have no such key."""

SUBJECT: Final = "subject"
"""Key in it of the side that a certification tested: ``controller`` or ``client``."""

CLAIM: Final = "subject."
"""Prefix in it of the keys of what the ICS claims, such as ``subject.time_scale``."""

LINK: Final = "link"
SERIAL: Final = "serial"
"""Key and value in it of a serial link, which needs no login (L83)."""

PASSWORDS: Final = "passwords"
MASKED: Final = "masked"
"""Key and value in it of a recording whose raw bytes contain no passwords."""

_TOOL: Final = f"scaraspec {version('scaraspec')}"

_OWN_TOPICS: Final[dict[str, type[schemas.Message]]] = {
    RAW_TOPICS[A2C]: schemas.RawChunk,
    RAW_TOPICS[C2A]: schemas.RawChunk,
    CONNECTION_TOPIC: schemas.ConnectionEvent,
    GAP_TOPIC: schemas.Gap,
    "/frames": schemas.Frame,
    "/undecodable": schemas.Undecodable,
    "/exchanges": schemas.Exchange,
    "/transfers": schemas.Transfer,
    "/findings": schemas.Finding,
}
_FOXGLOVE_TOPICS: Final = {"/log": foxglove.LOG, "/tf": foxglove.TRANSFORMS}
_ROS_TOPICS: Final = {"/joint_states": ros2.JOINT_STATE, "/robot_description": ros2.STRING}

_JOINTS: Final = tuple(segment.joint for segment in arm_model.SEGMENTS)
_UNKNOWN: Final = (math.nan,) * len(_JOINTS)


class _Output:
    """The file. Each flush syncs it to disk; a file that fails while empty is removed."""

    def __init__(self, file: BinaryIO, discard: Callable[[], None]) -> None:
        self.has_data = False
        self._file = file
        self._discard = discard

    def write(self, data: bytes) -> None:
        self._do(self._file.write, data)

    def flush(self) -> None:
        self._do(self._file.flush)
        with suppress(UnsupportedOperation):  # a file in memory has no descriptor
            self._do(getattr(os, "fdatasync", os.fsync), self._file.fileno())

    def close(self) -> None:
        self._do(self._file.close)

    @property
    def removed(self) -> bool:
        """Whether the file has no name any more."""
        with suppress(UnsupportedOperation):  # as above
            return os.fstat(self._file.fileno()).st_nlink == 0
        return False

    def _do(self, act: Callable[..., object], *arguments: object) -> None:
        try:
            act(*arguments)
        except OSError:
            if not self.has_data:
                self._discard()
            raise


class McapSink:
    """Writes one MCAP file.

    Args:
        file: Opened for writing in binary; closed by `close`.
        session: Session metadata, such as the addresses; stored as metadata ``session``.
        discard: Removes the file; called if writing fails before it contains traffic.

    Raises:
        FileRemoved: From `tick` and `close`.
        OSError: From every method, if the file cannot be written. Then no further method may be
            called; `repair` recovers the content.
    """

    def __init__(
        self,
        file: BinaryIO,
        session: Mapping[str, str] | None = None,
        discard: Callable[[], None] = lambda: None,
    ) -> None:
        self._output = _Output(file, discard)
        self._writer = ChunkWriter(self._output, _TOOL)
        self._channels = _declare(self._writer)
        self._byte_accounting = ByteAccounting()
        self._loss = FileRemoved(Path(getattr(file, "name", "")).name, {}, {})
        self._sequence = 0
        self._now_ns = 0
        self._dirty = False
        self._joints: tuple[int, tuple[float, ...]] | None = None
        self._latencies = LatencyTracker()
        self._writer.metadata(SESSION, {**(session or {}), "schema": SCHEMA, "tool": _TOOL})
        self._writer.flush()

    def write(self, event: WireEvent) -> None:
        """Write a raw event."""
        self._now_ns = event.time_ns
        self._latencies.write(event)
        if not self._sequence:
            self._add("/robot_description", ros2.string(arm_model.urdf()))
        self._sequence += 1
        self._dirty = True
        topic, data = _raw(event)
        self._writer.message(self._channels[topic], event.time_ns, data, self._sequence)
        for name, entries in self._byte_accounting.add(event).items():
            self._writer.metadata(name, entries)

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Write an item derived from a raw event."""
        if take := self._TAKE.get(type(item)):
            take(self, item, number)
        if line and line.level != event_text.Level.DEBUG:
            self._add("/log", foxglove.log(self._now_ns, *line))

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Write a line of the log that does not come from a raw event."""
        self._dirty = True
        self._writer.message(self._channels["/log"], time_ns, foxglove.log(time_ns, *line))

    def tick(self, now_ns: int) -> None:  # noqa: ARG002 - a flush needs no time
        """Sync all data to disk, so that it survives a power failure."""
        self._check_presence()
        if self._dirty:
            self._writer.flush()
            self._dirty = False
            self._output.has_data = True
            counts = self._byte_accounting
            self._loss = FileRemoved(self._loss.name, counts.begins, Counter(counts.recorded_bytes))

    def close(self, summary: Mapping[str, str]) -> None:
        """Write the accounts of open streams, the summary and the end of the file."""
        self._check_presence()
        for name, entries in self._byte_accounting.close().items():
            self._writer.metadata(name, entries)
        self._writer.metadata("summary", summary)
        self._writer.finish()
        self._output.close()

    def _check_presence(self) -> None:
        if self._output.removed:
            raise self._loss

    def _add(self, topic: str, data: bytes) -> None:
        """Add a message of the derived layer with the time of its raw event."""
        self._writer.message(self._channels[topic], self._now_ns, data)

    def _frame(self, seen: FrameSeen, _: int) -> None:
        place, frame = seen.place, seen.frame
        self._latencies.frame(seen)
        data = schemas.encode(
            schemas.Frame,
            connection=place.connection,
            direction=place.direction.value,
            offset_bytes=place.offset_bytes,
            size_bytes=place.length_bytes,
            opcode=frame.opcode,
            tagged=frame.tagged,
            command=event_text.name_of(seen),
            part=event_text.part_of(seen),
            text=event_text.frame_text(seen),
            complaints=event_text.defect_texts(seen),
        )
        self._add("/frames", data)

    def _undecodable(self, item: InvalidBytes, _: int) -> None:
        place = item.place
        data = schemas.encode(
            schemas.Undecodable,
            connection=place.connection,
            direction=place.direction.value,
            offset_bytes=place.offset_bytes,
            size_bytes=place.length_bytes,
            why=item.reason.value,
            data=mask_unframed(item.data),
        )
        self._add("/undecodable", data)

    def _exchange(self, exchange: Exchange, number: int) -> None:
        request, reply, result = exchange.request, exchange.reply, exchange.result
        latency_ns, duration_ns = exchange.latency_ns, exchange.duration_ns
        latency = self._latencies.exchange(exchange)
        answer = exchange.outcome or exchange.reply_value
        code = answer.code if isinstance(answer, Acceptance | Outcome) else None
        data = schemas.encode(
            schemas.Exchange,
            number=number,
            connection=request.place.connection,
            command=exchange.name,
            opcode=request.frame.opcode,
            request=event_text.frame_text(request),
            reply=event_text.frame_text(reply) if reply else "",
            result=event_text.frame_text(result) if result else "",
            ending=exchange.ending.value,
            accepted=exchange.accepted,
            code=code or "",
            latency_ms=None if latency_ns is None else latency_ns / 1e6,
            duration_s=None if duration_ns is None else duration_ns / 1e9,
            request_time_ns=request.place.time_ns,
            request_offset_bytes=request.place.offset_bytes,
            reply_offset_bytes=reply.place.offset_bytes if reply else None,
            result_offset_bytes=result.place.offset_bytes if result else None,
            robot_ms=latency.robot_ns / 1e6 if latency else None,
            recorder_ms=latency.recorder_ns / 1e6 if latency else None,
        )
        self._add("/exchanges", data)
        answer = exchange.reply_value
        if exchange.name == "get_joint_angles" and isinstance(answer, JointValues):
            self._arm(answer)
        elif exchange.name == "get_tool_coordinates" and isinstance(answer, Pose):
            tool = arm_model.measured(answer)
            self._add("/tf", foxglove.transforms(self._now_ns, (tool,)))

    def _arm(self, joints: JointValues) -> None:
        """Write the arm's pose: joint values, mean rates since the last ones, and transforms."""
        time_ns = self._now_ns
        position = arm_model.to_si(joints)
        rates = _UNKNOWN
        if self._joints and (elapsed_ns := time_ns - self._joints[0]) > 0:
            before = self._joints[1]
            rates = tuple(
                (new - old) / elapsed_ns * 1e9 for new, old in zip(position, before, strict=True)
            )
        self._joints = (time_ns, position)
        effort = _UNKNOWN  # not in the protocol
        state = ros2.joint_state(time_ns, _JOINTS, position, rates, effort)
        self._add("/joint_states", state)
        self._add("/tf", foxglove.transforms(time_ns, arm_model.place(joints)))

    def _transfer(self, transfer: Transfer, _: int) -> None:
        content = bytes(transfer.content)
        whole = transfer.state is TransferState.DONE and transfer.whole_content
        connection = transfer.opening.request.place.connection if transfer.opening else ""
        data = schemas.encode(
            schemas.Transfer,
            connection=connection,
            upload=transfer.upload,
            name=show(transfer.name),
            size_bytes=transfer.size_bytes,
            received_bytes=transfer.received_bytes,
            chunks=transfer.chunks,
            order=transfer.order,
            state=transfer.state.value,
            reason=transfer.reason,
            begun_ns=transfer.begun_ns,
            duration_s=(transfer.ended_ns - transfer.begun_ns) / 1e9,
            sha256=sha256(content).hexdigest() if whole else "",
        )
        self._add("/transfers", data)
        if whole:
            name = event_text.attachment_name(transfer)
            self._writer.attachment(transfer.ended_ns, name, "application/octet-stream", content)

    def _finding(self, finding: Finding, _: int) -> None:
        data = schemas.encode(
            schemas.Finding,
            requirement=finding.requirement,
            verdict=finding.verdict.value,
            cause=finding.cause.value,
            message=finding.message,
            expected=finding.expected,
            observed=finding.observed,
            reading="=".join(finding.reading or ()),
            places=tuple(event_text.place_text(place) for place in finding.evidence),
        )
        self._add("/findings", data)

    # Functions, not bound methods: those would create a reference cycle.
    _TAKE: Final[Mapping[type, Callable[["McapSink", Any, int], None]]] = {
        FrameSeen: _frame,
        Exchange: _exchange,
        InvalidBytes: _undecodable,
        Transfer: _transfer,
        Finding: _finding,
    }


def _raw(event: WireEvent) -> tuple[str, bytes]:
    """Return topic and message of a raw event."""
    where: dict[str, Any] = {
        "connection": event.connection,
        "direction": event.direction.value,
        "offset_bytes": event.offset_bytes,
        "note": event.note,
    }
    if event.kind is Kind.BYTES:
        if isinstance(event, ForwardedChunk):
            where["forwarded_ns"] = event.forwarded_ns or None
            where["kernel_time"] = event.kernel_time
        topic = RAW_TOPICS[event.direction]
        return topic, schemas.encode(schemas.RawChunk, data=event.data, **where)
    if event.kind is Kind.GAP:
        data = schemas.encode(schemas.Gap, length_bytes=event.length_bytes, **where)
        return GAP_TOPIC, data
    data = schemas.encode(schemas.ConnectionEvent, kind=event.kind.value, **where)
    return CONNECTION_TOPIC, data


def _declare(writer: ChunkWriter) -> dict[str, int]:
    """Declare all topics with their schemas. Return the channel numbers by topic."""
    channels, known = {}, {}
    for topic, kind in _OWN_TOPICS.items():
        if kind not in known:
            name = schemas.full_name(kind)
            known[kind] = writer.schema(name, "protobuf", schemas.descriptor_set(kind))
        channels[topic] = writer.channel(topic, "protobuf", known[kind])
    for topic, name in _FOXGLOVE_TOPICS.items():
        number = writer.schema(name, "protobuf", foxglove.descriptor_set(name))
        channels[topic] = writer.channel(topic, "protobuf", number)
    for topic, name in _ROS_TOPICS.items():
        definition = ros2.DEFINITIONS[name].encode()
        number = writer.schema(name, ros2.SCHEMA_ENCODING, definition)
        channels[topic] = writer.channel(topic, ros2.ENCODING, number)
    return channels
