"""The result types of the client's operations that differ from the command table.

`Network`, `Point`, `Pose` and `JointValues` are the types of the command table.
"""

from enum import Enum
from typing import NamedTuple

from scaraspec.client.replies import lookup_code
from scaraspec.protocol.errors import Joint, Kind


class State(Enum):
    """The states of the robot (4.8, L214)."""

    IDLE = "idle"
    RUNNING = "running"
    ERROR = "error"


_STATES = {Kind.IDLE: State.IDLE, Kind.RUNNING: State.RUNNING}


class Status(NamedTuple):
    """The status that 0x09 reports.

    Attributes:
        state: Idle, running or error. Every code that is not idle or running is an error,
            including unknown codes (4.8/11).
        code: The code of table 8-1.
        meaning: The meaning of the code.
        joints: The faulty joints, for the codes that name joints.
    """

    state: State
    code: str
    meaning: str
    joints: tuple[Joint, ...] = ()

    @classmethod
    def of(cls, text: str) -> "Status":
        """Return the status for a code of two characters."""
        code = lookup_code(text)
        return cls(_STATES.get(code.kind, State.ERROR), code.text, code.meaning, code.joints)


class RunningProgram(NamedTuple):
    """The name of the running program and its run time in seconds (L226)."""

    name: str
    run_time_s: int
