"""The two ROS 2 messages that viewers draw by default: joint states and robot description.

Belongs here: message definitions and CDR encoding (little endian, XCDR1).
"""

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

ENCODING: Final = "cdr"
SCHEMA_ENCODING: Final = "ros2msg"

JOINT_STATE: Final = "sensor_msgs/msg/JointState"
STRING: Final = "std_msgs/msg/String"

_RULE: Final = "=" * 80
DEFINITIONS: Final = {
    JOINT_STATE: f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
""",
    STRING: "string data\n",
}
"""The definition of each message by its name."""

_LITTLE_ENDIAN: Final = b"\0\1\0\0"
_NS: Final = 1_000_000_000
_LAST_SECOND: Final = (1 << 31) - 1
_STAMP: Final = struct.Struct("<iI")


class _Cdr:
    """CDR encoder: each number is aligned to its size."""

    def __init__(self, begun: bytes = b"") -> None:
        self.data = bytearray(begun)

    def put(self, form: str, *values: float) -> None:
        size = struct.calcsize(f"<{form}")
        self.data += bytes(-len(self.data) % size)
        self.data += struct.pack(f"<{len(values)}{form}", *values)

    def text(self, value: str) -> None:
        data = value.encode() + b"\0"
        self.put("I", len(data))
        self.data += data

    def doubles(self, values: Sequence[float]) -> None:
        self.put("I", len(values))
        if values:
            self.put("d", *values)

    def end(self) -> bytes:
        return _LITTLE_ENDIAN + self.data


def string(text: str) -> bytes:
    """Encode a std_msgs/String."""
    cdr = _Cdr()
    cdr.text(text)
    return cdr.end()


def joint_state(
    time_ns: int,
    names: tuple[str, ...],
    position: Sequence[float],
    velocity: Sequence[float],
    effort: Sequence[float],
) -> bytes:
    """Encode a sensor_msgs/JointState, in radians and metres, and the rates per second."""
    stamp = _STAMP.pack(min(time_ns // _NS, _LAST_SECOND), time_ns % _NS)
    cdr = _Cdr(stamp + _named(names))
    for values in (position, velocity, effort):
        cdr.doubles(values)
    return cdr.end()


@lru_cache
def _named(names: tuple[str, ...]) -> bytes:
    """Return the bytes between the 8-byte stamp and the numbers, the same for each state."""
    cdr = _Cdr()
    cdr.text("")
    cdr.put("I", len(names))
    for name in names:
        cdr.text(name)
    return bytes(cdr.data)
