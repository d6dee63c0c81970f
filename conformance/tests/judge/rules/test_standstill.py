"""An arm that does not move: each requirement with traffic that meets it and traffic that violates
it."""

from collections.abc import Callable

import pytest

from scaraspec.protocol.commands import BY_NAME

JOINTS = "> get_joint_angles\n< get_joint_angles {}"
POSE = "> get_tool_coordinates\n< get_tool_coordinates {}"
STATUS = "> get_status\n< get_status 00"
MOVING = "> get_status\n< get_status 04"
HERE, NEAR, THERE = "0|90|0|0", "0|90.1|0|0", "1|90|0|0"
BEFORE_TURN, AFTER_TURN = "300|300|0|179.95|0|0", "300|300|0|-180|0|0"
HERE_XY, THERE_XY = "300|300|0|0|0|0", "295|305|0|0|0|0"
SET = {
    "4.13/6": "set_default_program a.rob",
    "4.20/5": "set_gripper_center 0|0|9",
    "4.21/5": "set_initial_tool_position 1|2|3|4|0|0",
}


def session(*lines: str) -> str:
    """A login, then these lines."""
    return "\n".join(("login", *lines))


def done(name: str, data: str = "", result: str = "11") -> str:
    """A complete two-stage command."""
    assert BY_NAME[name].two_stage
    return f"> {name} {data}\n< {name} 1\n<90 {name} {result}"


def joints(*readings: str) -> str:
    """Queries of the joint angles."""
    return "\n".join(JOINTS.format(reading) for reading in readings)


def pose(*readings: str) -> str:
    """Queries of the tool coordinates."""
    return "\n".join(POSE.format(reading) for reading in readings)


def put(requirement: str) -> str:
    """The setting that a requirement is about, accepted."""
    request = SET[requirement]
    return f"> {request}\n< {request.split()[0]} 1"


LOCKED = done("lock_joints")
MOVED = done("set_tool_coordinates", "50|300|300|0|0|0|0")
SIMULATING = "> simulate_program a\n< simulate_program 1"

CASES = (
    ("4.17/7", "pass", session(done("emergency_stop"), joints(HERE, HERE))),
    ("4.17/7", "pass", session(done("emergency_stop"), joints(HERE, NEAR))),
    ("4.17/7", "fail", session(done("emergency_stop"), joints(HERE, THERE))),
    ("4.17/7", "none", session(done("emergency_stop", result="00|12"), joints(HERE, THERE))),
    # Later another client may have started a motion.
    ("4.17/7", "none", session(done("emergency_stop"), joints(HERE), "+3", joints(THERE))),
    ("4.17/7", "none", session(done("emergency_stop"), joints(HERE), MOVING, joints(THERE))),
    ("4.26/5", "pass", session(LOCKED, joints(HERE, HERE))),
    ("4.26/5", "fail", session(LOCKED, joints(HERE, THERE))),
    ("4.26/5", "none", session(done("release_joints"), joints(HERE, THERE))),
    ("4.27/4", "pass", session(MOVED, joints(HERE, HERE))),
    ("4.27/4", "fail", session(MOVED, joints(HERE, THERE))),
    ("4.27/4", "pass", session(LOCKED, "+5", STATUS, joints(HERE, HERE), STATUS)),
    ("4.27/4", "fail", session(LOCKED, "+5", STATUS, joints(HERE, THERE), STATUS)),
    # A motion by the teach pendant would show in the next status, or in the time that passes.
    ("4.27/4", "none", session(LOCKED, "+5", STATUS, joints(HERE, THERE), MOVING)),
    ("4.27/4", "none", session(LOCKED, "+5", STATUS, joints(HERE), "+2", joints(THERE), STATUS)),
    # It is unknown whether the joints are locked; they may be moved by hand.
    ("4.27/4", "none", session(STATUS, joints(HERE, THERE), STATUS)),
    (
        "4.27/4",
        "none",
        session(done("release_joints"), "+5", STATUS, joints(HERE, THERE), STATUS),
    ),
    ("4.23/5", "pass", session(MOVED, pose(HERE_XY, HERE_XY))),
    ("4.23/5", "fail", session(MOVED, pose(HERE_XY, THERE_XY))),
    ("4.23/5", "pass", session(LOCKED, "+5", STATUS, pose(HERE_XY, HERE_XY), STATUS)),
    ("4.23/5", "fail", session(LOCKED, "+5", STATUS, pose(HERE_XY, THERE_XY), STATUS)),
    ("4.23/5", "pass", session(MOVED, pose(BEFORE_TURN, AFTER_TURN))),
    ("4.23/5", "fail", session(MOVED, pose("300|300|0|179|0|0", AFTER_TURN))),
    # thetaY and thetaZ have no meaning (L1006).
    ("4.23/5", "pass", session(MOVED, pose(HERE_XY, "300|300|0|0|34.5|1"))),
    ("4.23/5", "fail", session(MOVED, pose(HERE_XY, "300|300|0|34.5|0|0"))),
    # The pose may be that of the gripper (A-4.23-1).
    ("4.23/5", "none", session(MOVED, pose(HERE_XY), put("4.20/5"), pose(THERE_XY))),
    *(
        case
        for requirement, wrong in (
            ("4.13/6", "tolerated A-4.12-3=moves"),
            ("4.20/5", "fail"),
            ("4.21/5", "tolerated A-4.21-2=moves"),
        )
        for case in (
            (requirement, "pass", session(STATUS, joints(HERE), put(requirement), joints(HERE))),
            (requirement, wrong, session(STATUS, joints(HERE), put(requirement), joints(THERE))),
            (requirement, "none", session(joints(HERE), put(requirement), joints(THERE))),
            (
                requirement,
                "none",
                session(STATUS, joints(HERE), put(requirement), "+3", joints(THERE)),
            ),
            (
                requirement,
                "none",
                session(done("release_joints"), joints(HERE), put(requirement), joints(THERE)),
            ),
        )
    ),
    # It is unknown which of two settings moved the arm.
    ("4.20/5", "none", session(STATUS, joints(HERE), put("4.20/5"), put("4.21/5"), joints(THERE))),
    ("4.16/5", "pass", session(joints(HERE), SIMULATING, joints(HERE))),
    (
        "4.16/5",
        "tolerated 4.16/5=observed otherwise",
        session(joints(HERE), SIMULATING, joints(THERE)),
    ),
    (
        "4.16/5",
        "tolerated 4.16/5=observed otherwise",
        session(
            f"> get_digital_outputs\n< get_digital_outputs 1|{'0' * 16}",
            done("simulate_program", "a"),
            f"> get_digital_outputs\n< get_digital_outputs 1|{'1' * 16}",
        ),
    ),
    (
        "4.16/5",
        "none",
        session(
            f"> get_digital_outputs\n< get_digital_outputs 1|{'0' * 16}",
            SIMULATING,
            "> set_digital_output 1|1\n< set_digital_output 1",
            f"> get_digital_outputs\n< get_digital_outputs 1|{'0' * 15}1",
        ),
    ),
    ("4.16/5", "none", session(joints(HERE), MOVED, SIMULATING, joints(THERE))),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_standstill(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
