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

_CENTRES: Final = (Point(0, 0, 0), Point(12.5, -3, 40), Point(-7, 0.5, 0), Point(0, 8, -1.5))

_DAYS: Final = (3, -5, 40, -30)  # by which the clock is set aside

_YEARS: Final = range(2001, 2099)

_SUMMER: Final = datetime(2024, 6, 15, 12)  # noqa: DTZ001 - the document names no zone


class SettingSteps(ModelState):
    """Sets and reads settings."""

    def _set_centre(self, step: Step, line: OutgoingConnection) -> str | None:
        wanted = _CENTRES[step.value]
        if line.ask("set_gripper_center", wanted).accepted:
            self._centre, self._recentred = wanted, True
        return f"set the gripper centre {tuple(wanted)}"

    def _set_initial(self, step: Step, line: OutgoingConnection) -> str | None:
        x, y, z, theta_x, *_ = (round(value, 1) for value in self._here)
        aside = self._subject.ics.motion.step_mm * step.value / VALUES
        wanted = Pose(x, round(y + aside, 1), z, theta_x, 0, 0)
        if line.ask("set_initial_tool_position", wanted).accepted:  # it may be out of reach
            self._initial = wanted
        return f"set the initial position {tuple(wanted)}"

    def _get_poses(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._centre:
            message = "0x34 does not give the gripper centre that was set"
            expect_numbers(gripper_of(line), self._centre, message, "4.20/3")
        if self._initial:
            message = "0x37 does not give the initial position that was set"
            expect_numbers(initial_of(line)[:4], self._initial[:4], message, "4.21/3")
        return "ask for the poses"

    def _set_clock(self, step: Step, line: OutgoingConnection) -> str | None:
        time = shifted_time(read_clock(self._subject, line).time, timedelta(days=_DAYS[step.value]))
        if time.year not in _YEARS:
            time = _SUMMER
        self._clock = set_clock(self._subject, line, time)
        return f"set the clock {self._clock.time}"

    def _get_clock(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._deaf:
            return None
        now = read_clock(self._subject, line)
        if self._clock:
            message = "the clock does not go on from what was set"
            expect_clock_ran(self._subject, self._clock, now, message, "4.5/4")
        return "ask for the time"
