"""The two ROS 2 messages that viewers draw unasked: joint states, and the robot's description.

Law: their definitions and their CDR bytes (little endian, XCDR1), nothing of what is in them.
"""

import struct
from collections.abc import Sequence
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


class _Cdr:
    """Bytes in the making: each number stands at a multiple of its own size."""

    def __init__(self) -> None:
        self._data = bytearray()

    def put(self, form: str, *values: float) -> None:
        size = struct.calcsize(f"<{form}")
        self._data += bytes(-len(self._data) % size)
        self._data += struct.pack(f"<{len(values)}{form}", *values)

    def text(self, value: str) -> None:
        data = value.encode() + b"\0"
        self.put("I", len(data))
        self._data += data

    def doubles(self, values: Sequence[float]) -> None:
        self.put("I", len(values))
        if values:
            self.put("d", *values)

    def end(self) -> bytes:
        return _LITTLE_ENDIAN + bytes(self._data)


def string(text: str) -> bytes:
    """A std_msgs/String."""
    cdr = _Cdr()
    cdr.text(text)
    return cdr.end()


def joint_state(
    time_ns: int,
    names: Sequence[str],
    position: Sequence[float],
    velocity: Sequence[float],
    effort: Sequence[float],
) -> bytes:
    """A sensor_msgs/JointState, in radians and metres and their rates per second."""
    cdr = _Cdr()
    cdr.put("i", min(time_ns // _NS, _LAST_SECOND))
    cdr.put("I", time_ns % _NS)
    cdr.text("")
    cdr.put("I", len(names))
    for name in names:
        cdr.text(name)
    for values in (position, velocity, effort):
        cdr.doubles(values)
    return cdr.end()
