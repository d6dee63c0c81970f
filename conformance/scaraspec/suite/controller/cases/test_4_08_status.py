"""Clause 4.8: the status of the robot (0x09, L205-217)."""

from contextlib import suppress
from typing import Final

from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import status_after_result, stop_motion
from scaraspec.suite.controller.harness.requests.ports import driven_inputs
from scaraspec.suite.controller.harness.requests.queries import supported_queries
from scaraspec.suite.controller.harness.state_lag import TOLERATED_S, State
from scaraspec.suite.controller.harness.two_stage.commands import JOG, MOVE, RESET, begin_or_skip
from scaraspec.suite.controller.harness.two_stage.executing import (
    expect_status,
    require_no_fault,
    skip_if_other_program_runs,
    store_wait_program,
    wait_until_idle,
)
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseSkipped,
    EndedTooSoon,
    NoReply,
    expect,
    expect_equal,
)
from scaraspec.user_message import UserMessage

_IDLE: Final = "00"
_MOTION: Final = (Hazard.STATE, Hazard.MOTION)
_REPEATS: Final = 100
_WAIT_S: Final = 1
_STEP_S: Final = 0.25


def _expect_idle(line: OutgoingConnection, message: str) -> None:
    reply = status_after_result(line)
    code = require_no_fault(reply)
    if code is None:
        message = "the status is not a code of table 8-1"
        raise CaseFailed(message, expected="00", observed=f"{reply}", requirement="4.8/2")
    expect_equal(code.text, _IDLE, message, requirement="4.8/3")


@case("4.8/2", "4.8/3", "4.8/9")
def test_idle(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The status of an idle robot is 00, also after repeated and after other queries."""
    with skip_if_other_program_runs(subject):
        for _ in range(_REPEATS):
            _expect_idle(line, "the status of an idle robot is not 00")
        for query in supported_queries(subject):
            line.ask(*query)
            message = UserMessage(
                "the status of an idle robot is not 00 after {query}", query=query.name
            )
            _expect_idle(line, message)
        line.close()
        _expect_idle(subject.open(), "another connection does not report that the robot is idle")


@case("4.8/3", "4.8/9", name="refused", hazards=(Hazard.MOTION,))
def test_idle_after_refusal(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A robot that refuses a missing program stays idle."""
    missing = subject.new_name()
    subject.moved = True
    for command in ("run_program", "simulate_program"):
        if line.ask(command, missing).accepted:  # it may fail later (A-4.15-1)
            line.result(command)
        message = UserMessage("the status is not 00 after {command} was refused", command=command)
        _expect_idle(line, message)


@case("4.8/4", "4.8/3", "4.8/10", hazards=_MOTION, slow=True)
def test_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The status is 01 while a program runs, and 00 before and after it."""
    _watch_program(subject, line, "run_program", "01", "4.8/4")


@case("4.8/5", "4.8/3", "4.8/10", hazards=_MOTION, slow=True)
def test_simulating(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The status is 02 while a program is simulated, and 00 before and after it."""
    _watch_program(subject, line, "simulate_program", "02", "4.8/5")


def _watch_program(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    command: str,
    code: str,
    requirement: str,
) -> None:
    name = store_wait_program(subject, line, _WAIT_S)
    _expect_idle(line, "the status of an idle robot is not 00")
    try:
        begin_or_skip(subject, line, command, name)
        if not expect_status(subject, line, command, code, requirement):
            raise EndedTooSoon(
                UserMessage("{command} ended before the status could be requested", command=command)
            )
        for _ in range(int(_WAIT_S / _STEP_S) - 1):
            line.wait(_STEP_S / subject.ics.time_scale)
            if not expect_status(subject, line, command, code, requirement):
                break
        else:
            wait_until_idle(subject, line, command)
    finally:
        stop_motion(subject, line)


@case("4.8/6", "4.8/10", "4.9/6", hazards=_MOTION)
def test_resetting(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The status is 03 while the robot resets."""
    _watch(subject, line, RESET, "4.8/6")


@case("4.8/7", "4.8/10", "4.9/6")
def test_moving(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The status is 04 while the arm moves by a step."""
    _watch(subject, line, MOVE, "4.8/7")


@case("4.8/7", "4.8/10", "4.9/6", name="jogging")
def test_jogging(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The status is 04 while the arm jogs, until it is stopped."""
    _watch(subject, line, JOG, "4.8/7")


def _watch(
    subject: ControllerUnderTest, line: OutgoingConnection, command: str, requirement: str
) -> None:
    with executing_task(subject, line, command) as task:
        if not expect_status(subject, line, command, task.state, requirement):
            raise EndedTooSoon(
                UserMessage("{command} ended before the status could be requested", command=command)
            )
        line.wait(subject.ics.motion.jog_s / 2)
        expect_status(subject, line, command, task.state, requirement)
        with suppress(NoReply):  # a robot that executes a command need not answer (A-4-3)
            reply = line.ask("get_running_program")
            expect(
                not isinstance(reply.value, RunningProgram),
                UserMessage("a running program is reported during {command}", command=command),
                expected="0",
                observed=f"{reply}",
                requirement="4.9/6",
            )
    message = UserMessage("the robot is not idle although {command} has ended", command=command)
    _expect_idle(line, message)


@case("4/8", name="lag", hazards=(Hazard.MOTION,))
def test_state_lag(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Status, pose and inputs in a reply are at most 0.1 s old (A-4.8-3)."""
    lag = subject.lag
    if subject.has_hook("set_input"):
        with driven_inputs(subject, line):
            pass
    if not (lag.steps_taken or lag.inputs_driven):
        raise CaseSkipped("the lag is measured with steps of the arm or with the hook set_input")
    late = [state for state in State if state in lag.measured and not lag.measured[state].tolerated]
    state = next(
        iter(late or sorted(lag.measured, key=lag.measured.__getitem__, reverse=True)), None
    )
    if state is None:
        return
    shown_s, most_s = lag.measured[state]
    option = f"{most_s:.3f}"
    subject.set_reading("status_lag", option)
    text = "a reply reports the {state} of up to {most_s:.3f} s before"
    message = UserMessage(text, state=state, most_s=most_s)
    expect(
        not late,
        message,
        expected=UserMessage("at most {limit_s} s", limit_s=f"{TOLERATED_S:g}"),
        observed=UserMessage("more than {limit_s} s", limit_s=f"{shown_s:.3f}"),
    )
    subject.tolerate("4/8", "status_lag", option, message)
