"""Emergency stop monitor: checks on every connection of a run that the emergency stop works.

`two_stage.stop_proof` tries the stop before the first motion of a run. After a stop that was
refused, answered late or without effect, the suite sends no request that can start a motion. The
suite cannot stop what the robot still executes: the operator must do that. This is not a safety
function.
"""

from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.suite.controller.harness.state_lag import TOLERATED_S
from scaraspec.suite.engine.expectations import CaseInconclusive
from scaraspec.suite.engine.system_under_test import StopFailure
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.robot_state import SETTLE_NS
from scaraspec.user_message import UserMessage

LATE_S: Final = 2.0
"""A first reply to an emergency stop must come within this time."""
EFFECT_S: Final = 0.5
"""The time that the arm may take to come to rest after the first reply to a stop."""
MOMENT_S: Final = 0.1
"""A status or a result within this time may describe the state before it."""

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
_IDLE = "00"
_NS: Final = 1e9


class StopFailed(CaseInconclusive):
    """A request was not sent, because the emergency stop may not end the motion it starts."""


@dataclass(frozen=True, slots=True)
class _Stop:
    """A stop that was sent, and the opcodes of the commands that executed at that time."""

    sent_ns: int
    during: tuple[int, ...]
    refused_ns: int = 0

    @property
    def names(self) -> str:
        return " and ".join(BY_OPCODE[opcode].name for opcode in self.during)

    def age_s(self, now_ns: int) -> float:
        """The time in seconds since the stop was refused."""
        return (now_ns - self.refused_ns) / _NS

    def is_old(self, now_ns: int) -> bool:
        """Whether the stop was refused more than `MOMENT_S` ago.

        If a command of `during` still executes then, it also executed at the refusal.
        """
        return self.age_s(now_ns) > MOMENT_S


