"""Reads pcap and pcapng files as wire events.

This is the only module that uses scapy, and only for the file's records: `tcp_segment` reads packet
headers, `reassembly` rebuilds streams. The file is streamed, never loaded as a whole. A damaged
file yields the packets before the damage, and a note.
"""

import logging
import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from io import BufferedReader
from pathlib import Path
from struct import Struct
from types import MappingProxyType
from typing import Any, BinaryIO, Final, NamedTuple

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.traffic.wire import WireEvent, WireRange
from scaraspec.user_message import UserMessage
from scaraspec_recorder.encapsulation import UndecodedPacket, UnreadablePacket
from scaraspec_recorder.errors import CaptureError, TornCaptureError
from scaraspec_recorder.ip_fragments import FragmentBuffer
from scaraspec_recorder.sources.file_formats import PCAPNG_SECTION, open_content
from scaraspec_recorder.sources.protocol_survey import ProtocolSurvey
from scaraspec_recorder.sources.reassembly import STEP_NS, Reassembler
from scaraspec_recorder.tcp_segment import dissect

_INTERFACE: Final = 1
_TIME_OFFSET: Final = 14
_ENHANCED_PACKET: Final = 6
_PCAPNG_PACKET_BLOCKS: Final = {2, 3, _ENHANCED_PACKET}
_MAX_RECORD_BYTES: Final = 16 << 20  # a greater length is damage
_MAX_ORDINARY_BYTES: Final = 1 << 16
_READ_AHEAD_BYTES: Final = 1 << 16
_LINK_TYPE_MASK: Final = 0xFFFF  # the upper half of pcap's field has the length of a checksum
_MAX_REASONS: Final = 8
_MAX_PORTS: Final = 10
_UNDECODED: Final = "{count} packets in {name} are not decoded"
_ONE_UNDECODED: Final = "1 packet in {name} is not decoded"
_MAX_TIME_NS: Final = (1 << 63) - 1
_READING_ERRORS: Final = (EOFError, OSError, ValueError, OverflowError, struct.error, zlib.error)


@dataclass(slots=True)
class PcapSummary:
    """Summary of a capture and of its unreadable parts.

    Attributes:
        read_bytes: How much of the file has been read.
        packets: Packets in the file.
        segments: TCP segments of the selected connections.
        connections: Number of connections.
        whole: Whether the file is not damaged, and no packet of a connection is truncated.
        notes: One sentence for each kind of missing or unusual data.
        unreliable: Bytes of which two different copies were captured.
        losses: Number of gaps.
    """

    read_bytes: int = 0
    packets: int = 0
    segments: int = 0
    connections: int = 0
    whole: bool = True
    notes: list[str] = field(default_factory=list)
    unreliable: list[WireRange] = field(default_factory=list)
    losses: int = 0

    @property
    def complete(self) -> bool:
        """Whether nothing is missing in what was captured."""
        return self.whole and not self.losses


class PcapCapture:
    """The wire events of a capture file, in the order of time. Each iteration reads the file again.

    Attributes:
        needs_login: Always True: the traffic is TCP.
        session: Always empty: the file does not describe the session.
        path: The file.
        port: TCP port of the controller; None for every connection of this protocol.
        summary: Complete when an iteration has ended.
    """

    needs_login: Final = True
    session: Final[Mapping[str, str]] = MappingProxyType({})

    def __init__(self, path: Path, port: int | None) -> None:
        self.path = path
        self.port = port
        self.summary = PcapSummary()

    def __iter__(self) -> Iterator[WireEvent]:
        """Read the file.

        Raises:
            CaptureError: The file cannot be opened, or is neither pcap nor pcapng.
        """
        if self.port is not None:
            yield from self._read(Reassembler((self.port,)))
            if self.summary.connections:
                return
        survey = ProtocolSurvey()
        for event in self._read(Reassembler(None, on_oriented=survey.set_ends)):
            survey.take(event)
        survey.finish()
        if survey.found and self.port in (None, DEFAULT_PORT):
            yield from self._read(Reassembler(None, between=survey.found))
        else:
            self.summary.connections = 0
        self.summary.notes += _survey_notes(survey, self.port, self.summary.packets)

    def _read(self, reassembler: Reassembler) -> Iterator[WireEvent]:
        """Read the connections that a reassembler selects, into a new summary."""
        self.summary = summary = PcapSummary()
        oddities: Counter[str] = Counter()
        undecoded: Counter[str] = Counter()
        fragments = FragmentBuffer()
        latest_ns = 0
        for record in _records(self.path, summary):
            summary.packets += 1
            try:
                segment = dissect(*record, fragments, number=summary.packets)
            except UndecodedPacket as encapsulation:
                undecoded[f"{encapsulation}"] += 1
                continue
            except UnreadablePacket as reason:
                oddities[UserMessage("not read: {reason}", reason=reason)] += 1
                continue
            if segment is None or not reassembler.follows(segment):
                continue
            summary.segments += 1
            if segment.cut_bytes:
                summary.whole = False
                oddities["truncated by the capture; the rest is a gap"] += 1
            if latest_ns - segment.time_ns > STEP_NS:
                latest_ns = segment.time_ns
            elif segment.time_ns < latest_ns:
                oddities["not in the order of time"] += 1
            latest_ns = max(latest_ns, segment.time_ns)
            for event in reassembler.receive(segment):
                summary.losses += event.is_loss
                yield event
        for event in reassembler.finish():
            summary.losses += event.is_loss
            yield event
        summary.connections = reassembler.connections
        summary.unreliable = reassembler.unreliable
        summary.whole = summary.whole and not reassembler.conflicts
        summary.notes += [
            UserMessage(_UNDECODED if count > 1 else _ONE_UNDECODED, count=count, name=name)
            for name, count in undecoded.most_common(_MAX_REASONS)
        ]
        summary.notes += [
            UserMessage("packets {oddity}: {count}", oddity=oddity, count=count)
            for oddity, count in oddities.most_common(_MAX_REASONS)
        ]
        summary.notes += _reassembly_notes(reassembler, fragments)


