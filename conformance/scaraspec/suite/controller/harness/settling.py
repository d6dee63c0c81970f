"""Settling: how long a robot is still busy after a final result (A-4-9).

The status is measured after the first result of each command. A refusal as busy right after a
result shows it, too. If the robot settles, later requests wait for its end.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.frames import Frame
from scaraspec.suite.engine.expectations import NoReply
from scaraspec.traffic.robot_state import SETTLE_NS, SETTLES, STATE_LAG_NS
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection

_NS: Final = 1e9

_LONGEST_S: Final = SETTLE_NS / _NS
_LAG_S: Final = STATE_LAG_NS / _NS
_PLACES: Final = ("get_joint_angles", "get_tool_coordinates")
_POLL_S: Final = 0.05
_STARTS: Final = frozenset(
    command.opcode
    for command in BY_OPCODE.values()
    if command.two_stage and command.name != "emergency_stop"
)
_OPCODES: Final = frozenset(BY_NAME[name].opcode for name in SETTLES)
_WITHOUT_STATUS: Final = ("release_joints", "lock_joints")  # A-4-5
_WAITING: Final = _STARTS | {BY_NAME[name].opcode for name in ("get_status", "shutdown")}
"""The requests whose replies depend on whether the robot executes something."""


class Settling:
    """How long a robot settles, and when a command has ended last.

    Attributes:
        longest_s: The longest measured time after a stop or a reset, in seconds; 0 without one.
        after_all: It also settles for a moment after other commands.
    """

    def __init__(self) -> None:
        self.longest_s = 0.0
        self.after_all = False
        self._tried: set[str] = set()
        self._ended, self._ended_ns = 0, 0

    @property
    def is_known(self) -> bool:
        """Whether the robot settles."""
        return self.after_all or bool(self.longest_s)

    def frame_seen(self, frame: Frame, time_ns: int) -> None:
        """Note a received frame, which may be a final result."""
        if frame.tagged:
            self._ended, self._ended_ns = frame.opcode, time_ns

    def wait_s(self, frames: Iterable[Frame], now_ns: int) -> float:
        """Return how long to wait, in seconds, before these requests are sent."""
        if not any(frame.opcode in _WAITING for frame in frames):
            return 0.0
        settles_s = _LONGEST_S if self.longest_s and self._ended in _OPCODES else 0.0
        longest_s = max(settles_s, _LAG_S if self.after_all else 0.0)
        return max(0.0, longest_s + _POLL_S - self._age_s(now_ns)) if longest_s else 0.0

    def may_refuse(self, opcode: int, now_ns: int) -> bool:
        """Whether a request that is sent now may be refused because the robot settles."""
        return not self.after_all and opcode in _STARTS and self._age_s(now_ns) <= _LAG_S

    def note_refusal(self, line: "OutgoingConnection") -> None:
        """Note that a request was refused as busy which `may_refuse` names."""
        if not self.is_known:
            line.subject.notify("right after a final result the robot refuses as busy (A-4-9)")
        self.after_all = True

    def measure(self, line: "OutgoingConnection", command: str) -> None:
        """Measure once after the result of this command how long the robot settles.

        A robot whose arm moves does not settle. The monitor of the emergency stop sees it, too.
        """
        if (
            command in _WITHOUT_STATUS
            or command in self._tried
            or line.subject.guard.stop.executing
        ):
            return
        self._tried.add(command)
        queries = [name for name in _PLACES if name not in line.subject.ics.unsupported]
        busy_s, places = 0.0, list[Sequence[float]]()
        with suppress(NoReply):
            while line.ask("get_status").value in BUSY:
                busy_s = self._age_s(line.subject.now_ns)
                place = line.ask(queries[0]).value if queries else None
                if place is not None and busy_s * _NS > STATE_LAG_NS:
                    places.append(place)
                if busy_s > _LONGEST_S:
                    return
                line.wait(_POLL_S)
            still = all(max_deviation(places[0], place) <= STANDSTILL for place in places)
            longest_s = _LONGEST_S if command in SETTLES else _LAG_S
            if 0 < busy_s <= longest_s and still and not line.subject.lag.measured:
                self._note(line, command)

    def _age_s(self, now_ns: int) -> float:
        return (now_ns - self._ended_ns) / _NS

    def _note(self, line: "OutgoingConnection", command: str) -> None:
        age_s = self._age_s(line.subject.now_ns)
        if not self.is_known:
            text = "for {age_s:.1f} s after {command} the robot reports that it executes (A-4-9)"
            line.subject.notify(UserMessage(text, command=command, age_s=age_s))
        if command in SETTLES:
            self.longest_s = max(self.longest_s, age_s)
        else:
            self.after_all = True