class StopMonitor:
    """Checks on all connections whether the emergency stop works.

    Attributes:
        failure: The first failure of the emergency stop; None while it works.
        withheld: Why the last withheld request was not sent; the case runner resets it to "".
        transferring: Whether a file transfer may be active: the status may then be that of a busy
            robot (A-5-17). The connections set it.
    """

    def __init__(self) -> None:
        self.failure: StopFailure | None = None
        self.withheld = ""
        self.transferring = False
        self._executing: dict[int, int] = {}  # opcode, and when it was accepted
        self._stops: defaultdict[str, deque[_Stop]] = defaultdict(deque)
        self._requests_ns: defaultdict[tuple[str, int], deque[int]] = defaultdict(deque)
        self._refused: _Stop | None = None
        self._rests_from_ns = self._still_from_ns = 0
        self._status = ""
        self._places: dict[int, Sequence[float]] = {}

    # ------------------------------------------------------------------ requests

    def before(self, frame: Frame) -> None:
        """Check a request before it is sent.

        Raises:
            StopFailed: The request can start a motion, and the emergency stop does not work.
        """
        if self.withholds(frame.opcode):
            assert self.failure is not None, "no request is withheld while the stop works"
            self.withheld = UserMessage(
                "the emergency stop does not work: {message}", message=self.failure.message
            )
            raise StopFailed(self.withheld)

    def withholds(self, opcode: int) -> bool:
        """Whether a request of this opcode must not be sent.

        A reset is sent only to leave an error state.
        """
        if self.failure is None:
            return False
        if opcode == _RESET:
            return self._status in {"", _IDLE, *BUSY}
        return opcode in _STARTERS or opcode not in BY_OPCODE

    def sent(self, connection: str, seen: FrameSeen) -> None:
        """Record a request that was sent."""
        opcode, now_ns = seen.frame.opcode, seen.place.time_ns
        if opcode == _STOP:
            self._stops[connection].append(_Stop(now_ns, tuple(self._executing)))
        elif opcode in (_STATUS, _JOINTS, _POSE):
            self._requests_ns[connection, opcode].append(now_ns)
        elif opcode == _GRIPPER:
            self._places.pop(_POSE, None)  # the same joints may now give another pose
        elif opcode not in BY_OPCODE:
            self.forget()  # an undefined opcode may start any motion

    def forget(self) -> None:
        """Discard the known state: a hook or an unknown request may have started a motion."""
        self._executing.clear()
        self._refused = None
        self._rests_from_ns = self._still_from_ns = 0

    # ------------------------------------------------------------------ replies

    def received(self, connection: str, seen: FrameSeen) -> None:
        """Record a reply or a final result."""
        opcode, now_ns = seen.frame.opcode, seen.place.time_ns
        if opcode == _STOP and seen.frame.tagged:
            self._stop_ended(now_ns)
        elif opcode == _STOP:
            self._stop_answered(connection, seen)
        elif seen.frame.tagged:
            self._ended(opcode, now_ns)
        elif opcode in _EXECUTES:
            if isinstance(seen.value, Acceptance) and seen.value.accepted:
                self.forget()
                self._executing[opcode] = now_ns
        elif opcode in (_STATUS, _JOINTS, _POSE) and (
            requests_ns := self._requests_ns[connection, opcode]
        ):
            requested_ns = requests_ns.popleft()
            if seen.value is None:
                return
            if opcode == _STATUS:
                self._status_came(seen.value, requested_ns)
            elif self._still_from_ns and requested_ns > self._still_from_ns:
                self._place_came(opcode, seen.value)

    def _stop_answered(self, connection: str, seen: FrameSeen) -> None:
        pending, now_ns = self._stops[connection], seen.place.time_ns
        stop = pending.popleft() if pending else _Stop(now_ns, ())
        late_s = (now_ns - stop.sent_ns) / _NS
        if stop.during and late_s > LATE_S:
            message = UserMessage(
                "the controller answered it only after {late_s:.1f} s, while {names} executed",
                late_s=late_s,
                names=stop.names,
            )
            self.fail(
                "4.17/6",
                message,
                UserMessage("within {limit_s} s", limit_s=f"{LATE_S:g}"),
                f"{late_s:.1f} s",
            )
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

    @property
    def executing(self) -> bool:
        """Whether an accepted command may execute: no status and no result has shown its end."""
        return bool(self._executing)

    def _stop_ended(self, now_ns: int) -> None:
        self._still_from_ns = min(self._still_from_ns, now_ns + round(TOLERATED_S * _NS))
        if self._rests_from_ns:
            self._rests_from_ns = max(self._rests_from_ns, now_ns + SETTLE_NS)

    def _ended(self, opcode: int, now_ns: int) -> None:
        if self._executing.pop(opcode, None) is None or self._refused is None:
            return
        if opcode in self._refused.during and self._refused.is_old(now_ns):
            self._fail_refused(
                UserMessage(
                    "0; the final result of the command came {age_s:.1f} s later",
                    age_s=self._refused.age_s(now_ns),
                )
            )

    def _status_came(self, status: str, requested_ns: int) -> None:
        self._status = status
        if status == _IDLE:
            self._executing = {k: v for k, v in self._executing.items() if v > requested_ns}
        if status not in BUSY:
            self._refused = None
        elif self.transferring:
            return
        elif self._refused is not None:
            if self._refused.is_old(requested_ns):
                self._fail_refused(UserMessage("0; the status is still {status}", status=status))
        elif self._rests_from_ns and requested_ns > self._rests_from_ns:
            self.fail(
                "4.17/4", "the robot continues to execute after it was accepted", _IDLE, status
            )

    def _place_came(self, opcode: int, place: Sequence[float]) -> None:
        first = self._places.setdefault(opcode, place)
        if max_deviation(first, place) > STANDSTILL:
            message = "the arm continues to move after it was accepted"
            self.fail("4.17/7", message, f"{tuple(first)}", f"{tuple(place)}")

    def _fail_refused(self, observed: str) -> None:
        assert self._refused is not None, "a stop was refused"
        self.fail(
            "4.17/6",
            UserMessage(
                "the controller refused it while {names} executed", names=self._refused.names
            ),
            "1",
            observed,
        )

    def fail(self, requirement: str, message: str, expected: str, observed: str) -> None:
        """Record that the emergency stop does not work; only the first failure is kept."""
        if self.failure is None:
            self.failure = StopFailure(requirement, message, expected, observed)
