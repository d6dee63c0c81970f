"""Poses: reads values of several numbers and compares them with what was set (4.19-4.22).

`motion` reads the current pose of the arm.
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
    """Send a query whose value is several numbers, and return the value.

    Raises:
        CaseFailed: The reply has another form.
    """
    answer = line.ask(command)
    if not isinstance(answer.value, kind):
        count = len(kind._fields)
        message = UserMessage(
            "the reply to {command} is not {count} numbers separated by bars",
            command=command,
            count=count,
        )
        expected = "|".join(kind._fields)
        raise CaseFailed(message, expected=expected, observed=f"{answer}", requirement=requirement)
    return answer.value


def gripper_of(line: OutgoingConnection) -> Point:
    """Query the gripper center (0x34); see `numbers_of`."""
    return numbers_of(line, "get_gripper_center", Point, "4.19/2")


def initial_of(line: OutgoingConnection) -> Pose:
    """Query the initial tool position (0x37); see `numbers_of`."""
    return numbers_of(line, "get_initial_tool_position", Pose, "4.22/2")


def expect_numbers(
    reported: tuple[float, ...], expected: tuple[float, ...], message: str, requirement: str
) -> None:
    """Compare reported numbers with what was set; exactly, if these have at most one decimal.

    Raises:
        CaseFailed: They differ.
    """
    expect(
        read_back(reported, expected),
        message,
        expected="|".join(f"{value:g}" for value in expected),
        observed="|".join(f"{value:g}" for value in reported),
        requirement=requirement,
    )
