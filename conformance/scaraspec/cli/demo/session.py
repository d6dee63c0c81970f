"""The session that `scaraspec demo` records: typical first steps of an integrator."""

from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Final

from scaraspec.cli.data import sample_program
from scaraspec.client import Client, Interrupted, Pending, Refused, ReplyTimeout
from scaraspec.user_message import UserMessage

PROGRAM: Final = "pick-and-place.rob"
_ENDLESS: Final = "endless.rob"  # it still runs when it is stopped, even on a slow machine
_POLL_S: Final = 0.04
_STOP_AFTER_POLLS: Final = 20
_OUTPUT_PORT: Final = 8

Say = Callable[[str], None]


def run(robot: Client, folder: Path, now: datetime, say: Say) -> None:
    """Use a robot: set up, upload, run, stop, reset, move, download.

    Args:
        robot: A client that is connected and logged in.
        folder: An existing folder for the download.
        now: The time to set on the robot.
        say: Called with a short description of each step.

    Raises:
        ClientError: The robot refused a request, or the link failed.
        ValueError: The downloaded file differs from the uploaded one.
    """
    program, endless = sample_program(PROGRAM), sample_program(_ENDLESS)
    say("set up")
    robot.get_version()
    robot.get_network()
    robot.set_time(now)
    robot.get_time()
    robot.set_gripper_center(0, 0, 50)
    robot.get_gripper_center()
    robot.set_initial_tool_position(300, 0, 250, 0, 0, 0)
    robot.get_initial_tool_position()
    robot.set_digital_output(_OUTPUT_PORT, 1)

    say(UserMessage("upload {name}", name=program.name))
    robot.upload(program)
    robot.list_programs()
    robot.set_default_program(program.name)
    robot.get_default_program()

    say("run it")
    _watch(robot, robot.start_run_program(program.name))

    say(UserMessage("run {name}, and stop it", name=endless.name))
    robot.upload(endless)
    second = robot.start_run_program(endless.name)
    _watch(robot, second, polls=_STOP_AFTER_POLLS)
    robot.emergency_stop()
    with suppress(Interrupted):
        second.wait()
    robot.get_status()

    say("reset, then move")
    _watch(robot, robot.start_reset())
    pose = robot.get_tool_coordinates()
    target = (pose.x - 60, pose.y + 120, pose.z + 40, 45, 0, 0)
    _watch(robot, robot.start_set_tool_coordinates(50, *target))
    with suppress(Refused):  # out of reach
        robot.set_tool_coordinates(50, 1_000, 0, 250, 0, 0, 0)

    say("download and compare")
    robot.set_digital_output(_OUTPUT_PORT, 0)
    copy = robot.download(program.name, folder / program.name)
    if copy.read_bytes() != program.read_bytes():
        raise ValueError(f"{program.name} differs after the download")


def _watch(robot: Client, pending: Pending, polls: int = 10_000) -> None:
    """Query all changing values until the final result arrives, or a number of times."""
    for _ in range(polls):
        robot.get_status()
        robot.get_joint_angles()
        robot.get_tool_coordinates()
        robot.get_motor_temperatures()
        robot.get_digital_inputs()
        robot.get_digital_outputs()
        robot.get_analog_input(1)
        robot.get_running_program()
        try:
            pending.wait(_POLL_S)
        except ReplyTimeout:
            continue
        return