def _reassembly_notes(reassembler: Reassembler, fragments: FragmentBuffer) -> Iterator[str]:
    if fragments.incomplete:
        yield UserMessage(
            "IP packets not read, because fragments are missing: {count}",
            count=fragments.incomplete,
        )
    if reassembler.far_segments:
        yield UserMessage(
            "segments far outside the window of their connection, ignored: {count}",
            count=reassembler.far_segments,
        )
    if reassembler.corrupt_segments:
        yield UserMessage(
            "segments with a wrong checksum, used only if no other copy was captured: {count}",
            count=reassembler.corrupt_segments,
        )
    if reassembler.conflicts:
        yield UserMessage(
            "segments that repeat bytes differently, so that these bytes are not reliable: {count}",
            count=reassembler.conflicts,
        )
    if reassembler.clock_steps:
        count = reassembler.clock_steps
        times = UserMessage("once" if count == 1 else "{count} times", count=count)
        yield UserMessage(
            "the capture clock was set {times}: later times are shown as if it had not been, and "
            "durations across it are not judged",
            times=times,
        )


def _survey_notes(survey: ProtocolSurvey, port: int | None, packets: int) -> Iterator[str]:
    """Yield what was found on other ports than the selected one."""
    found = _list_ports(survey.found_ports)
    if port is not None:
        where = UserMessage(
            "no TCP connection on port {port} among {packets} packets", port=port, packets=packets
        )
        if not survey.found:
            yield where
        elif port == DEFAULT_PORT:
            yield UserMessage.joined(
                where, ": connections of this protocol are read ({found})", found=found
            )
        else:
            yield UserMessage.joined(
                where, ": there are connections of this protocol ({found})", found=found
            )
    elif not (survey.found or survey.other_ports):
        yield UserMessage("no TCP connection among {packets} packets", packets=packets)
    if count := survey.other_ports.total():
        template = (
            "1 connection is not of this protocol ({ports}): not judged"
            if count == 1
            else "{count} connections are not of this protocol ({ports}): not judged"
        )
        yield UserMessage(template, count=count, ports=_list_ports(sorted(survey.other_ports)))


def _list_ports(ports: Sequence[int]) -> str:
    """Return ``port 502`` or ``ports 443, 502``; a long list ends with the number of the others."""
    text = ", ".join(map(str, ports[:_MAX_PORTS]))
    others = f" and {len(ports) - _MAX_PORTS} more" if len(ports) > _MAX_PORTS else ""
    return f"{'port' if len(ports) == 1 else 'ports'} {text}{others}"


def read_pcap(path: Path, *, port: int | None = DEFAULT_PORT) -> PcapCapture:
    """Open a capture: pcap or pcapng, plain or compressed with gzip or zstd.

    Args:
        path: The file.
        port: TCP port of the controller; connections without it are ignored. If the file has no
            connection on the default port, and for None, every connection of this protocol is read.

    Returns:
        The events; see `PcapCapture`.

    Raises:
        CaptureError: The file cannot be opened, is neither pcap nor pcapng, or scapy is missing.
    """
    with _reader(path, PcapSummary()):
        return PcapCapture(path, port)


