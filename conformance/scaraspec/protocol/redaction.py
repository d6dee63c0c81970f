"""Redaction: find passwords in frames and mask them.

The command table states which commands carry passwords (`Command.secret`). Masked data keep their
length and their bars, so that the frames keep their structure. In bytes that are not a frame, the
functions mask too much rather than too little.
"""

import re
from typing import Final

from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame

_SECRET_OPCODES: Final = bytes(command.opcode for command in COMMANDS if command.secret)
_HEADER: Final = re.compile(
    b"[%c%c][%b].?" % (A2C.start, C2A.start, re.escape(_SECRET_OPCODES)),
    re.DOTALL,
)


def is_secret(frame: Frame) -> bool:
    """Return whether a frame's data may contain a password.

    A reply of one byte contains none: it is the flag of L114 and L136. A longer reply violates
    the protocol and may repeat the data of the request.
    """
    return frame.opcode in _SECRET_OPCODES and (frame.direction is A2C or len(frame.data) > 1)


def mask(data: bytes) -> bytes:
    """Return data of the same length in which every byte except the bars is ``*``."""
    return b"|".join(b"*" * len(part) for part in data.split(b"|"))


def is_masked(data: bytes) -> bool:
    """Return whether data may be masked: different passwords of one length look the same."""
    return data == mask(data)


def mask_unframed(data: bytes) -> bytes:
    """Mask everything after the first bytes that look like the header of a secret frame.

    Use this for bytes that are not a frame, such as a login with a wrong length.
    """
    offset = secret_offset(data)
    return data[:offset] + mask(data[offset:])


def secret_offset(data: bytes) -> int:
    """Return the offset of the first byte that may be secret in bytes that are not a frame.

    The offset is the length of the data if no byte may be secret.
    """
    match = _HEADER.search(data)
    return match.end() if match else len(data)
