"""Clause 4.16: simulate a program (0x31, L330-354)."""

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.motion import joints_of, stop_motion
from scaraspec.suite.controller.harness.requests.ports import (
    outputs,
    outputs_preserved,
    settable_outputs,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    RUN,
    SIMULATE,
    expect_accepted,
    start_program,
    upload_wait_program,
)
from scaraspec.suite.controller.harness.two_stage.refusals import (
    expect_first_reply,
    expect_missing_program,
    text_of,
)
from scaraspec.suite.controller.harness.two_stage.results import expect_success
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task, require_responsive
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect
from scaraspec.suite.program_files.layout import configured, layout_in_use
from scaraspec.suite.program_files.writing import program_file, set_output, wait
from scaraspec.user_message import UserMessage

_MOTION = (Hazard.STATE, Hazard.MOTION)


@case("4.16/2", hazards=_MOTION)
def test_first_reply(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A simulation is answered "1" if it is possible, repeatedly and between runs."""
    for name in (SIMULATE, RUN, SIMULATE):
        reply = start_program(subject, line, name, seconds=0).answer
        expect_first_reply(name, reply)
        expect(
            text_of(reply) == b"1",
            UserMessage("the first reply to {name} is not just the flag 1", name=name),
            expected="1",
            observed=f"{reply}",
        )
        expect_success(subject, line, name)


@case("4.16/2", "8/5", name="missing", hazards=_MOTION)
def test_missing_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The controller refuses to simulate a program that is not stored, with code 20."""
    program = upload_wait_program(subject, line, 0)
    for name in examples((subject.new_name(), program + b"x", program[:-1])):
        expect_missing_program(subject, line, SIMULATE, name, "8/5")
    line.ask("delete_program", program)
    expect_missing_program(subject, line, SIMULATE, program, "8/5")


@case("4.16/3", hazards=_MOTION)
def test_end_of_a_simulation(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A simulation ends with "11", also the second one, and a later run is reported as a run."""
    for _ in range(2):
        start_program(subject, line, SIMULATE, seconds=0)
        expect_success(subject, line, SIMULATE)
    with executing_task(subject, line, RUN):
        status = line.ask("get_status")
        expect(
            status.value != "02",
            "a run after a simulation is reported as a simulation",
            expected="01",
            observed=f"{status}",
            requirement="4.8/4",
        )


@case("4.16/5", "4.8/5", hazards=_MOTION)
def test_simulation_touches_nothing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A simulated program that sets an output and waits moves no joint and changes no output."""
    require_responsive(subject, line)  # it also determines the layout
    with outputs_preserved(line) as before:
        port = settable_outputs(line)[-1]
        nodes = [set_output(port, on=not before[port - 1]), *wait(1)]
        name = subject.new_name()
        layout, base = layout_in_use(subject), configured(subject, line)
        upload(line, name, program_file(subject.dialect, nodes, layout=layout, base=base))
        joints = joints_of(line)
        expect_accepted(SIMULATE, line.ask(SIMULATE, name))
        status = line.ask("get_status")
        expect(
            status.value not in BUSY or status.value == "02",
            "a simulation is reported as another state",
            expected="02",
            observed=f"{status}",
            requirement="4.8/5",
        )
        outputs_during, moved_during = outputs(line), max_deviation(joints_of(line), joints)
        stop_motion(subject, line)
        if outputs_during != before or outputs(line) != before:
            message = "a simulation changed an output"
            subject.tolerate("4.16/5", "A-4.16-1", "outputs", message)
        if max(moved_during, max_deviation(joints_of(line), joints)) > STANDSTILL:
            message = "a simulation moved the arm"
            subject.tolerate("4.16/5", "A-4.16-1", "motion", message)
