"""Mixed frames: two threads of one side write at once, and one frame is inside of another.

This module decides from bytes alone; it needs no state.
"""

from typing import Final

from scaraspec.protocol.commands import is_known_opcode, parse_frame
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import TAG, Frame

_MAX_BYTES: Final = 600  # more than two frames
_MIN_FRAME_BYTES: Final = 4


def find_mixed(data: bytes, direction: Direction) -> str:
    """Return which two frames are mixed, if `data` is one frame with another one inside.

    Args:
        data: Consecutive bytes of one stream.
        direction: The direction of the stream.

    Returns:
        For example ``get_status and run_program``; empty if the bytes are anything else.
    """
    if len(data) > _MAX_BYTES:
        return ""
    at = data.find(direction.start, 1)
    while at > 0:
        inner = _frame(data[at:], direction)
        if inner:
            end = at + inner.size_bytes
            outer = _frame(data[:at] + data[end:], direction)
            if outer and at < outer.size_bytes == len(data) - inner.size_bytes:
                return " and ".join(sorted((_name(outer), _name(inner))))
        at = data.find(direction.start, at + 1)
    return ""


def _frame(data: bytes, direction: Direction) -> Frame | None:
    """Return the frame at the beginning of some bytes; None without a known opcode or an end."""
    tagged = direction is Direction.C2A and data[1:2] == bytes((TAG,))
    head = 3 + tagged
    if len(data) < _MIN_FRAME_BYTES + tagged or data[0] != direction.start:
        return None
    stop = head + data[head - 1]
    if not is_known_opcode(data[head - 2], tagged) or data[stop : stop + 1] != bytes(
        (direction.end,)
    ):
        return None
    return Frame(direction, data[head - 2], data[head:stop], tagged)


def _name(frame: Frame) -> str:
    parsed = parse_frame(frame)
    return parsed.command.name if parsed else f"0x{frame.opcode:02X}"
