"""Clause 4.15: run a program (0x30, L304-328)."""

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import NameRefused
from scaraspec.suite.controller.harness.requests.motion import stop_motion
from scaraspec.suite.controller.harness.state.defaults import default_program_preserved
from scaraspec.suite.controller.harness.two_stage.commands import (
    BRIEFLY_S,
    RUN,
    expect_accepted,
    require_command,
    start_program,
    try_request,
    upload_short_program,
    upload_wait_program,
)
from scaraspec.suite.controller.harness.two_stage.refusals import expect_missing_program
from scaraspec.suite.controller.harness.two_stage.results import (
    expect_success,
    stop_while_idle,
    wait_for_result,
)
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task, require_responsive
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect
from scaraspec.suite.engine.strategies import names
from scaraspec.suite.program_files.listed import INHERITED, long_name
from scaraspec.user_message import UserMessage

_MOTION = (Hazard.STATE, Hazard.MOTION)
_DEFAULTS = ("get_default_program", "set_default_program")
_LONG_BYTES = 25
"""Length of a program name, so that similar names do not exceed the allowed length (L226)."""


@case("4.15/2", name="missing", hazards=_MOTION)
def test_missing_program_is_refused_at_once(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A run that is not possible is refused immediately: nothing executes after the reply."""
    require_command(subject, RUN)
    subject.moved = True
    first = line.ask(RUN, subject.new_name())
    status = line.ask("get_status")
    expect(
        status.value not in BUSY or (first.accepted and status.value == "01"),
        "the robot executes something after it refused a missing program",
        expected="00",
        observed=UserMessage("{first}, then {second}", first=first, second=status),
    )
    if first.accepted:
        result = wait_for_result(subject, line, RUN)
        expect(
            not result.done,
            "a program that is not stored was run",
            expected="0|20",
            observed=f"{first}, {result}",
        )
        subject.tolerate("4.15/2", "A-4.15-1", "00|20", "the missing program was detected late")


@case(
    "4.15/2",
    name="fault",
    needs=("motor_fault", "clear_faults"),
    hazards=_MOTION,
    attended=True,
)
def test_motor_fault(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A robot with a failed inner arm motor refuses to run a program with "0|11"."""
    program = upload_wait_program(subject, line, 0)
    subject.moved = True
    try:
        subject.hook("motor_fault", joints="inner_arm")
        first = line.ask(RUN, program)
        outcome = wait_for_result(subject, line, RUN) if first.accepted else first
        expect(
            not outcome.done and outcome.code == "11",
            "a program runs although a motor has failed",
            expected="0|11",
            observed=f"{outcome}",
        )
        if first.accepted:
            message = "the fault was detected after the reply"
            subject.tolerate("4.15/2", "A-4.15-4", "00|11", message)
    finally:
        subject.hook("clear_faults")
        if line.ask("get_status").value != "00" and line.ask("reset").accepted:
            wait_for_result(subject, line, "reset")


@case("4.15/3", hazards=_MOTION)
def test_refusal(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A run that is not possible is refused with "0|" and a code of two characters."""
    require_command(subject, RUN)
    subject.moved = True
    for _ in range(2):
        first = line.ask(RUN, subject.new_name())
        if first.accepted:  # A-4.15-1
            wait_for_result(subject, line, RUN)
            continue
        expect(
            first.accepted is False and len(first.frame.data.rstrip(b"\0")) == 4,
            "the refusal of a run is not 0|code",
            expected="0|code",
            observed=f"{first}",
        )


@case("4.15/4", hazards=_MOTION)
def test_stored_programs_run(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A stored program runs, regardless of its name, and again after another program ran."""
    extension = start_program(subject, line, RUN, seconds=0).program.rpartition(b".")[2]
    expect_success(subject, line, RUN)

    @example(b"AZaz09.rob")
    @given(names)
    def store_and_run(name: bytes) -> None:
        stem, dot, _ = name[-20:].rpartition(b".")
        try:
            program = upload_short_program(
                subject, line, subject.files.prefix + stem + dot + extension
            )
        except NameRefused:
            return
        for _ in range(2):
            reply = expect_accepted(RUN, line.ask(RUN, program))
            expect(
                reply.frame.data.rstrip(b"\0") == b"1",
                "the first reply to a run is not just the flag 1",
                expected="1",
                observed=f"{reply}",
            )
            expect_success(subject, line, RUN)
        line.ask("delete_program", data=program)

    store_and_run()


@case("4.15/5", hazards=_MOTION, slow=True)
def test_end_of_a_run(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A run ends with "11" when its program ends, not earlier: the status is 01 until then.

    An earlier stop has no effect on it.
    """
    require_responsive(subject, line)
    stop_while_idle(subject, line)
    started = start_program(subject, line, RUN, BRIEFLY_S)
    line.wait(0.2)
    if line.ask("get_status").value == "01":
        early = [received for received in line.inbox if received.frame.tagged]
        expect(
            not early,
            "the final result of a run arrived while the program was running",
            expected="11 when the program has ended",
            observed=" ".join(f"{received.frame}" for received in early),
        )
    result = expect_success(subject, line, RUN)
    expect(
        result.time_s >= started.answer.time_s,
        "a run ends before it starts",
        expected="11 after 1",
        observed=f"{result}",
    )


@case("4.15/7", hazards=_MOTION)
def test_missing_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A name that is not in use is refused, however similar it is to the name of a program.

    The default program is not run instead, if there is one.
    """
    require_command(subject, RUN)
    program = upload_wait_program(subject, line, 0, long_name(subject, _LONG_BYTES))
    _expect_similar_names_missing(subject, line, program)
    if not subject.ics.unsupported.isdisjoint(_DEFAULTS):
        return
    with default_program_preserved(subject, line):
        line.ask("set_default_program", program)
        expect_missing_program(subject, line, RUN, subject.new_name(), "4.15/7")


def _expect_similar_names_missing(
    subject: ControllerUnderTest, line: OutgoingConnection, program: bytes
) -> None:
    stem, dot, extension = program.rpartition(b".")
    similar = [
        stem,
        stem + dot,
        stem + b"_" + dot + extension,
        program + b"x",
        program[:-1],
        b"x" + program,
        program + b".rob",
        subject.new_name(),
        subject.files.prefix + b"m" + b"i" * 18 + b"s" + dot + extension,
        INHERITED,
    ]
    for name in examples(similar):
        expect_missing_program(subject, line, RUN, name, "4.15/7")

    @given(st.text("abcxyzABC0123456789_-", min_size=8, max_size=20))
    def run_missing(name: str) -> None:
        expect_missing_program(
            subject, line, RUN, subject.files.prefix + f"{name}.rob".encode(), "4.15/7"
        )

    run_missing()


@case("4.15/7", name="deleted", hazards=_MOTION)
def test_deleted_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program that was run and then deleted cannot be run again."""
    program = start_program(subject, line, RUN, seconds=0).program
    expect_success(subject, line, RUN)
    line.ask("delete_program", program)
    expect_missing_program(subject, line, RUN, program, "4.15/7")


@case("4.15/7", name="not-whole", hazards=_MOTION)
def test_unfinished_upload(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program whose upload stopped after the name never ends with success."""
    require_command(subject, RUN)
    subject.moved = True
    name = subject.new_name()
    other = subject.open() if subject.supports_multiple_connections else line
    if not other.ask("upload_name", name).accepted:
        return
    first = try_request(line, RUN, name)
    if first is not None and first.accepted:
        expect(
            not wait_for_result(subject, line, RUN).done,
            "a program without content ended with success",
            expected="0|20",
            observed="1, 11",
        )


@case("4.15/8", "4/6", hazards=_MOTION)
def test_second_run(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """During a run, a second run of the same program or of another one is refused."""
    other = upload_wait_program(subject, line, 0)
    if subject.dialect["busy_reply"] == "queue":
        return
    with executing_task(subject, line, RUN) as task:
        for program in (task.program, other, task.program):
            reply = try_request(line, RUN, program)
            expect(
                reply is None or not reply.accepted,
                "a second run was accepted during a run",
                expected="0|01",
                observed=f"{reply}",
            )
        if subject.supports_multiple_connections:
            reply = try_request(subject.open(), RUN, other)
            expect(
                reply is None or not reply.accepted,
                "a second run was accepted during a run of another client",
                expected="0|01",
                observed=f"{reply}",
            )
        running = line.ask("get_running_program").value
        expect(
            running is None or running.name == task.program,
            "a refused run replaced the running program",
            expected=task.program.decode(),
            observed=f"{running}",
        )
    stop_motion(subject, line)
