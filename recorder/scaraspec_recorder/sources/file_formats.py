"""Decompresses packet captures, and names files of other formats with the command to convert them.

The first bytes of the content decide. Nothing here reads packets.
"""

import gzip
import io
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

import zstandard

from scaraspec.operating_system import join_command
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC

PCAPNG_SECTION: Final = b"\x0a\x0d\x0d\x0a"
_PCAP_MAGICS: Final = {
    PCAPNG_SECTION,
    b"\xa1\xb2\xc3\xd4",  # big endian, microseconds
    b"\xd4\xc3\xb2\xa1",
    b"\xa1\xb2\x3c\x4d",  # big endian, nanoseconds
    b"\x4d\x3c\xb2\xa1",
}
_GZIP: Final = b"\x1f\x8b"
_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_PACKET_FORMATS: Final = {
    b"\xa1\xb2\xcd\x34": "a modified pcap file",
    b"\x34\xcd\xb2\xa1": "a modified pcap file",
    b"snoop\x00\x00\x00": "a snoop file",
    b"RTSS": "a Network Monitor file",
    b"GMBU": "a Network Monitor file",
}
_COMPRESSED: Final = {
    b"\xfd7zXZ\x00": "xz",
    b"BZh": "bzip2",
    b"\x04\x22\x4d\x18": "lz4",
}
_HEAD_BYTES: Final = 16
_ERF_TYPES: Final = range(1, 49)
_ERF_SECONDS: Final = range(946_684_800, 1 << 32)  # from the year 2000
_PACKED_BYTES: Final = 512  # read at a time: they may be 16 MiB after decompression


def open_content(path: Path, raw: io.BufferedReader) -> io.BufferedReader:
    """Return the content of a pcap or pcapng file, decompressed.

    Args:
        path: The file, for messages.
        raw: The open file.

    Raises:
        CaptureError: The file has another format.
        EOFError: The compressed content is cut off.
        OSError: The compressed content is damaged.
    """
    file: Any = raw
    magic = raw.peek(_HEAD_BYTES)[:_HEAD_BYTES]
    if magic.startswith(_GZIP):
        file = gzip.GzipFile(fileobj=raw)
    elif magic.startswith(_ZSTD):
        file = io.BufferedReader(_ZstdFile(raw))
    head = file.peek(_HEAD_BYTES)[:_HEAD_BYTES]
    if head[:4] not in _PCAP_MAGICS:
        raise CaptureError(_describe(path, head, "gzip" if magic.startswith(_GZIP) else "zstd"))
    return cast("io.BufferedReader", file)


def _describe(path: Path, head: bytes, decompressor: str) -> str:
    """Return what a file is, and how to convert it."""
    quoted = join_command([f"{path}"])
    packets = [name for magic, name in _PACKET_FORMATS.items() if head.startswith(magic)]
    packed = [tool for magic, tool in _COMPRESSED.items() if head.startswith(magic)]
    if head.startswith(MAGIC):
        packed = [decompressor]
    if packed:
        return UserMessage(
            "{path} is compressed: decompress it with {tool} -dk {quoted}",
            path=path,
            tool=packed[0],
            quoted=quoted,
        )
    if packets or _is_erf(head):
        return UserMessage(
            "{path} is {name}: convert it with editcap -F pcapng {quoted} {target}",
            path=path,
            name=packets[0] if packets else "an ERF file",
            quoted=quoted,
            target=join_command([f"{path.with_suffix('.pcapng')}"]),
        )
    return UserMessage("{path} is not a capture: neither MCAP, pcap nor pcapng", path=path)


def _is_erf(head: bytes) -> bool:
    """Whether a file begins like an ERF record, which has no magic number."""
    if len(head) < _HEAD_BYTES:
        return False
    seconds, kind = int.from_bytes(head[4:8], "little"), head[8] & 0x7F
    record_bytes = int.from_bytes(head[10:12], "big")
    return seconds in _ERF_SECONDS and kind in _ERF_TYPES and record_bytes > _HEAD_BYTES


class _ZstdFile(io.RawIOBase):
    """The content of a zstd file; a file that is cut off raises EOFError."""

    def __init__(self, packed: BinaryIO) -> None:
        self._packed, self._data = packed, b""
        self._frame = zstandard.ZstdDecompressor().decompressobj()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self._data:
            packed = self._packed.read(_PACKED_BYTES)
            if not packed:
                if not self._frame.eof:
                    raise EOFError
                return 0
            while packed:
                if self._frame.eof:
                    self._frame = zstandard.ZstdDecompressor().decompressobj()
                self._data += self._decompress(packed)
                packed = self._frame.unused_data if self._frame.eof else b""
        data, self._data = self._data[: len(buffer)], self._data[len(buffer) :]
        buffer[: len(data)] = data
        return len(data)

    def _decompress(self, packed: bytes) -> bytes:
        try:
            return self._frame.decompress(packed)
        except zstandard.ZstdError as error:
            raise OSError(f"{error}") from None
