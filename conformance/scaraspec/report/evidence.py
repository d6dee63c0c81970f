"""Evidence: the frames that support findings, stored as hex with their fields.

A finding contains positions, not bytes, and the bytes are available only while the recording is
read. This module searches the frames of the current event and the last few hundred frames, and
stores them for a bounded number of findings. Passwords are masked here, before any output.
"""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import Final

from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import FinalResult, FirstReply, NameList, OptionalRecord, Payload
from scaraspec.protocol.redaction import is_secret, mask, mask_unframed
from scaraspec.protocol.transfer import Chunk
from scaraspec.report.failed_step import FailedStep, Stage
from scaraspec.report.model import Evidence, FrameField
from scaraspec.report.packet_index import PacketIndex
from scaraspec.traffic.events import (
    Ending,
    Exchange,
    FrameSeen,
    InvalidBytes,
    TrafficEvent,
    Transfer,
)
from scaraspec.traffic.wire import WireEvent, WireRange

_RECENT_FRAMES: Final = 256
_FINDINGS_PER_REQUIREMENT: Final = 50
_SHOWN_BYTES: Final = 512

HIDDEN_VALUE: Final = "(hidden)"


class EvidenceCollector:
    """Collects the output of a judge, and returns the evidence for the positions in findings."""

    def __init__(self) -> None:
        self._packets = PacketIndex()
        self._packet_of: dict[WireRange, int] = {}
        self._recent: deque[FrameSeen | InvalidBytes] = deque(maxlen=_RECENT_FRAMES)
        self._last: Exchange | None = None
        self._stored: dict[WireRange, Evidence] = {}
        self._findings: Counter[str] = Counter()
        self._passing: Exchange | None = None  # the current exchange, without a failure so far
        self._passed: dict[str, Exchange] = {}

    def add(self, item: TrafficEvent | Finding) -> None:
        """Add the next item; a finding follows the event that it judges."""
        if isinstance(item, Finding):
            if item.verdict is Verdict.FAIL:
                self._passing = None
            self._store(item)
            return
        if self._passing:
            self._passed[self._passing.name] = self._passing
            self._passing = None
        if isinstance(item, FrameSeen | InvalidBytes):
            self._recent.append(item)
        elif isinstance(item, Exchange):
            self._last = item
            self._passing = item if item.ending is Ending.ANSWERED else None
        elif isinstance(item, Transfer):
            self._last = item.opening

    def note_packet(self, event: WireEvent) -> None:
        """Store which packet or message of the capture has the bytes of an event."""
        self._packets.add(event)

    def evidence(self, place: WireRange) -> Evidence:
        """Return the evidence at a position, with its bytes if they were stored."""
        evidence = self._stored.get(place) or _evidence(place)
        return replace(evidence, packet=self._packet_of.get(place, 0))

    def passing(self, wire: Sequence[Evidence]) -> tuple[Evidence, ...]:
        """Return the last passing exchange of the command at the end of `wire`; empty if none."""
        name = next((evidence.note.partition(",")[0] for evidence in reversed(wire)), "")
        passed = self._passed.get(name)
        return tuple(evidence_of(seen) for seen in passed.frames) if passed else ()

    def _store(self, finding: Finding) -> None:
        self._findings[finding.requirement] += 1
        if self._findings[finding.requirement] > _FINDINGS_PER_REQUIREMENT:
            return
        for place in finding.evidence:
            self._packet_of[place] = self._packets.find(place)
        needed = set(finding.evidence) - self._stored.keys()
        last = self._last.frames if self._last else ()
        for seen in chain(last, reversed(self._recent)):
            if not needed:
                return
            if seen.place in needed:
                needed.remove(seen.place)
                self._stored[seen.place] = evidence_of(seen)


def evidence_of(seen: FrameSeen | InvalidBytes) -> Evidence:
    """Return a frame or invalid bytes as evidence, with passwords masked."""
    if isinstance(seen, InvalidBytes):
        return _evidence(seen.place, f"no frame: {seen.reason.value}", mask_unframed(seen.data))
    frame = seen.frame
    if is_secret(frame):
        frame = frame._replace(data=mask(frame.data))
    note = f"undefined opcode {frame.opcode:02X}"
    if seen.parsed:
        part = "final result" if frame.tagged else seen.parsed.part
        note = f"{seen.parsed.command.name}, {part}"
    return _evidence(seen.place, note, frame.encode(), tuple(_fields(seen, frame)))


