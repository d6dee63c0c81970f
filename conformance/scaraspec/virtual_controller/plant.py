"""The plant: what is physical about the virtual robot and can be read, driven or broken.

The arm in motion, its motors, the ports, the disk and the clock live here. Commands, replies and
robot states do not. Times named `now_s` are monotonic seconds of the caller's choosing.
"""

import math
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from typing import Generic, NamedTuple, TypeVar

from scaraspec.protocol.errors import FAILURES, Joint, code_for_joints, lookup
from scaraspec.user_message import UserMessage
from scaraspec.virtual_controller.arm import HOME, UPPER, Joints, inverse
from scaraspec.virtual_controller.motion import JOINT_SPEEDS, Motion, hold

DIGITAL_INPUTS = 8
ANALOG_INPUTS = 8
OUTPUTS = 16

AMBIENT_C = 25.0
FULL_SPEED_RISE_C = 60.0
"""How far above ambient a motor gets that never stops running at its full speed."""
HEATING_TIME_S = 30.0
"""Time constant with which a motor warms and cools."""

ANALOG_LIMIT = 1e6
"""Bound of an analog input, so that 100 times its value is still an int32 (L934)."""

_T = TypeVar("_T")


class NoSuchPortError(LookupError):
    """The robot has no port with this number of this kind."""


class Ports(Generic[_T]):
    """Ports of one kind by their number, from 1 (A-4.32-2: each kind has its own numbering)."""

    def __init__(self, kind: str, count: int, value: _T, valid: Callable[[_T], bool]) -> None:
        self._kind = kind
        self._values = [value] * count
        self._valid = valid

    def __getitem__(self, port: int) -> _T:
        """The present value.

        Raises:
            NoSuchPortError: There is no such port.
        """
        return self._values[self._index(port)]

    def __setitem__(self, port: int, value: _T) -> None:
        """Set or drive the value.

        Raises:
            NoSuchPortError: There is no such port.
            ValueError: A port of this kind cannot have this value.
        """
        if not self._valid(value):
            raise ValueError(f"{self._kind} {port} cannot be {value!r}")
        self._values[self._index(port)] = value

    def __iter__(self) -> Iterator[_T]:
        """The values in the order of the numbers."""
        return iter(self._values)

    def _index(self, port: int) -> int:
        if not 1 <= port <= len(self._values):
            raise NoSuchPortError(
                UserMessage(
                    "no {kind} {port}: they run from 1 to {values_count}",
                    kind=self._kind,
                    port=port,
                    values_count=len(self._values),
                )
            )
        return port - 1


class Pwm(NamedTuple):
    """What a PWM output is set to; the document gives neither value a unit (A-6.5-12)."""

    value: int
    time_base: int


class WallClock:
    """The robot's calendar clock (4.5, 4.6), which 0x06 sets; its zone is UTC (A-4.5-1)."""

    def __init__(self, time: datetime, now_s: float) -> None:
        self.set(time, now_s)

    def set(self, time: datetime, now_s: float) -> None:
        """Make the clock show `time`, which names no zone, at `now_s`."""
        self._set_to, self._set_at_s = time, now_s

    def time(self, now_s: float) -> datetime:
        """What the clock shows; it stands still at the end of the year 9999."""
        try:
            return self._set_to + timedelta(seconds=now_s - self._set_at_s)
        except OverflowError:
            return datetime.max  # noqa: DTZ901 - the document names no zone

    def when_s(self, epoch_s: float) -> float:
        """The `now_s` at which the clock shows so many seconds since 1970 (L938)."""
        return self._set_at_s + epoch_s - self._set_to.replace(tzinfo=UTC).timestamp()


