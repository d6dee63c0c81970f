"""Wrong lengths in the examples of the document, and detection of peers that copied one.

Fourteen frame rows print a length that differs from the length of the printed data. A frame that
copies such a row violates clause 3 (L98), so a framer skips it. This module explains such bytes.
"""

import re
from dataclasses import dataclass
from typing import Final

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import MAX_DATA_BYTES, Frame


@dataclass(frozen=True, slots=True)
class WrongLength:
    """A frame row of the document with a wrong length.

    Attributes:
        clause: The clause that contains the row, for example "4.3".
        line: The line of the row, for example 153.
        declared: The length that the row prints, in bytes.
        frame: The intended frame: the text of the row with its lost bars (A-0-1) and the correct
            length.
    """

    clause: str
    line: int
    declared: int
    frame: Frame

    @property
    def header(self) -> bytes:
        """The bytes before the data, as sent by a peer that copied the row."""
        before_data = self.frame.encode()[: -len(self.frame.data) - 1]
        return before_data[:-1] + bytes((self.declared,))


_POSE: Final = b"200|300|324|34.6|34.5|0"
_ADDRESSES: Final = b"192.168.1.2|255.255.255.0|192.168.1.1"

WRONG_LENGTHS: Final = (
    WrongLength("4.3", 153, 36, Frame(C2A, 0x04, _ADDRESSES)),
    WrongLength("4.4", 160, 36, Frame(A2C, 0x05, _ADDRESSES)),
    WrongLength("4.9", 232, 22, Frame(C2A, 0x0A, b"1|myprogrm1.txt|00011230")),
    WrongLength("4.10", 249, 26, Frame(C2A, 0x0B, b"0|pro1.rob|pro2.rob|pro3.rob")),
    WrongLength("4.18", 417, 4, Frame(C2A, 0x33, b"00|11", tagged=True)),
    WrongLength("4.21", 450, 25, Frame(A2C, 0x36, _POSE)),
    WrongLength("4.22", 467, 25, Frame(C2A, 0x37, _POSE)),
    WrongLength("4.23", 479, 25, Frame(C2A, 0x38, _POSE)),
    WrongLength("4.24", 486, 25, Frame(A2C, 0x39, b"60|" + _POSE)),
    WrongLength("4.24", 495, 1, Frame(C2A, 0x39, b"0|12")),
    WrongLength("4.27", 594, 17, Frame(C2A, 0x3C, b"20.4|30.5|38.0|0")),
    WrongLength("4.31", 649, 3, Frame(C2A, 0x42, b"1|10000000")),
    WrongLength("4.34", 687, 3, Frame(C2A, 0x49, b"1|1001000011110000")),
    WrongLength("5.3", 770, 8, Frame(A2C, 0x54, b"file2.txt")),
)
"""The fourteen rows, in the order of the document."""

_BY_HEADER: Final = {wrong.header: wrong for wrong in WRONG_LENGTHS}

_TEXT = re.compile(rb"[ -~]{1,%d}" % MAX_DATA_BYTES)


def find_copied_length(direction: Direction, raw: bytes) -> WrongLength | None:
    """Return the row whose wrong length the sender copied, or None.

    The text may differ from that of the row: only the length is copied. A match has the opcode and
    the length of a row, and its printable text has another length: the text ends at an end byte,
    or it is longer than the printed length and `raw` ends with it.

    Args:
        direction: The sender of the bytes.
        raw: Bytes that are not a frame, beginning with a start byte; more bytes may follow.
    """
    wrong = _BY_HEADER.get(raw[:3]) or _BY_HEADER.get(raw[:4])
    if wrong is None or wrong.frame.direction is not direction:
        return None
    header_bytes = len(wrong.header)
    text = _TEXT.match(raw, header_bytes)
    if text is None:
        return None
    stop = text.end()
    length_bytes = stop - header_bytes
    ends = raw[stop : stop + 1] == bytes((direction.end,)) and length_bytes != wrong.declared
    cut_off = stop == len(raw) and length_bytes > wrong.declared
    return wrong if ends or cut_off else None
