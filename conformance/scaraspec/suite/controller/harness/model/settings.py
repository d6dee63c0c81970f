"""Steps that set the gripper center, the initial tool position and the clock."""

from datetime import datetime, timedelta
from typing import Final

from scaraspec.protocol.commands import Point, Pose
from scaraspec.suite.controller.harness.model.state import VALUES, ModelState, Step
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import (
    expect_clock_ran,
    read_clock,
    set_clock,
    shifted_time,
)
from scaraspec.suite.controller.harness.requests.poses import expect_numbers, gripper_of, initial_of

_CENTERS: Final = (Point(0, 0, 0), Point(12.5, -3, 40), Point(-7, 0.5, 0), Point(0, 8, -1.5))

_DAYS: Final = (3, -5, 40, -30)  # shifts of the clock

_YEARS: Final = range(2001, 2099)

_SUMMER: Final = datetime(2024, 6, 15, 12)  # noqa: DTZ001 - the document names no zone


class SettingSteps(ModelState):
    """Sets and reads settings."""

    def _set_centre(self, step: Step, line: OutgoingConnection) -> str | None:
        value = _CENTERS[step.value]
        if line.ask("set_gripper_center", value).accepted:
            self._center, self._center_was_set = value, True
        return f"set the gripper center {tuple(value)}"

    def _set_initial(self, step: Step, line: OutgoingConnection) -> str | None:
        x, y, z, theta_x, *_ = (round(value, 1) for value in self._here)
        aside = self._subject.ics.motion.step_mm * step.value / VALUES
        value = Pose(x, round(y + aside, 1), z, theta_x, 0, 0)
        if line.ask("set_initial_tool_position", value).accepted:  # it may be out of reach
            self._initial = value
        return f"set the initial position {tuple(value)}"

    def _get_poses(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._center:
            message = "0x34 does not return the gripper center that was set"
            expect_numbers(gripper_of(line), self._center, message, "4.20/3")
        if self._initial:
            message = "0x37 does not return the initial position that was set"
            expect_numbers(initial_of(line)[:4], self._initial[:4], message, "4.21/3")
        return "query the poses"

    def _set_clock(self, step: Step, line: OutgoingConnection) -> str | None:
        time = shifted_time(read_clock(self._subject, line).time, timedelta(days=_DAYS[step.value]))
        if time.year not in _YEARS:
            time = _SUMMER
        self._clock = set_clock(self._subject, line, time)
        return f"set the clock {self._clock.time}"

    def _get_clock(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._unresponsive:
            return None
        now = read_clock(self._subject, line)
        if self._clock:
            message = "the clock does not run on from the time that was set"
            expect_clock_ran(self._subject, self._clock, now, message, "4.5/4")
        return "query the time"
