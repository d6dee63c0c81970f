"""Poses: values of several numbers, and how they are compared with what was set (4.19-4.22).

Where the arm stands at the moment is a thing of motion.
"""

from typing import TypeVar

from scaraspec.judge.tolerances import read_back
from scaraspec.protocol.commands import JointValues, Point, Pose
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.user_message import UserMessage

_Numbers = TypeVar("_Numbers", JointValues, Point, Pose)


def numbers_of(
    line: OutgoingConnection, command: str, kind: type[_Numbers], requirement: str
) -> _Numbers:
    """The value of a query with so many numbers.

    Raises:
        CaseFailed: It reports something else.
    """
    answer = line.ask(command)
    if not isinstance(answer.value, kind):
        count = len(kind._fields)
        message = UserMessage(
            "{command} does not tell {count} numbers between bars", command=command, count=count
        )
        expected = "|".join(kind._fields)
        raise CaseFailed(message, expected=expected, observed=f"{answer}", requirement=requirement)
    return answer.value


def gripper_of(line: OutgoingConnection) -> Point:
    """The gripper centre (0x34); see `numbers_of`."""
    return numbers_of(line, "get_gripper_center", Point, "4.19/2")


def initial_of(line: OutgoingConnection) -> Pose:
    """The initial tool position (0x37); see `numbers_of`."""
    return numbers_of(line, "get_initial_tool_position", Pose, "4.22/2")


def expect_numbers(
    shown: tuple[float, ...], wanted: tuple[float, ...], message: str, requirement: str
) -> None:
    """Hold what is shown against what was set: exactly where it has one decimal or none.

    Raises:
        CaseFailed: They differ.
    """
    expect(
        read_back(shown, wanted),
        message,
        expected="|".join(f"{value:g}" for value in wanted),
        observed="|".join(f"{value:g}" for value in shown),
        requirement=requirement,
    )
