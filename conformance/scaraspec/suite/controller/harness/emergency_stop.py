"""Emergency stop: proved before the first motion of a run, and watched on every connection.

Once the stop was refused, came late or had no effect, nothing more is sent that can start a
motion. What the robot still executes is left to the operator: this is no safety function.
"""

from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from scaraspec.judge.tolerances import STANDSTILL, farthest
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.suite.engine.expectations import CaseInconclusive
from scaraspec.suite.engine.system_under_test import StopFailure
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

LATE_S: Final = 2.0
"""A first reply to a stop that comes later is as good as none."""
EFFECT_S: Final = 0.5
"""How long the arm may take to come to rest after the first reply to a stop."""
MOMENT_S: Final = 0.1
"""For how long a status or a result may be of the moment before."""

_STOP, _RESET = BY_NAME["emergency_stop"].opcode, BY_NAME["reset"].opcode
_STATUS = BY_NAME["get_status"].opcode
_JOINTS, _POSE = BY_NAME["get_joint_angles"].opcode, BY_NAME["get_tool_coordinates"].opcode
_GRIPPER: Final = BY_NAME["set_gripper_center"].opcode
_STARTERS: Final = frozenset(
    BY_NAME[name].opcode
    for name in (
        *("run_program", "simulate_program", "set_tool_coordinates"),
        *("release_joints", "lock_joints", "jog"),
    )
)
_EXECUTES: Final = _STARTERS | {_RESET}
_IDLE, _BUSY = "00", ("01", "02", "03", "04")
_NS: Final = 1e9


class StopFailed(CaseInconclusive):
    """A request was not sent, because the emergency stop might not end what it starts."""


@dataclass(frozen=True, slots=True)
class _Stop:
    """A stop that was sent, and the opcodes of what executed then."""

    sent_ns: int
    during: tuple[int, ...]
    refused_ns: int = 0

    @property
    def names(self) -> str:
        return " and ".join(BY_OPCODE[opcode].name for opcode in self.during)

    def age_s(self, now_ns: int) -> float:
        """How long ago it was refused."""
        return (now_ns - self.refused_ns) / _NS

    def is_old(self, now_ns: int) -> bool:
        """Whether it was refused so long ago that what executes now did so then."""
        return self.age_s(now_ns) > MOMENT_S


