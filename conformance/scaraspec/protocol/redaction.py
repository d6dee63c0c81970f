"""Secrets: where passwords stand in frames, and the same bytes without them.

Which commands hold passwords is said by the table (`Command.secret`), how they are hidden only
here. What is hidden keeps its length and its bars, so that it still reads as the same frames. In
doubt, in bytes that are no frame, too much is hidden and never too little.
"""

import re
from typing import Final

from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame

_SECRET: Final = bytes(command.opcode for command in COMMANDS if command.secret)
_HEAD: Final = re.compile(
    b"[%c%c][%b].?" % (A2C.start, C2A.start, re.escape(_SECRET)),
    re.DOTALL,
)


def is_secret(frame: Frame) -> bool:
    """Whether a frame's data may hold a password.

    A reply of one byte cannot: it is the flag of L114 and L136. A longer one is a fault, and may
    repeat what was asked.
    """
    return frame.opcode in _SECRET and (frame.direction is A2C or len(frame.data) > 1)


def mask(data: bytes) -> bytes:
    """Data of the same length with its bars, and of nothing else a trace."""
    return b"|".join(b"*" * len(part) for part in data.split(b"|"))


def mask_loose(data: bytes) -> bytes:
    """Hide what follows anything that looks like the head of a secret frame, to the end.

    For bytes that are no frame, such as a login with a wrong length.
    """
    begin = loose_secret(data)
    return data[:begin] + mask(data[begin:])


def loose_secret(data: bytes) -> int:
    """Where what may be secret begins in bytes that are no frame; their end where nothing is."""
    found = _HEAD.search(data)
    return found.end() if found else len(data)