def step_of(wire: Sequence[Evidence], observed: str = "") -> FailedStep:
    """Return the step that a failure is about, which the last frame shows.

    Args:
        wire: The evidence, in order of time.
        observed: The observed value, which names the field of the frame.
    """
    if not wire:
        return FailedStep(0, Stage.CONNECTION)
    last = wire[-1]
    command, _, part = last.note.partition(", ")
    if not part:
        return FailedStep(wire[0].time_ns, Stage.FRAME)
    texts = [field for field in last.fields if field.name not in _FRAME_PARTS]
    named = [field.name for field in texts if field.value == observed or len(texts) == 1]
    return FailedStep(wire[0].time_ns, _STAGES.get(part, Stage.REPLY), command, "".join(named[:1]))


_FRAME_PARTS: Final = frozenset({"start", "tag", "opcode", "length", "end"})
_STAGES: Final = {"request": Stage.REQUEST, "final result": Stage.RESULT}


def _evidence(
    place: WireRange, note: str = "", data: bytes = b"", fields: tuple[FrameField, ...] = ()
) -> Evidence:
    return Evidence(
        place.connection,
        place.direction,
        place.offset_bytes,
        place.length_bytes,
        place.time_ns,
        note,
        data[:_SHOWN_BYTES].hex().upper(),
        fields,
    )


def _fields(seen: FrameSeen, frame: Frame) -> Iterator[FrameField]:
    """Yield the parts of a frame in order (L89-98), without the bars between texts."""
    direction, data = frame.direction, frame.data
    names = ("start", "tag", "opcode", "length") if frame.tagged else ("start", "opcode", "length")
    title = seen.command.title if seen.command else "undefined"
    values = {"opcode": title, "length": str(len(data)), "tag": "final result"}
    for at, name in enumerate(names):
        yield FrameField(name, at, 1, values.get(name, direction.value))
    at = len(names)
    if frame is not seen.frame:
        yield FrameField("data", at, len(data), HIDDEN_VALUE)
    elif isinstance(seen.value, Chunk):
        yield from _chunk_fields(seen.value, at)
    elif data:
        yield from _text_fields(seen, at)
    yield FrameField("end", at + len(data), 1, direction.value)


def _chunk_fields(chunk: Chunk, at: int) -> Iterator[FrameField]:
    """Yield the members of fileData (L718-723)."""
    for name, value in zip(("fileSize", "position", "length"), chunk[:3], strict=True):
        yield FrameField(name, at, 4, str(value))
        at += 4
    valid_bytes, padding_bytes = len(chunk.data), len(chunk.buffer) - len(chunk.data)
    if valid_bytes:
        yield FrameField("data", at, valid_bytes, f"{valid_bytes} valid bytes")
    if padding_bytes:
        yield FrameField("padding", at + valid_bytes, padding_bytes)


def _text_fields(seen: FrameSeen, at: int) -> Iterator[FrameField]:
    texts = seen.frame.data.split(b"|")
    payload = seen.command.payload(seen.frame) if seen.command else None
    for name, text in zip(_names(payload, len(texts)), texts, strict=True):
        if text:
            yield FrameField(name, at, len(text), show(text))
        at += len(text) + 1


def _names(payload: Payload | None, count: int) -> tuple[str, ...]:
    """Return the names of the texts between bars; ``data`` if they do not match the payload."""
    fields = tuple(field.name for field in payload.fields) if payload else ()
    match payload:
        case FirstReply() | FinalResult():
            drawn: tuple[str, ...] = ("flag", "code")
        case NameList():
            drawn = ("flag", *("name",) * (count - 1))
        case OptionalRecord():
            drawn = ("flag", *fields)
        case _:
            drawn = fields if count == len(fields) else ()
    return drawn[:count] if count <= len(drawn) else ("data",) * count