class _Record(NamedTuple):
    """A packet of the file; the fields are arguments of `dissect`."""

    time_ns: int
    link_type: int
    packet: bytes
    wire_bytes: int


class _Source:
    """The file for scapy: it has a position and rejects an invalid length.

    Args:
        file: The content.
        raw: The file, which may be compressed.
        summary: Where to note how much of the file has been read.

    Attributes:
        buffer: Bytes of the file around the position.
        at: Index in `buffer` of the next byte to read.
        first: The first bytes read since the last mark.
        ended: The last read found the end of the file.
    """

    def __init__(self, file: BufferedReader, raw: BinaryIO, summary: PcapSummary) -> None:
        self.buffer, self.at = b"", 0
        self.first = b""
        self.ended = False
        self._file, self._raw, self._summary = file, raw, summary
        self._begin = 0  # position of the buffer in the file

    @property
    def position(self) -> int:
        """Position of the next byte to read."""
        return self._begin + self.at

    def mark(self) -> int:
        """Mark the start of a record; return its position."""
        self.first = b""
        return self.position

    def fill(self, size: int) -> bool:
        """Read ahead, so that this many bytes are in the buffer; return whether they are."""
        while len(self.buffer) - self.at < size:
            try:
                more = self._file.read1(_READ_AHEAD_BYTES)
            except _READING_ERRORS:  # `read` raises it again
                return False
            if not more:
                return False
            self._begin += self.at
            self.buffer, self.at = self.buffer[self.at :] + more, 0
            self._summary.read_bytes = self._raw.tell()
        return True

    def read(self, size: int) -> bytes:
        data = b""
        if size <= _MAX_RECORD_BYTES:
            self.fill(min(size, _MAX_ORDINARY_BYTES))
            data = self.buffer[self.at : self.at + size]
            self.at += len(data)
            if len(data) < size:
                rest = self._file.read(size - len(data))
                data += rest
                self._begin += len(rest)
        self.ended = not data
        self.first = self.first or data
        return data


def _records(path: Path, summary: PcapSummary) -> Iterator[_Record]:
    """Yield the packets of the file in order; note in the summary if the file is damaged."""
    with _reader(path, summary) as (reader, source):
        is_pcapng = hasattr(reader, "interfaces")
        ordinary, read = (
            (_ordinary_pcapng, _read_pcapng) if is_pcapng else (_ordinary_pcap, _read_pcap)
        )
        while True:
            yield from ordinary(reader, source)
            begin = source.mark()
            try:
                record = read(reader, source)
            except _READING_ERRORS:
                if source.position > begin or not source.ended:
                    summary.whole = False
                    summary.notes.append(
                        UserMessage(
                            "the file is damaged at byte {begin}: later packets were not read",
                            begin=begin,
                        )
                    )
                return
            if record is not None:
                yield record


# Most packets are read without scapy, in a quarter of the time.


def _ordinary_pcap(reader: Any, source: _Source) -> Iterator[_Record]:
    """Yield the next packets, up to one that is large or cut off."""
    head, link_type = Struct(f"{reader.endian}4I"), reader.linktype & _LINK_TYPE_MASK
    fraction_ns = 1 if reader.nano else 1000
    while source.fill(head.size):
        seconds, fraction, size, wire_bytes = head.unpack_from(source.buffer, source.at)
        if size > _MAX_ORDINARY_BYTES or not source.fill(head.size + size):
            return
        begin = source.at + head.size
        source.at = begin + size
        packet = source.buffer[begin : source.at]
        yield _Record(seconds * 10**9 + fraction * fraction_ns, link_type, packet, wire_bytes)


def _ordinary_pcapng(reader: Any, source: _Source) -> Iterator[_Record]:
    """Yield the next packets, up to a block that is no enhanced packet block or has options."""
    head, tail = Struct(f"{reader.endian}7I"), Struct(f"{reader.endian}I")
    clocks = [options["tsresol"] for _, _, options in reader.interfaces]
    interfaces = [
        (link_type, int(clock), clock.offset_s * 10**9)
        for clock, (link_type, _, _) in zip(clocks, reader.interfaces, strict=True)
    ]
    while source.fill(head.size):
        kind, size, interface, high, low, captured_bytes, wire_bytes = head.unpack_from(
            source.buffer, source.at
        )
        if (
            kind != _ENHANCED_PACKET
            or interface >= len(interfaces)
            or captured_bytes > _MAX_ORDINARY_BYTES
            or size != head.size + captured_bytes + -captured_bytes % 4 + tail.size
            or not source.fill(size)
            or tail.unpack_from(source.buffer, source.at + size - tail.size) != (size,)
        ):
            return
        begin = source.at + head.size
        source.at += size
        link_type, ticks_per_s, offset_ns = interfaces[interface]
        time_ns = (high << 32 | low) * 10**9 // ticks_per_s + offset_ns
        packet = source.buffer[begin : begin + captured_bytes]
        yield _Record(min(max(time_ns, 0), _MAX_TIME_NS), link_type, packet, wire_bytes)


