"""Arm: the position of the arm, and the points with which programs move it.

The suite knows nothing about the geometry of the arm. A step goes from the reported position along
one of four values, and back. The suite determines the meaning of the values of a point (A-6.5-2).
The cases judge what programs do with points.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Final

from scaraspec.judge.tolerances import angle_difference, max_deviation
from scaraspec.protocol.commands import Point
from scaraspec.protocol.program_files import Node, Variable
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.traits import PointMeaning
from scaraspec.suite.controller.harness.two_stage.tasks import require_responsive
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive
from scaraspec.suite.program_files.bench import Bench
from scaraspec.suite.program_files.writing import Values, straight
from scaraspec.user_message import UserMessage

REACHED: Final = 0.2
"""The tolerance of a reached position, in mm or degrees: values may have one decimal (A-T-5)."""

_ROUNDED: Final = 0.55
"""The same if only whole numbers are reported (A-T-5)."""
_SETTLING: Final = 1.0
"""How far an arm may be from its target while it settles, in mm or degrees."""
_SETTLE_S: Final = 0.5

_KEY: Final = "point_meaning"
_POLL_S: Final = 0.02
_IMPOSSIBLE: Final = ("05", "06")  # an impossible coordinate or angle (table 8-1)
_FULL_STEP_MM: Final = 5.0
_SLOWER: Final = 5
_GRIPPER: Final = 3  # the index of the value that turns the gripper
_SHARE: Final = 0.5  # of a step
_FAR_DEG: Final = 5.0


_STEPS: Final = {
    PointMeaning.JOINTS: (0.5, 0.5, 2.0, 2.0),
    PointMeaning.POSE: (2.0, 2.0, 2.0, 2.0),
}
"""The length of a step in each value if 5 mm are allowed; the end of the arm moves farther."""


@dataclass(frozen=True, slots=True)
class Arm:
    """The arm of the subject; created by `arm`.

    Attributes:
        subject: The controller under test.
        line: The connection.
        robot: Runs programs.
        meaning: The meaning of the values of a point.
        home: Its position at the start, to which it returns.
    """

    subject: ControllerUnderTest
    line: OutgoingConnection
    robot: Bench
    meaning: PointMeaning
    home: Values

    @property
    def speed_percent(self) -> int:
        """The speed that the ICS permits."""
        return self.subject.ics.motion.speed_percent

    @property
    def slow_percent(self) -> int:
        """A speed at which the suite can observe the arm on its way."""
        return max(1, self.speed_percent // _SLOWER)

    def place(self) -> Values:
        """Return its position in the values of a point."""
        return _place(self.line, self.meaning)

    def place_at(self, target: Values) -> tuple[Values, bool]:
        """Return its position, and whether this is a target. An arm near it may still settle."""
        deadline = Deadline(self.subject, _SETTLE_S)
        while not _shows(position := self.place(), target):
            if deadline.expired or max_deviation(position, target) > _SETTLING:
                return position, False
            self.line.wait(_POLL_S)
        return position, True

    def step(self, start: Values, index: int, share: float = 1.0) -> Values:
        """Return a position that differs by a step, or a share of it, in one value."""
        scale = min(1.0, self.subject.ics.motion.step_mm / _FULL_STEP_MM)
        length = share * scale * _STEPS[self.meaning][index]
        a, b, c, d = (value + (length if at == index else 0) for at, value in enumerate(start))
        return a, b, c, d

    def goes(self, nodes: Sequence[Node], variables: Iterable[Variable] = ()) -> bool:
        """Run a program that moves the arm. Return False if the arm cannot reach its points.

        Raises:
            CaseFailed: The program does not end, or fails for another reason.
        """
        return self.watched(nodes, variables) is not None

    def watched(
        self, nodes: Sequence[Node], variables: Iterable[Variable] = ()
    ) -> list[Values] | None:
        """Run a program that moves the arm, and observe the arm.

        The status is queried, too, because the judge checks it, unless it may be old (A-4.8-3).

        Returns:
            The observed positions; None if the arm cannot reach the points.

        Raises:
            CaseFailed: The program does not end, or fails for another reason.
        """
        answer = self.robot.ask(self.robot.store(self.robot.file(nodes, variables)))
        if not answer.accepted and answer.code in _IMPOSSIBLE:
            return None
        if not answer.accepted:
            raise CaseFailed("a valid program is refused", expected="1", observed=f"{answer}")
        seen: list[Values] = []
        deadline = Deadline(self.subject, self.subject.longest_s)
        while (result := self.robot.ended()) is None:
            seen.append(self.place())
            if not self.subject.lag.measured:
                self.line.ask("get_status")
            if self.robot.is_overdue(deadline):
                raise CaseFailed("a move does not end", expected="11", observed="no result")
            self.line.wait(_POLL_S)
        if result.done:
            return seen
        if result.code in _IMPOSSIBLE:
            return None
        raise CaseFailed("a valid program fails", expected="11", observed=f"{result}")


def near(a: Values, b: Values) -> bool:
    """Whether two positions are equal within `REACHED`."""
    return max_deviation(a, b) <= REACHED


def _shows(position: Values, target: Values) -> bool:
    """Whether a reported position, which may be rounded, is that of a target."""
    rounded = all(float(value).is_integer() for value in position)
    return max_deviation(position, target) <= (_ROUNDED if rounded else REACHED)


@contextmanager
def arm(subject: ControllerUnderTest, line: OutgoingConnection, robot: Bench) -> Iterator[Arm]:
    """Yield the arm, and move it back to its start position when the context ends.

    Raises:
        CaseFailed: No program can move the arm, not even to its current position (6.5/27).
        CaseInconclusive: An earlier case has failed for this reason, or the subject does not report
            the position of the arm.
    """
    with _gripper_at_screw(line):
        meaning = _meaning(subject, line, robot)
        made = Arm(subject, line, robot, meaning, _place(line, meaning))
        try:
            yield made
        finally:
            with suppress(CaseFailed, CaseInconclusive):  # otherwise the arm stays where it is
                robot.stop()
                if not near(made.place(), made.home):
                    made.goes(straight(made.speed_percent, [made.home]))


@contextmanager
def _gripper_at_screw(line: OutgoingConnection) -> Iterator[None]:
    """Set the gripper center to zero, so that gripper and screw have the same pose (A-4.23-1)."""
    before = line.ask("get_gripper_center").value
    if not before or not any(before):
        yield
        return
    line.ask("set_gripper_center", Point(0, 0, 0))
    try:
        yield
    finally:
        with suppress(CaseFailed):
            line.ask("set_gripper_center", before)


def _place(line: OutgoingConnection, meaning: PointMeaning) -> Values:
    name = "get_joint_angles" if meaning is PointMeaning.JOINTS else "get_tool_coordinates"
    value = line.ask(name).value
    if value is None:
        raise CaseInconclusive(
            UserMessage("{command} does not report the position of the arm", command=name)
        )
    a, b, c, d, *_ = value
    try:
        straight(1, [(a, b, c, d)])
    except ValueError as error:
        raise CaseInconclusive(
            UserMessage(
                "a program cannot contain the values of {command}: {error}",
                command=name,
                error=error,
            )
        ) from None
    return a, b, c, d


def _meaning(subject: ControllerUnderTest, line: OutgoingConnection, robot: Bench) -> PointMeaning:
    """Return the meaning of the values of a point; determined once by a small turn."""
    traits = subject.traits
    if not traits.point_meaning_tried:
        require_responsive(subject, line)  # without observation the arm must not move
        traits.point_meaning_tried = True
        claimed = subject.dialect[_KEY]
        for meaning in sorted(PointMeaning, key=lambda each: each != claimed):
            made = Arm(subject, line, robot, meaning, _place(line, meaning))
            if any(_turns(made, share) for share in (_SHARE, -_SHARE)):
                traits.point_meaning = meaning
                subject.set_reading(_KEY, str(meaning))
                break
        else:
            raise CaseFailed(
                "a program that turns the gripper a little does not end there",
                expected="11, with the values of the point in 0x3C or in 0x38",
                observed="a refusal, a failure or another motion with both",
                requirement="6.5/27",
            )
    if traits.point_meaning is None:
        raise CaseInconclusive("the values of a point are neither those of 0x3C nor those of 0x38")
    return traits.point_meaning


def _turns(made: Arm, share: float) -> bool:
    """Whether a program turns the gripper a little and back, and moves nothing else.

    The program is simulated first, then run and observed. It is stopped if anything else moves.
    """
    line, robot = made.line, made.robot
    *still, gripper_before = _place(line, PointMeaning.JOINTS)
    there = made.step(made.home, _GRIPPER, share)
    for way in ([there], [made.home]):
        name = robot.store(robot.file(straight(made.speed_percent, way)))
        for command in ("simulate_program", "run_program"):
            if not robot.ask(name, command).accepted:
                return False
            deadline = Deadline(made.subject, made.subject.longest_s)
            while (result := robot.ended(command)) is None:
                *others, gripper = _place(line, PointMeaning.JOINTS)
                moved = max(abs(a - b) for a, b in zip(still, others, strict=True))
                far = abs(angle_difference(gripper, gripper_before)) > _FAR_DEG
                if moved > REACHED or far or robot.is_overdue(deadline, command):
                    robot.stop()
                    return False
                line.wait(_POLL_S)
            if not result.done:
                return False
        if not made.place_at(*way)[1]:
            return False
    return True
