"""Poses: the gripper centre and the initial tool position, as they are read and set (4.19-4.22)."""

from scaraspec.judgement.rounding import read_back
from scaraspec.protocol.commands import Point, Pose
from scaraspec.suite.as_client.line import Line
from scaraspec.suite.expect import Unmet, expect


def gripper_of(line: Line) -> Point:
    """The gripper centre (0x34).

    Raises:
        Unmet: That is no three numbers.
    """
    answer = line.ask("get_gripper_center")
    if not isinstance(answer.value, Point):
        message = "the gripper centre is not three numbers between bars"
        raise Unmet(message, expected="x|y|z", observed=f"{answer}", requirement="4.19/2")
    return answer.value


def initial_of(line: Line) -> Pose:
    """The initial tool position (0x37).

    Raises:
        Unmet: That is no six numbers.
    """
    answer = line.ask("get_initial_tool_position")
    if not isinstance(answer.value, Pose):
        message = "the initial tool position is not six numbers between bars"
        raise Unmet(message, expected="x|y|z|…", observed=f"{answer}", requirement="4.22/2")
    return answer.value


def expect_numbers(
    shown: tuple[float, ...], wanted: tuple[float, ...], message: str, requirement: str
) -> None:
    """Hold what is shown against what was set: exactly where it has one decimal or none.

    Raises:
        Unmet: They differ.
    """
    expect(
        read_back(shown, wanted),
        message,
        expected="|".join(f"{value:g}" for value in wanted),
        observed="|".join(f"{value:g}" for value in shown),
        requirement=requirement,
    )