class StopMonitor:
    """Watches on all connections whether the emergency stop works.

    Attributes:
        failure: What is wrong with it; None as long as nothing is.
        withheld: Why the last request that was withheld was not sent; set to "" by the runner.
    """

    def __init__(self) -> None:
        self.failure: StopFailure | None = None
        self.withheld = ""
        self._executing: dict[int, int] = {}  # opcode, and when it was accepted
        self._stops: defaultdict[str, deque[_Stop]] = defaultdict(deque)
        self._asked: defaultdict[tuple[str, int], deque[int]] = defaultdict(deque)
        self._refused: _Stop | None = None
        self._rests_from_ns = self._still_from_ns = 0
        self._status = ""
        self._places: dict[int, Sequence[float]] = {}

    # ------------------------------------------------------------------ requests

    def before(self, frame: Frame) -> None:
        """A request is about to be sent.

        Raises:
            StopFailed: It could start a motion that the stop might not end.
        """
        if self.withholds(frame.opcode):
            assert self.failure is not None, "nothing is withheld as long as the stop works"
            self.withheld = f"the emergency stop does not work: {self.failure.message}"
            raise StopFailed(self.withheld)

    def withholds(self, opcode: int) -> bool:
        """Whether a request of this opcode is not sent: a reset only leaves an error state."""
        if self.failure is None:
            return False
        if opcode == _RESET:
            return self._status in {"", _IDLE, *_BUSY}
        return opcode in _STARTERS or opcode not in BY_OPCODE

    def sent(self, connection: str, seen: FrameSeen) -> None:
        """A request was sent."""
        opcode, now_ns = seen.frame.opcode, seen.place.time_ns
        if opcode == _STOP:
            self._stops[connection].append(_Stop(now_ns, tuple(self._executing)))
        elif opcode in (_STATUS, _JOINTS, _POSE):
            self._asked[connection, opcode].append(now_ns)
        elif opcode == _GRIPPER:
            self._places.pop(_POSE, None)  # the pose of the same joints may be another one
        elif opcode not in BY_OPCODE:
            self.forget()  # it may start anything

    def forget(self) -> None:
        """The robot may move for another reason than a request: nothing is known of it."""
        self._executing.clear()
        self._refused = None
        self._rests_from_ns = self._still_from_ns = 0

    # ------------------------------------------------------------------ replies

    def received(self, connection: str, seen: FrameSeen) -> None:
        """A reply or a final result came."""
        opcode, now_ns = seen.frame.opcode, seen.place.time_ns
        if opcode == _STOP and seen.frame.tagged:
            self._still_from_ns = min(self._still_from_ns, now_ns)
        elif opcode == _STOP:
            self._stop_answered(connection, seen)
        elif seen.frame.tagged:
            self._ended(opcode, now_ns)
        elif opcode in _EXECUTES:
            if isinstance(seen.value, Acceptance) and seen.value.accepted:
                self.forget()
                self._executing[opcode] = now_ns
        elif opcode in (_STATUS, _JOINTS, _POSE) and (asked := self._asked[connection, opcode]):
            asked_ns = asked.popleft()
            if seen.value is None:
                return
            if opcode == _STATUS:
                self._status_came(seen.value, asked_ns)
            elif self._still_from_ns and asked_ns > self._still_from_ns:
                self._place_came(opcode, seen.value)

    def _stop_answered(self, connection: str, seen: FrameSeen) -> None:
        pending, now_ns = self._stops[connection], seen.place.time_ns
        stop = pending.popleft() if pending else _Stop(now_ns, ())
        late_s = (now_ns - stop.sent_ns) / _NS
        if stop.during and late_s > LATE_S:
            message = UserMessage(
                "it was answered {late_s:.1f} s after it was sent, while {names} executed",
                late_s=late_s,
                names=stop.names,
            )
            self.fail("4.17/6", message, f"within {LATE_S:g} s", f"{late_s:.1f} s")
        if not isinstance(seen.value, Acceptance):
            return
        if not seen.value.accepted:
            if self._executing and stop.during:
                self._refused = replace(stop, refused_ns=now_ns)
            return
        alone = len(self._executing) <= 1  # a command that was queued may begin (A-4-2)
        self.forget()
        if alone:
            self._rests_from_ns = self._still_from_ns = now_ns + round(EFFECT_S * _NS)
            self._places.clear()

    def _ended(self, opcode: int, now_ns: int) -> None:
        if self._executing.pop(opcode, None) is None or self._refused is None:
            return
        if opcode in self._refused.during and self._refused.is_old(now_ns):
            self._fail_refused(f"0, and its result came {self._refused.age_s(now_ns):.1f} s later")

    def _status_came(self, status: str, asked_ns: int) -> None:
        self._status = status
        if status == _IDLE:
            self._executing = {k: v for k, v in self._executing.items() if v > asked_ns}
        if status not in _BUSY:
            self._refused = None
        elif self._refused is not None:
            if self._refused.is_old(asked_ns):
                self._fail_refused(f"0, and the status is {status}")
        elif self._rests_from_ns and asked_ns > self._rests_from_ns:
            self.fail("4.17/4", "the robot goes on executing after it", _IDLE, status)

    def _place_came(self, opcode: int, place: Sequence[float]) -> None:
        first = self._places.setdefault(opcode, place)
        if farthest(first, place) > STANDSTILL:
            message = "the arm goes on moving after it"
            self.fail("4.17/7", message, f"{tuple(first)}", f"{tuple(place)}")

    def _fail_refused(self, observed: str) -> None:
        assert self._refused is not None, "a stop was refused"
        self.fail("4.17/6", f"it is refused while {self._refused.names} executes", "1", observed)

    def fail(self, requirement: str, message: str, expected: str, observed: str) -> None:
        """The stop does not work; the first failure stays."""
        if self.failure is None:
            self.failure = StopFailure(requirement, message, expected, observed)
