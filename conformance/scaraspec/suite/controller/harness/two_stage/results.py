"""Results: how a case ends a two-stage command and waits for its final result."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from scaraspec.judge.requirements import SUCCESS
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.errors import BUSY
from scaraspec.suite.controller.harness.controller_under_test import (
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    status_of,
    stop_motion,
    wait_for_end,
)
from scaraspec.suite.controller.harness.timeouts import ExpectedReply
from scaraspec.suite.controller.harness.two_stage.commands import LOCK, RELEASE, STOP, begin
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import CaseFailed, NoReply
from scaraspec.user_message import UserMessage


def stop_while_idle(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Send an emergency stop to an idle robot, which may accept or refuse it (A-4.17-1).

    The stop does not affect commands that start later.
    """
    subject.moved = True
    if STOP not in subject.ics.unsupported and line.ask(STOP).accepted:
        wait_for_result(subject, line, STOP)
        stop_motion(subject, line)


def wait_for_result(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    name: str,
    *,
    within_s: float | None = None,
) -> ReceivedFrame:
    """Wait for a final result; see `wait_for_end`.

    Raises:
        NoReply: No final result arrives.
    """
    answer = wait_for_end(subject, line, name, within_s=within_s)
    if answer is None:
        message = UserMessage(
            "no final result of {command} came while the robot was busy (motion.longest_s of the "
            "ICS at most) or after it",
            command=name,
        )
        error = line.no_reply_error(message)
        error.expected = f"{C2A.start:02X} 90 {BY_NAME[name].opcode:02X} …"
        error.requirement = SUCCESS[name]
        error.depends_on = line.dependency(ExpectedReply(name, result=True))
        raise error
    return answer


def expect_success(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> ReceivedFrame:
    """Wait for a final result that reports success.

    Raises:
        CaseFailed: The result reports a failure, or does not arrive.
    """
    answer = wait_for_result(subject, line, name)
    if answer.frame.data.rstrip(b"\0") != b"11":
        raise CaseFailed(
            UserMessage("{command} does not end with success", command=name),
            expected="11",
            observed=f"{answer}",
            requirement=SUCCESS[name],
        )
    return answer


def release_joints(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> tuple[ReceivedFrame, ReceivedFrame | None]:
    """Release the joints.

    Returns:
        The first reply, and the final result; None if it comes only when the joints are locked
        again (A-4.25-2).

    Raises:
        CaseFailed: The idle robot refuses the command.
    """
    first = begin(subject, line, RELEASE)
    deadline = Deadline(subject, subject.reply_s)
    while True:
        with suppress(NoReply):
            return first, line.result(RELEASE, within_s=SILENCE_S)
        if deadline.expired or line.ended or status_of(subject, line) not in (*BUSY, None):
            return first, None


@contextmanager
def locked_afterwards(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[None]:
    """Lock the joints when the context ends."""
    try:
        yield
    finally:
        with suppress(CaseFailed):
            if line.ask(LOCK).accepted:
                wait_for_result(subject, line, LOCK)


def interrupted_result(line: OutgoingConnection, name: str) -> ReceivedFrame | None:
    """Return the final result of a stopped command; None if it has none (A-4.17-4)."""
    try:
        return line.result(name, within_s=SILENCE_S)
    except NoReply:
        return None


def poll_result(
    line: OutgoingConnection, command: str, within_s: float = 0.0
) -> ReceivedFrame | None:
    """Return the final result of a command if it arrives in time; else None."""
    try:
        return line.result(command, within_s=within_s)
    except NoReply:
        return None
