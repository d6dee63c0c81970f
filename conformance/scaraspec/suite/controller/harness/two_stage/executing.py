"""Executing: the status and the replies of the subject while a two-stage command executes.

A command may end just before a query. Such a reply is not counted as a failure.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

from hypothesis.errors import Flaky

from scaraspec.protocol import errors
from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.fields import show
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.two_stage.results import poll_result
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    preparation,
)
from scaraspec.suite.program_files.layout import configured, find_layout
from scaraspec.suite.program_files.writing import wait_program
from scaraspec.user_message import UserMessage

_IDLE: Final = "00"
_RUNNING: Final = ("01", "02")  # L1018-1019
_REST_S: Final = 1.0  # the status must be idle within this time after a final result


@preparation()
def store_wait_program(
    subject: ControllerUnderTest, line: OutgoingConnection, seconds: int, name: bytes = b""
) -> bytes:
    """Upload a program that waits for a time, in seconds; by default under a new name.

    Returns:
        The name of the program.

    Raises:
        CaseFailed: The subject runs no programs, or refuses the upload.
    """
    layout, base = find_layout(subject, line), configured(subject, line)
    name = name or subject.new_name()
    upload(line, name, wait_program(subject.dialect, seconds, layout=layout, base=base))
    return name


@contextmanager
def skip_if_other_program_runs(
    subject: ControllerUnderTest, line: OutgoingConnection | None = None
) -> Iterator[None]:
    """Skip the case instead of failing it if the robot runs a program of another client.

    Both the status and the running program must show this.

    Args:
        subject: The subject.
        line: A connection to it; None closes all connections and opens a new one.

    Raises:
        CaseSkipped: The robot runs a program that the suite did not start.
    """
    try:
        yield
    except (CaseFailed, CaseInconclusive, Flaky):
        name = b""
        with suppress(CaseFailed, CaseInconclusive):
            if line is None:
                subject.close_lines()
            name = _program_of_others(subject, line or subject.open())
        if name:
            message = UserMessage(
                "the robot runs the program {name} of another client: stop it and try again",
                name=show(name),
            )
            raise CaseSkipped(message) from None
        raise


def _program_of_others(subject: ControllerUnderTest, line: OutgoingConnection) -> bytes:
    status, running = line.ask("get_status").value, line.ask("get_running_program").value
    if status not in _RUNNING or not isinstance(running, RunningProgram):
        return b""
    return b"" if running.name.startswith(subject.files.prefix) else running.name


def ask_while_executing(
    subject: ControllerUnderTest, line: OutgoingConnection, query: str, command: str
) -> ReceivedFrame:
    """Send a query while a command executes.

    Raises:
        NoReply: Neither the query nor the command before it is answered.
        CaseSkipped: The query is answered only after the command has ended (A-4-3).
    """
    try:
        return line.ask(query)
    except NoReply:
        if line.ending is not None:
            raise
        line.send("emergency_stop")
        stopped = _replied(subject, line)
        if poll_result(line, command, 0 if stopped else subject.longest_s) is None and not stopped:
            raise
    raise CaseSkipped(
        UserMessage(
            "{query} is not answered while {command} executes", query=query, command=command
        )
    )


def _replied(subject: ControllerUnderTest, line: OutgoingConnection) -> bool:
    try:
        line.reply("emergency_stop", within_s=subject.reply_s)
    except NoReply:
        return False
    return True


def expect_status(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    command: str,
    expected: str,
    requirement: str,
) -> bool:
    """Require a status while a command executes.

    Returns:
        Whether the command still executes.

    Raises:
        CaseFailed: The status is another one.
        CaseSkipped: The status is not reported while a command executes.
        CaseInconclusive: The status reports a fault.
    """
    answer = ask_while_executing(subject, line, "get_status", command)
    if answer.value == expected:
        return True
    if answer.value == _IDLE and poll_result(line, command, subject.lag.result_s) is not None:
        return False
    require_no_fault(answer)
    message = UserMessage(
        "the status is {status} while {command} executes",
        status=answer.value,
        command=command,
    )
    raise CaseFailed(message, expected=expected, observed=f"{answer}", requirement=requirement)


def require_no_fault(status: ReceivedFrame) -> errors.Code | None:
    """Return the code of table 8-1 in a status; None if it has none.

    Raises:
        CaseInconclusive: The status reports a fault of the robot, which the suite does not judge.
    """
    code = errors.lookup(status.value) if isinstance(status.value, str) else None
    if code is not None and code.kind is errors.Kind.FAULT:
        raise CaseInconclusive(
            UserMessage(
                "the robot reports the fault {code} ({meaning}): clear it and try again",
                code=code.text,
                meaning=code.meaning,
            )
        )
    return code


def expect_idle(subject: ControllerUnderTest, line: OutgoingConnection, message: str) -> None:
    """Require that the status becomes 00 within a second.

    Raises:
        CaseFailed: The status has another value after a second.
    """
    try:
        subject.wait_until_idle(line, within_s=_REST_S)
    except CaseInconclusive as error:
        raise CaseFailed(
            message, expected=_IDLE, observed=f"{error}", requirement="4.8/3"
        ) from None


def wait_until_idle(
    subject: ControllerUnderTest, line: OutgoingConnection, command: str, lasts_s: float = 0.0
) -> None:
    """Wait for the end of a command that takes a time, in seconds of the subject's clock.

    Raises:
        NoReply: The command does not end.
        CaseFailed: The robot is not idle afterwards.
    """
    within_s = subject.longest_s + lasts_s / subject.ics.time_scale
    line.result(command, within_s=within_s)
    expect_idle(
        subject,
        line,
        UserMessage("the robot is not idle after the end of {command}", command=command),
    )
