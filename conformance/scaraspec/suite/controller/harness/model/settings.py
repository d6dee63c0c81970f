"""Steps that set the gripper center, the initial tool position and the clock."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any, Final

from scaraspec.judge.tolerances import read_back
from scaraspec.protocol.commands import Point, Pose
from scaraspec.suite.controller.harness.malformed.payloads import malformed, send_malformed
from scaraspec.suite.controller.harness.model.state import ModelState, Step
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import (
    expect_clock_ran,
    random_time,
    read_clock,
    rollovers,
    set_clock,
)
from scaraspec.suite.controller.harness.requests.poses import expect_numbers, gripper_of, initial_of
from scaraspec.user_message import UserMessage

_HIGHEST_TENTHS: Final = (0, 0, 9, 99, 999)
"""The largest absolute values of a coordinate of a gripper center, in tenths of a millimeter."""

_SETTINGS: Final = {
    "set_centre": "set_gripper_center",
    "set_initial": "set_initial_tool_position",
    "set_clock": "set_time",
}
"""The steps that set something, and their commands."""
_VALUES: Final[Mapping[str, Any]] = {
    "set_gripper_center": Point(1, 2, 3),
    "set_initial_tool_position": Pose(1, 2, 3, 4, 0, 0),
    "set_time": datetime(2024, 12, 22, 14, 30),  # noqa: DTZ001 - the document names no zone
}
"""Values of which malformed ones are made."""
_DAY: Final = timedelta(days=1)
_SECOND: Final = timedelta(seconds=1)
_KINDS_OF_TIME: Final = 7  # any time, and those of `rollovers`
_AXES: Final = 4  # the values of a pose that have a meaning (L1006)


class SettingSteps(ModelState):
    """Sets and reads settings."""

    def _set_centre(self, step: Step, line: OutgoingConnection) -> str | None:
        random = step.random
        limits = [random.choice(_HIGHEST_TENTHS) for _ in Point._fields]
        value = Point(*(random.randint(-limit, limit) / 10 for limit in limits))
        if line.ask("set_gripper_center", value).accepted:
            self._centers = [value]
        return UserMessage("set the gripper center {position}", position=tuple(value))

    def _set_initial(self, step: Step, line: OutgoingConnection) -> str | None:
        random, tenths = step.random, int(self._subject.ics.motion.step_mm * 10)
        aside = [random.choice((0, random.randint(-tenths, tenths))) / 10 for _ in range(_AXES)]
        x, y, z, theta_x = (round(p + d, 1) for p, d in zip(self._here[:_AXES], aside, strict=True))
        value = Pose(x, y, z, theta_x, 0, 0)
        if line.ask("set_initial_tool_position", value).accepted:  # it may be out of reach
            self._initials = [value[:_AXES]]
        return UserMessage("set the initial position {pose}", pose=tuple(value))

    def _mistake_setting(self, step: Step, line: OutgoingConnection) -> str | None:
        """Send a setting that is malformed. If it is not accepted, it changes nothing."""
        names = [name for act, name in _SETTINGS.items() if act in self._acts]
        if not names:
            return None
        name = names[step.turn % len(names)]
        wrong = step.random.choice(malformed(name, _VALUES[name], self._subject.dialect))
        if not wrong.firm:
            return None
        if name == "set_time" and not self._clock:
            self._clock = read_clock(self._subject, line)
        result = send_malformed(self._subject, line, name, wrong)
        if result.line is not line:  # it closes the connection (A-3-9)
            self._subject.close_lines()
            self._lines = [self._connection() for _ in self._lines]
            line = self._lines[0]
        if result.accepted:  # a case of its own judges this
            self._centers, self._initials, self._clock = [], [], None
        if name == "set_time":
            self._get_clock(step, line)
        elif "get_poses" in self._acts:
            self._get_poses(step, line)
        return UserMessage("{name} with {wrong}", name=name, wrong=wrong)

    def _get_poses(self, _: Step, line: OutgoingConnection) -> str | None:
        message = "0x34 does not return the gripper center that was set"
        self._centers = _one_of(self._centers, gripper_of(line), message, "4.20/3")
        message = "0x37 does not return the initial position that was set"
        self._initials = _one_of(self._initials, initial_of(line)[:_AXES], message, "4.21/3")
        return UserMessage("query the poses")

    def _set_clock(self, step: Step, line: OutgoingConnection) -> str | None:
        random, now = step.random, read_clock(self._subject, line).time
        time = now
        while abs(time - now) < _DAY:  # an earlier sequence may have set it
            time = random_time(random)
            if kind := step.turn % _KINDS_OF_TIME:  # the begin of a day, a month, …
                time = rollovers(time)[kind - 1] - _SECOND * random.randrange(2)
        self._clock = set_clock(self._subject, line, time)
        return UserMessage("set the clock {time}", time=self._clock.time)

    def _get_clock(self, _: Step, line: OutgoingConnection) -> str:
        now = read_clock(self._subject, line)
        if self._clock:
            message = "the clock does not run on from the time that was set"
            expect_clock_ran(self._subject, self._clock, now, message, "4.5/4")
        return UserMessage("query the time")


def _one_of(
    values: list[tuple[float, ...]], reported: tuple[float, ...], message: str, requirement: str
) -> list[tuple[float, ...]]:
    """Require that one of these values is reported, if any is known; return the reported value.

    Raises:
        CaseFailed: Another value is reported.
    """
    for value in values:
        if read_back(reported, value):
            return [value]
    if values:
        expect_numbers(reported, values[0], message, requirement)
    return [reported]
