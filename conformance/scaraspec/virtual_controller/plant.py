"""The plant: the simulated hardware of the virtual robot.

It contains the moving arm, the motors, the ports, the disk and the clock, without commands,
replies and robot states. `now_s` is the time in seconds of any monotonic clock.
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
"""Final temperature above ambient of a motor that always runs at full speed."""
HEATING_TIME_S = 30.0
"""Time constant of heating and cooling of a motor."""

ANALOG_LIMIT = 1e6
"""Limit of an analog input: 100 times its value must fit an int32 (L934)."""

_T = TypeVar("_T")


class NoSuchPortError(LookupError):
    """There is no port with this number."""


class Ports(Generic[_T]):
    """Ports of one kind by their number, from 1 (A-4.32-2: each kind has its own numbering)."""

    def __init__(self, kind: str, count: int, value: _T, valid: Callable[[_T], bool]) -> None:
        self._kind = kind
        self._values = [value] * count
        self._valid = valid

    def __getitem__(self, port: int) -> _T:
        """The current value.

        Raises:
            NoSuchPortError: There is no such port.
        """
        return self._values[self._index(port)]

    def __setitem__(self, port: int, value: _T) -> None:
        """Set the value.

        Raises:
            NoSuchPortError: There is no such port.
            ValueError: The value is not valid for this kind of port.
        """
        if not self._valid(value):
            raise ValueError(f"{value!r} is not a valid value of {self._kind} {port}")
        self._values[self._index(port)] = value

    def __iter__(self) -> Iterator[_T]:
        """The values in the order of the port numbers."""
        return iter(self._values)

    def _index(self, port: int) -> int:
        if not 1 <= port <= len(self._values):
            raise NoSuchPortError(
                UserMessage(
                    "there is no {kind} {port}: the ports are 1 to {port_count}",
                    kind=self._kind,
                    port=port,
                    port_count=len(self._values),
                )
            )
        return port - 1


class Pwm(NamedTuple):
    """The value of a PWM output; the document gives no units (A-6.5-12)."""

    value: int
    time_base: int


class WallClock:
    """The robot's calendar clock (4.5, 4.6), which 0x06 sets; its zone is UTC (A-4.5-1)."""

    def __init__(self, time: datetime, now_s: float) -> None:
        self.set(time, now_s)

    def set(self, time: datetime, now_s: float) -> None:
        """Set the clock to `time`, a datetime without time zone, at `now_s`."""
        self._set_to, self._set_at_s = time, now_s

    def time(self, now_s: float) -> datetime:
        """Return the time of the clock; it stops at the end of the year 9999."""
        try:
            return self._set_to + timedelta(seconds=now_s - self._set_at_s)
        except OverflowError:
            return datetime.max  # noqa: DTZ901 - the document names no zone

    def when_s(self, epoch_s: float) -> float:
        """Return the `now_s` at which the clock shows `epoch_s` seconds since 1970 (L938)."""
        return self._set_at_s + epoch_s - self._set_to.replace(tzinfo=UTC).timestamp()


class Plant:
    """The physical side of one robot.

    Attributes:
        digital_inputs: Ports 1-8, set from outside.
        analog_inputs: Ports 1-8, set from outside; real values without unit (A-4.33-1).
        digital_outputs: Ports 1-16; they keep their value.
        pwm_outputs: Ports 1-16; they keep their value.
        clock: The calendar clock.
        locked: Whether the joints resist a push by hand (4.25, 4.26).
        disk_full: Whether the disk is full, regardless of the limits of the store.
    """

    def __init__(self, time: datetime, now_s: float, joints: Joints | None = None) -> None:
        """Switch the robot on.

        Args:
            time: The time of the calendar clock at `now_s`.
            now_s: The current time in seconds.
            joints: Position of the arm; by default `HOME` with the elbow to the right.
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
        """Return the joint positions at `now_s`."""
        return self._motion.joints_at(now_s - self._began_s)

    @property
    def motion_ends_s(self) -> float:
        """When the latest motion ends or ended, in seconds."""
        return self._began_s + self._motion.duration_s

    def start(self, motion: Motion, now_s: float) -> None:
        """Start a motion at the current position; it replaces any other motion."""
        self._warm(now_s)
        self._motion, self._began_s = motion, now_s

    def stop(self, now_s: float) -> None:
        """Stop the arm at its current position."""
        self.start(hold(self.joints(now_s)), now_s)

    def temperatures_c(self, now_s: float) -> tuple[float, ...]:
        """Return the motor temperatures in °C, in the order of 4.14 (L299)."""
        self._warm(now_s)
        return tuple(AMBIENT_C + rise_c for rise_c in self._rises_c)

    def _warm(self, now_s: float) -> None:
        """Update the first-order thermal model with the mean speed since the last call."""
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
        """Code of table 8-1 for the current faults, motors before 05 and 06; None without fault."""
        joints = [fault for fault in self._faults if isinstance(fault, Joint)]
        if joints:
            return code_for_joints(joints).text
        return min((fault for fault in self._faults if isinstance(fault, str)), default=None)

    def fail(self, code: str, now_s: float, *, lasting: bool = False) -> None:
        """Inject a fault: the arm stops, and the fault remains until it is cleared.

        Args:
            code: 05, 06 or 11-1F; motor faults add up (A-8-1).
            now_s: The current time in seconds.
            lasting: Whether the cause remains, so that the fault cannot be cleared before
                `repair`.

        Raises:
            ValueError: The code is not a fault of table 8-1.
        """
        fault = lookup(code)
        if fault not in FAILURES:
            raise ValueError(f"{code!r} is not a fault: use 05, 06 or 11 to 1F of table 8-1")
        faults = fault.joints or (fault.text,)
        self._faults.update(faults)
        if lasting:
            self._lasting.update(faults)
        self.stop(now_s)

    def repair(self) -> None:
        """Remove every lasting cause; the faults remain until they are cleared."""
        self._lasting.clear()

    def clear_faults(self) -> None:
        """Clear the faults without a lasting cause (A-4.18-2)."""
        self._faults &= self._lasting


def _is_bit(value: bool) -> bool:  # noqa: FBT001 - the value of a port
    return isinstance(value, bool)


def _is_analog(value: float) -> bool:
    return abs(value) <= ANALOG_LIMIT  # false for nan


def _is_pwm(value: Pwm) -> bool:
    return min(value) >= 0
