"""Results: what operations return where the table's own types do not suit a caller of a client.

The rest (`Network`, `Point`, `Pose`, `JointValues`) is returned as the table has it.
"""

from enum import Enum
from typing import NamedTuple

from scaraspec.client.replies import lookup_code
from scaraspec.protocol.errors import Joint, Kind


class State(Enum):
    """The three states of 4.8 (L214)."""

    IDLE = "idle"
    RUNNING = "running"
    ERROR = "error"


_STATES = {Kind.IDLE: State.IDLE, Kind.RUNNING: State.RUNNING}


class Status(NamedTuple):
    """What 0x09 reports: the state, and the code of table 8-1 that says so with its meaning.

    Whatever is neither idle nor running is an error, unknown codes too (4.8/11).
    """

    state: State
    code: str
    meaning: str
    joints: tuple[Joint, ...] = ()

    @classmethod
    def of(cls, text: str) -> "Status":
        """The status behind two characters."""
        code = lookup_code(text)
        return cls(_STATES.get(code.kind, State.ERROR), code.text, code.meaning, code.joints)


class RunningProgram(NamedTuple):
    """The running program's name, and for how many seconds it has run (L226)."""

    name: str
    run_time_s: int