class _Clock(int):
    """Clock of an interface: ticks per second, and the offset of its times in seconds."""

    offset_s = 0


def _describe(reader: Any, block: bytes, size: int) -> None:
    """Add an interface with data that scapy ignores: time offset, and no snap length for 0."""
    reader._read_block_idb(block, size)  # noqa: SLF001 - see below
    link_type, snap_bytes, options = reader.interfaces.pop()
    clock = _Clock(options["tsresol"])
    offset = reader._read_options(block[8:]).get(_TIME_OFFSET, b"")  # noqa: SLF001 - see below
    if len(offset) == struct.calcsize("q"):
        (clock.offset_s,) = struct.unpack(f"{reader.endian}q", offset)
    options = {**options, "tsresol": clock}
    reader.interfaces.append((link_type, snap_bytes or _MAX_RECORD_BYTES, options))


# scapy documents the two methods below for raw records. Iteration over its readers would truncate
# packets at 65,535 bytes; with segmentation offload packets are larger.


def _read_pcap(reader: Any, _: _Source) -> _Record:
    """Return the next record."""
    packet, meta = reader._read_packet(_MAX_RECORD_BYTES)  # noqa: SLF001 - see above
    if len(packet) < meta.caplen:
        raise EOFError
    time_ns = meta.sec * 10**9 + meta.usec * (1 if reader.nano else 1000)
    return _Record(time_ns, reader.linktype & _LINK_TYPE_MASK, packet, meta.wirelen)


def _read_pcapng(reader: Any, source: _Source) -> _Record | None:
    """Return the packet of the next block, or None; its time is 0 if the block has none."""
    found = reader._read_block(_MAX_RECORD_BYTES)  # noqa: SLF001 - see above
    if found is None:
        if source.first == PCAPNG_SECTION:
            reader.interfaces.clear()  # scapy would continue to count from the last section
        elif struct.unpack(f"{reader.endian}I", source.first)[0] in _PCAPNG_PACKET_BLOCKS:
            raise ValueError("a packet of an interface that is not described")
        return None
    packet, meta = found
    time_ns = 0
    if meta.tshigh is not None:
        ticks = meta.tshigh << 32 | meta.tslow
        time_ns = ticks * 10**9 // meta.tsresol + meta.tsresol.offset_s * 10**9
    time_ns = min(max(time_ns, 0), _MAX_TIME_NS)
    return _Record(time_ns, meta.linktype, packet, meta.wirelen)


@contextmanager
def _reader(path: Path, summary: PcapSummary) -> Iterator[tuple[Any, _Source]]:
    """Open the file with a reader of scapy without warnings; problems become notes."""
    try:
        from scapy.error import Scapy_Exception, log_runtime  # noqa: PLC0415 - an optional extra
        from scapy.utils import RawPcapReader  # noqa: PLC0415 - an optional extra
    except ImportError:
        sentence = "reading pcap files needs scapy: pip install 'scaraspec[pcap]'"
        raise CaptureError(sentence) from None

    def silence(_: logging.LogRecord) -> bool:
        return False

    log_runtime.addFilter(silence)
    try:
        with path.open("rb") as raw:
            source = _Source(open_content(path, raw), raw, summary)
            reader: Any = RawPcapReader(source)  # type: ignore[arg-type]  # it accepts open files, too
            if hasattr(reader, "interfaces"):
                reader.blocktypes[_INTERFACE] = partial(_describe, reader)
            yield reader, source
    except OSError as error:
        raise CaptureError(
            UserMessage(
                "{path} cannot be read: {reason}", path=path, reason=error.strerror or error
            )
        ) from None
    except (EOFError, zlib.error, Scapy_Exception):
        raise TornCaptureError(
            UserMessage("{path} is damaged in its first bytes", path=path)
        ) from None
    finally:
        log_runtime.removeFilter(silence)
