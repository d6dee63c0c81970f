"""Refusals: checks the form of first replies and results of two-stage commands.

Open points are tolerated as in the register: which code is used (A-0-7), whether a busy robot
replies (A-4-2), and when a missing program is reported (A-4.15-1).
"""

from contextlib import nullcontext
from typing import Any, Final

from scaraspec.protocol import errors
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.fields import Defect
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.two_stage.commands import JOG, RELEASE, STOP, try_request
from scaraspec.suite.controller.harness.two_stage.results import locked_afterwards, wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import Task
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import expect
from scaraspec.user_message import UserMessage

_FAILURES: Final = errors.FAILURES | {errors.TABLE_8_1["00"], errors.TABLE_8_1["20"]}
"""Includes the codes of an interrupted command (A-4.17-4) and a missing program (A-4.15-1)."""
_MISSING: Final = "20"  # L1044


def text_of(answer: ReceivedFrame) -> bytes:
    """Return the data of a reply without the trailing NUL that A-T-3 tolerates."""
    return answer.frame.data.rstrip(b"\0")


def expect_first_reply(name: str, answer: ReceivedFrame) -> None:
    """Require that a first reply is "1" or "0|code" (4/1).

    Raises:
        CaseFailed: The reply has another form.
    """
    if name == STOP and text_of(answer)[:1] == b"0":
        return  # 4.17/2 judges the data after the flag
    issues = answer.seen.parsed.decoded.issues if answer.seen.parsed else ()
    malformed = any(
        each.defect in (Defect.FLAG, Defect.FIELD_COUNT, Defect.NO_CODE) for each in issues
    )
    expect(
        answer.accepted is not None and not malformed,
        UserMessage("the first reply to {command} is neither 1 nor 0|code", command=name),
        expected=BY_NAME[name].reply.form,
        observed=f"{answer}",
        requirement="4/1",
    )


def expect_refusal(subject: ControllerUnderTest, answer: ReceivedFrame) -> None:
    """Require that the code of a refusal is in table 8-1 (4/4).

    Raises:
        CaseFailed: The code is not in the table.
    """
    _expect_code(subject, answer, errors.REFUSALS, "4/4", "A-0-7")


def expect_failure(subject: ControllerUnderTest, answer: ReceivedFrame) -> None:
    """Require that the code of a failure is in table 8-1 (4/5).

    Raises:
        CaseFailed: The code is not in the table.
    """
    _expect_code(subject, answer, _FAILURES, "4/5", "A-8-5")


def _expect_code(
    subject: ControllerUnderTest,
    answer: ReceivedFrame,
    usual: frozenset[errors.Code],
    requirement: str,
    entry: str,
) -> None:
    zeros = b"00" if answer.frame.tagged else b"0"
    text = text_of(answer).removeprefix(zeros)[1:]
    if not text:  # other checks judge the form
        return
    code = errors.lookup(text.decode("latin-1"))
    expect(
        code is not None,
        "the code of a refusal or a failure is not one of table 8-1",
        expected="a code of table 8-1",
        observed=f"{answer}",
        requirement=requirement,
    )
    if code is not None and code not in usual:
        message = UserMessage(
            "a refusal or a failure has the code {code} ({meaning})",
            code=code.text,
            meaning=code.meaning,
        )
        subject.tolerate(requirement, entry, code.text, message)


def expect_busy(
    subject: ControllerUnderTest, line: OutgoingConnection, task: Task, name: str, value: Any = None
) -> None:
    """Require that the subject refuses a command while a task executes (4/6, 4/15).

    Raises:
        CaseFailed: The subject accepts it, or reports a state other than its own.
        CaseSkipped: The task ended before the reply.
    """
    answer = try_request(line, name, value)
    if answer is None:
        message: str = UserMessage("the busy robot did not answer {name}", name=name)
        subject.tolerate("4/6", "busy_reply", "silence", message)
        return
    if answer.accepted and name == task.name == JOG:
        message = "a second jog replaced the first one"
        subject.tolerate("4/6", "A-4.28-5", "replace", message)
        return
    if task.finished_before(answer):
        with locked_afterwards(subject, line) if name == RELEASE else nullcontext():
            task.require_executing()
    expect(
        not answer.accepted,
        UserMessage("{name} was accepted while {task} executed", name=name, task=task.name),
        expected=f"0|{task.state}",
        observed=f"{answer}",
        requirement="4/6",
    )
    expect_first_reply(name, answer)
    if answer.code in BUSY:
        expect(
            answer.code == task.state,
            UserMessage(
                "{command} was refused during {task} with a code other than the state of the robot",
                command=name,
                task=task.name,
            ),
            expected=f"0|{task.state}",
            observed=f"{answer}",
            requirement="4/15",
        )
    expect_refusal(subject, answer)


def expect_missing_program(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    name: str,
    program: bytes,
    requirement: str,
) -> None:
    """Require that the subject reports a missing program, at once or later (A-4.15-1).

    Raises:
        CaseFailed: It reports something else.
    """
    subject.moved = True
    first = line.ask(name, program)
    last = wait_for_result(subject, line, name) if first.accepted else first
    expect(
        not last.done and last.code == _MISSING,
        UserMessage(
            "{command} of a program that is not stored is not answered with code 20", command=name
        ),
        expected="0|20",
        observed=f"{first}"
        if last is first
        else UserMessage("{first}, then {second}", first=first, second=last),
        requirement=requirement,
    )
    if first.accepted:
        message = "the missing program was reported only after the first reply"
        subject.tolerate(requirement, "A-4.15-1", "00|20", message)