class Plant:
    """The physical side of one robot.

    Attributes:
        digital_inputs: Ports 1-8, driven from outside.
        analog_inputs: Ports 1-8, driven from outside; real values of no known unit (A-4.33-1).
        digital_outputs: Ports 1-16, which hold what they were set to.
        pwm_outputs: Ports 1-16, likewise.
        clock: The calendar clock.
        locked: Whether the joints hold against the user's hand (4.25, 4.26).
        disk_full: Whether the robot's disk takes nothing more, whatever the store has left.
    """

    def __init__(self, time: datetime, now_s: float, joints: Joints | None = None) -> None:
        """Switch the robot on.

        Args:
            time: What the calendar clock shows at `now_s`.
            now_s: The present instant.
            joints: Where the arm stands; at `HOME` with the elbow to the right if not given.
        """
        start = inverse(HOME, near=UPPER) if joints is None else joints
        self.digital_inputs = Ports("digital input", DIGITAL_INPUTS, value=False, valid=_is_bit)
        self.analog_inputs = Ports("analog input", ANALOG_INPUTS, 0.0, _is_analog)
        self.digital_outputs = Ports("digital output", OUTPUTS, value=False, valid=_is_bit)
        self.pwm_outputs = Ports("PWM output", OUTPUTS, Pwm(0, 0), _is_pwm)
        self.clock = WallClock(time, now_s)
        self.locked = True
        self.disk_full = False
        self._motion = hold(start)
        self._began_s = now_s
        self._rises_c = (0.0,) * len(start)
        self._warmed_s, self._warmed_joints = now_s, start
        self._faults: set[Joint | str] = set()
        self._lasting: set[Joint | str] = set()

    # ------------------------------------------------------------------ arm and motors

    def joints(self, now_s: float) -> Joints:
        """Where the joints are."""
        return self._motion.joints_at(now_s - self._began_s)

    @property
    def motion_ends_s(self) -> float:
        """When the latest motion ends or ended."""
        return self._began_s + self._motion.duration_s

    def start(self, motion: Motion, now_s: float) -> None:
        """Begin a motion at once in place of any other; it begins where the arm stands."""
        self._warm(now_s)
        self._motion, self._began_s = motion, now_s

    def stop(self, now_s: float) -> None:
        """Hold the arm where it is at this instant."""
        self.start(hold(self.joints(now_s)), now_s)

    def temperatures_c(self, now_s: float) -> tuple[float, ...]:
        """Motor temperatures in degrees Celsius in the order of 4.14 (L299)."""
        self._warm(now_s)
        return tuple(AMBIENT_C + rise_c for rise_c in self._rises_c)

    def _warm(self, now_s: float) -> None:
        """First-order warming towards what the mean speed since the last call would lead to."""
        elapsed_s = now_s - self._warmed_s
        if elapsed_s <= 0:
            return
        joints = self.joints(now_s)
        keep = math.exp(-elapsed_s / HEATING_TIME_S)
        loads = (
            abs(q - p) / elapsed_s / speed
            for p, q, speed in zip(self._warmed_joints, joints, JOINT_SPEEDS, strict=True)
        )
        self._rises_c = tuple(
            FULL_SPEED_RISE_C * load * (1 - keep) + rise_c * keep
            for load, rise_c in zip(loads, self._rises_c, strict=True)
        )
        self._warmed_s, self._warmed_joints = now_s, joints

    # ------------------------------------------------------------------ faults

    @property
    def fault_code(self) -> str | None:
        """The code of table 8-1 for the present faults, motors before 05 and 06; None if sound."""
        joints = [fault for fault in self._faults if isinstance(fault, Joint)]
        if joints:
            return code_for_joints(joints).text
        return min((fault for fault in self._faults if isinstance(fault, str)), default=None)

    def fail(self, code: str, now_s: float, *, lasting: bool = False) -> None:
        """Break something: the arm stops, and the fault stays until it is cleared.

        Args:
            code: 05, 06 or 11-1F; motors add to those already broken (A-8-1).
            now_s: The present instant.
            lasting: Whether the cause stays too, so that the fault cannot be cleared before
                `repair`.

        Raises:
            ValueError: The code of table 8-1 is no fault.
        """
        fault = lookup(code)
        if fault not in FAILURES:
            raise ValueError(f"{code!r} is no fault: choose 05, 06 or 11 to 1F of table 8-1")
        broken = fault.joints or (fault.text,)
        self._faults.update(broken)
        if lasting:
            self._lasting.update(broken)
        self.stop(now_s)

    def repair(self) -> None:
        """Take away every lasting cause; the faults stay until they are cleared."""
        self._lasting.clear()

    def clear_faults(self) -> None:
        """Forget the faults whose cause is gone (A-4.18-2)."""
        self._faults &= self._lasting


def _is_bit(value: bool) -> bool:  # noqa: FBT001 - a value that a port is asked to take
    return isinstance(value, bool)


def _is_analog(value: float) -> bool:
    return abs(value) <= ANALOG_LIMIT  # false for nan


def _is_pwm(value: Pwm) -> bool:
    return min(value) >= 0
