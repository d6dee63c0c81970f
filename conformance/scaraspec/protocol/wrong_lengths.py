"""The lengths that the document's own examples get wrong, and how to know a peer that copied one.

Fourteen frame rows print a length that is not that of the data they print. A frame made after
such a row breaks clause 3 (L98) and is lost; this file tells whoever looks at the lost bytes why.
"""

import re
from dataclasses import dataclass
from typing import Final

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import MAX_DATA_BYTES, Frame


@dataclass(frozen=True, slots=True)
class WrongLength:
    """A frame row of the document whose length is wrong.

    Attributes:
        clause: Where it stands ("4.3").
        line: The line of the row (153).
        declared: The length that the row prints, in bytes.
        frame: The frame that is meant: the row's text with the bars it lost (A-0-1), all counted.
    """

    clause: str
    line: int
    declared: int
    frame: Frame

    @property
    def header(self) -> bytes:
        """The bytes before the data, as a peer sends them that copied the row."""
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
"""The fourteen rows, in the document's order."""

_BY_HEADER: Final = {wrong.header: wrong for wrong in WRONG_LENGTHS}

_TEXT = re.compile(rb"[ -~]{1,%d}" % MAX_DATA_BYTES)


def recognise(direction: Direction, raw: bytes) -> WrongLength | None:
    """The row whose wrong length the sender copied, or None.

    The text may be another than the row's: what is copied is the length. Recognised is a frame
    with the row's opcode and length whose printable text ends somewhere else: at the end byte or,
    behind the length, where `raw` breaks off.

    Args:
        direction: Who sent the bytes.
        raw: Bytes that form no frame, from a start byte on; more may follow them.
    """
    wrong = _BY_HEADER.get(raw[:3]) or _BY_HEADER.get(raw[:4])
    if wrong is None or wrong.frame.direction is not direction:
        return None
    head = len(wrong.header)
    text = _TEXT.match(raw, head)
    if text is None:
        return None
    stop = text.end()
    length_bytes = stop - head
    ends = raw[stop : stop + 1] == bytes((direction.end,)) and length_bytes != wrong.declared
    breaks_off = stop == len(raw) and length_bytes > wrong.declared
    return wrong if ends or breaks_off else None
