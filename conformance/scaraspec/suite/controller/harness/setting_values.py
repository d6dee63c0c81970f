"""Setting values: the settings of a controller, and their values in requests and replies.

Values of one setting can be compared, whether they were set or read. This module does not know
which client has set them.
"""

from datetime import UTC, datetime
from typing import Any, Final, NamedTuple

from scaraspec.protocol.commands import PortValue
from scaraspec.protocol.fields import show
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

CLOCK: Final = UserMessage("clock")
DEFAULT_PROGRAM: Final = "default program"
GRIPPER_CENTRE: Final = "gripper centre"
INITIAL_POSITION: Final = "initial tool position"
OUTPUTS: Final = UserMessage("outputs")
NETWORK: Final = "network"
PROGRAMS: Final = "program list"

QUERIES: Final = {
    CLOCK: "get_time",
    DEFAULT_PROGRAM: "get_default_program",
    GRIPPER_CENTRE: "get_gripper_center",
    INITIAL_POSITION: "get_initial_tool_position",
    OUTPUTS: "get_digital_outputs",
    NETWORK: "get_network",
    PROGRAMS: "list_programs",
}
"""The command that reads each setting."""

SETTERS: Final = {
    CLOCK: "set_time",
    DEFAULT_PROGRAM: "set_default_program",
    GRIPPER_CENTRE: "set_gripper_center",
    INITIAL_POSITION: "set_initial_tool_position",
    OUTPUTS: "set_digital_output",
    NETWORK: "set_network",
}
"""The command that sets it."""

READ_BY: Final = {command: name for name, command in QUERIES.items()}
SET_BY: Final = {command: name for name, command in SETTERS.items()}
DEPENDS_ON: Final = {
    **READ_BY,
    **SET_BY,
    "get_running_program": CLOCK,  # the run time may be derived from it
    "get_tool_coordinates": GRIPPER_CENTRE,  # A-4.23-1
    "set_tool_coordinates": GRIPPER_CENTRE,
    "reset": INITIAL_POSITION,
}
"""The setting on which the replies to a command depend."""

FAR_S: Final = 3600.0
"""A clock that deviates more than this was set to another time, in seconds."""
CLOCK_SLACK_S: Final = 2.0
"""The tolerance of a clock, in seconds (4.5/4)."""
DRIFT: Final = 0.01
_CLOSE: Final = 0.06  # mm or degrees: a controller may round (A-T-5)
_MEANT: Final = 4  # how many numbers of a position have a meaning (L1006)
_NS: Final = 1e9


class Clock(NamedTuple):
    """A time that a clock showed, and when it was read, in seconds since the Unix epoch."""

    shown_s: float
    at_s: float

    def off_s(self, then: "Clock", scale: float) -> float:
        """Return how far a later sample deviates from the expected time, in seconds."""
        return abs(then.shown_s - self.shown_s - scale * (then.at_s - self.at_s))


def clock_of(value: datetime, seen: FrameSeen) -> Clock:
    """Return the clock sample of a frame."""
    return Clock(value.replace(tzinfo=UTC).timestamp(), seen.place.time_ns / _NS)


def reported(seen: FrameSeen) -> Any:
    """Return the value of a setting in a reply; None if it has none. Ignores program lists."""
    if isinstance(seen.value, datetime):
        return clock_of(seen.value, seen)
    if seen.name == QUERIES[DEFAULT_PROGRAM]:
        return seen.value or b""
    return seen.value[:_MEANT] if isinstance(seen.value, tuple) else seen.value


def requested_value(request: FrameSeen, outputs: str | None) -> Any:
    """Return the value that a request sets; None if it is unknown.

    Args:
        request: The request.
        outputs: The earlier outputs; the request may change one of them.
    """
    value = request.value
    if not isinstance(value, PortValue):
        return value if isinstance(value, bytes) else reported(request)
    if outputs is None or not 1 <= value.port <= len(outputs):
        return None
    at = len(outputs) - value.port
    return f"{outputs[:at]}{value.value}{outputs[at + 1 :]}"


def are_same(first: Any, then: Any) -> bool:
    """Whether two values of a setting other than the clock are the same."""
    if isinstance(first, tuple) and isinstance(then, tuple) and len(first) == len(then):
        return all(map(_are_close, first, then))
    return bool(first == then)


def _are_close(first: Any, then: Any) -> bool:
    if isinstance(first, float | int) and isinstance(then, float | int):
        return abs(first - then) <= _CLOSE
    return bool(first == then)


def shown(value: Any) -> str:
    """Return a value as a sentence shows it."""
    match value:
        case Clock(shown_s):
            return f"{datetime.fromtimestamp(shown_s, UTC):%Y-%m-%d %H:%M:%S}"
        case frozenset():
            return UserMessage.listed((UserMessage("that of the start"), *sorted(value)))
        case bytes():
            return show(value) or "none"
        case tuple():
            return "|".join(f"{each:g}" if isinstance(each, float) else f"{each}" for each in value)
    return f"{value}"
