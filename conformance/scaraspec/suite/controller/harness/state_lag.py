"""State lag: how much later than the state the replies of a controller report it (A-4.8-3).

A controller may sample status, pose and inputs in a cyclic task. The lag is measured once. From
then on, a query of a state is sent only when its reply reports the effect of all earlier frames.
This module sends nothing.
"""

from collections.abc import Iterable
from enum import StrEnum
from typing import Final, NamedTuple

from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.traffic.robot_state import RESULT_LAG_NS, STATE_LAG_NS

_NS: Final = 1e9

TOLERATED_S: Final = STATE_LAG_NS / _NS
"""The longest lag, in seconds, that is tolerated."""

LONGEST_S: Final = 0.5
"""A state that is not reported within this time, in seconds, is wrong and not late."""

_CHANGING: Final = {"emergency_stop", "set_gripper_center", "set_digital_output"}
"""Commands that may change more than the status at once; a motion changes it until its result."""
_STATUS: Final = BY_NAME["get_status"].opcode
_SAMPLED: Final = frozenset(
    BY_NAME[name].opcode
    for name in (
        *("get_status", "get_tool_coordinates", "get_joint_angles"),
        *("get_digital_inputs", "get_analog_input"),
    )
)
_MARGIN: Final = 1.5


class State(StrEnum):
    """What a controller may sample."""

    STATUS = "status"
    POSE = "pose"
    INPUTS = "inputs"


class Lag(NamedTuple):
    """The lag of a reported state, in seconds.

    Attributes:
        shown_s: The age of the last reply that did not report the new state, at its request.
        most_s: The age of the first reply that did, at its request.
    """

    shown_s: float
    most_s: float

    @property
    def tolerated(self) -> bool:
        """Whether the lag is tolerated (A-4.8-3)."""
        return self.shown_s <= TOLERATED_S


class StateLag:
    """The lags of a controller, and when its state may have changed last.

    Attributes:
        measured: The longest measured lag of each state that is reported late.
        steps_taken: The lags of the status and the pose were measured.
        inputs_driven: The lag of the inputs was measured, or this was tried.
        results_late: Final results come after the status is idle (A-4-9).
    """

    def __init__(self) -> None:
        self.measured: dict[State, Lag] = {}
        self.steps_taken = self.inputs_driven = self.results_late = False
        self._changed_ns = self._ended_ns = 0

    @property
    def result_s(self) -> float:
        """How much later than the idle status a final result may come, in seconds."""
        return RESULT_LAG_NS / _NS if self.results_late else TOLERATED_S

    @property
    def is_absent(self) -> bool:
        """Whether the steps of the arm have shown no lag."""
        return self.steps_taken and not self.measured

    def note(self, state: State, lag: Lag) -> None:
        """Note a measured lag; the longest one counts."""
        self.measured[state] = max(lag, self.measured.get(state, lag))

    def frame_seen(self, frame: Frame, time_ns: int) -> None:
        """Note a frame of either side, which may change the state or report a change."""
        command = BY_OPCODE.get(frame.opcode)
        if frame.tagged or command is None or command.name in _CHANGING:
            self.changed(time_ns)
        elif command.hazard is not Hazard.READ_ONLY:
            self._changed_ns = time_ns

    def changed(self, time_ns: int) -> None:
        """Note that the whole state may have changed at this time."""
        self._changed_ns = self._ended_ns = time_ns

    def wait_s(self, frames: Iterable[Frame], now_ns: int) -> float:
        """Return how long to wait, in seconds, before these requests report the state."""
        if not self.measured:
            return 0.0
        opcodes = {frame.opcode for frame in frames}
        since_ns = self._changed_ns if _STATUS in opcodes else self._ended_ns
        lag_s = max(TOLERATED_S, *(lag.most_s for lag in self.measured.values()))
        wait_s = _MARGIN * lag_s - (now_ns - since_ns) / _NS
        return max(0.0, wait_s) if opcodes & _SAMPLED else 0.0
