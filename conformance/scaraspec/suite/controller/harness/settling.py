"""Settling: how long a robot still reports that it executes after a stop or a reset (A-4-9).

It is measured after the first results. If the robot settles, later requests wait for its end.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.suite.engine.expectations import NoReply
from scaraspec.traffic.robot_state import SETTLE_NS, SETTLES, STATE_LAG_NS
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection

_NS: Final = 1e9

_LONGEST_S: Final = SETTLE_NS / _NS
_BUSY: Final = ("01", "02", "03", "04")
_PLACES: Final = ("get_joint_angles", "get_tool_coordinates")
_POLL_S: Final = 0.05
_OPCODES: Final = frozenset(BY_NAME[name].opcode for name in SETTLES)
_WAITING: Final = frozenset(
    command.opcode
    for command in BY_OPCODE.values()
    if command.name in ("get_status", "shutdown")
    or (command.two_stage and command.name != "emergency_stop")
)
"""The requests whose replies depend on whether the robot executes something."""


class Settling:
    """How long a robot settles, and when a stop or a reset has ended last.

    Attributes:
        longest_s: The longest measured time in seconds; 0 if the robot does not settle.
    """

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._tried: set[str] = set()
        self._ended_ns = 0

    def frame_seen(self, frame: Frame, time_ns: int) -> None:
        """Note a received frame, which may be the result of a stop or a reset."""
        if frame.tagged and frame.opcode in _OPCODES:
            self._ended_ns = time_ns

    def wait_s(self, frames: Iterable[Frame], now_ns: int) -> float:
        """Return how long to wait, in seconds, before these requests are sent."""
        if not self.longest_s or not any(frame.opcode in _WAITING for frame in frames):
            return 0.0
        return max(0.0, _LONGEST_S + _POLL_S - self._age_s(now_ns))

    def measure(self, line: "OutgoingConnection", command: str) -> None:
        """Measure once after the result of this command how long the robot settles.

        A robot whose arm moves does not settle. The monitor of the emergency stop sees it, too.
        """
        if command not in SETTLES or command in self._tried:
            return
        self._tried.add(command)
        queries = [name for name in _PLACES if name not in line.subject.ics.unsupported]
        busy_s, places = 0.0, list[Sequence[float]]()
        with suppress(NoReply):
            while line.ask("get_status").value in _BUSY:
                busy_s = self._age_s(line.subject.now_ns)
                place = line.ask(queries[0]).value if queries else None
                if place is not None and busy_s * _NS > STATE_LAG_NS:
                    places.append(place)
                if busy_s > _LONGEST_S:
                    return
                line.wait(_POLL_S)
            still = all(max_deviation(places[0], place) <= STANDSTILL for place in places)
            if busy_s * _NS > STATE_LAG_NS and still:
                self._note(line, command)

    def _age_s(self, now_ns: int) -> float:
        return (now_ns - self._ended_ns) / _NS

    def _note(self, line: "OutgoingConnection", command: str) -> None:
        age_s = self._age_s(line.subject.now_ns)
        if not self.longest_s:
            text = "for {age_s:.1f} s after {command} the robot reports that it executes (A-4-9)"
            line.subject.notify(UserMessage(text, command=command, age_s=age_s))
        self.longest_s = max(self.longest_s, age_s)
