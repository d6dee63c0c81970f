"""Clause 4.11: delete a program (0x0C, L253-263).

Only programs that the suite uploaded are deleted, and no name is tried that another program could
have.
"""

from typing import Any, Final

from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import (
    Malformed,
    malformed,
    send_malformed,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import NameRefused, expect_stored, upload
from scaraspec.suite.controller.harness.requests.motion import stop_motion
from scaraspec.suite.controller.harness.two_stage.commands import RUN, try_request
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseSkipped, expect
from scaraspec.suite.program_files.layout import short_program
from scaraspec.suite.program_files.listed import INHERITED, long_name, program_names, store_program
from scaraspec.user_message import UserMessage

_DESTRUCTIVE: Final = (Hazard.STATE, Hazard.DESTRUCTIVE)
_REPEATS: Final = 3
_LONG_BYTES: Final = 25
"""Length of a program name, so that similar names do not exceed the allowed length (L226)."""
_STATE_QUERIES: Final = (
    "get_network",
    "get_gripper_center",
    "get_initial_tool_position",
    "get_version",
)


def _delete(line: OutgoingConnection, name: bytes) -> None:
    reply = line.ask("delete_program", name)
    expect(
        reply.accepted,
        "deleting a stored program was not answered 1",
        expected="1",
        observed=f"{reply}",
        requirement="4.11/2",
    )


def _expect_refused(
    subject: ControllerUnderTest, line: OutgoingConnection, wrong: Malformed, requirement: str
) -> OutgoingConnection:
    """Fail the case if the deletion of something that does not exist is answered 1.

    Returns:
        The connection to continue with.
    """
    attempt = send_malformed(subject, line, "delete_program", wrong)
    expect(
        not attempt.accepted,
        UserMessage("the deletion of {kind} was answered 1", kind=wrong.kind),
        expected="0",
        observed=UserMessage("{answer} to {data}", answer=attempt, data=show(wrong.data)),
        requirement=requirement,
    )
    return attempt.line


@case("4.11/3", "4.11/2", hazards=_DESTRUCTIVE)
def test_deleted_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A deleted program is not listed and cannot be downloaded, and its name can be used again."""
    content = short_program(subject)
    other, name = store_program(subject, line), store_program(subject, line)
    for _ in range(_REPEATS):
        _delete(line, name)
        expect(
            name not in program_names(subject, line),
            "a deleted program is still listed",
            expected="not in the list",
            observed=show(name),
        )
        expect(
            not line.ask("download_name", name).accepted,
            "a deleted program can be downloaded",
            expected="0",
            observed="1",
        )
        expect(
            not line.ask("delete_program", name).accepted,
            "a second deletion of the same program was answered 1",
            expected="0",
            observed="1",
            requirement="4.11/4",
        )
        upload(line, name, content)
    _delete(line, name)
    expect_stored(line, other, content, "4.11/3")
    _expect_only_named_deleted(subject, line)


def _expect_only_named_deleted(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Fail the case if the name is used as a pattern or as a prefix."""
    try:
        name = store_program(subject, line, subject.new_name(".a"))
        others = [name.replace(b".", b"x", 1), name + b".rob"]
        for other in others:
            store_program(subject, line, other)
    except NameRefused:
        return
    _delete(line, name)
    remaining = program_names(subject, line)
    for other in others:
        expect(
            other in remaining,
            UserMessage("deleting {name} also deleted {other}", name=show(name), other=show(other)),
            expected="still listed",
            observed="not in the list",
            requirement="4.10/11",
        )


@case("4.11/3", name="run", hazards=(*_DESTRUCTIVE, Hazard.MOTION))
def test_not_run(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A deleted program can be neither run nor simulated."""
    name = store_program(subject, line)
    _delete(line, name)
    try:
        for command in examples(("run_program", "simulate_program")):
            subject.moved = True
            reply = line.ask(command, name)
            if reply.accepted:  # it may fail later (A-4.15-1)
                reply = line.result(command)
            expect(
                not (reply.done or reply.accepted),
                UserMessage("{command} still finds a deleted program", command=command),
                expected="0|20",
                observed=f"{reply}",
            )
    finally:
        stop_motion(subject, line)


@case("4.11/3", "4.11/2", name="running", hazards=(*_DESTRUCTIVE, Hazard.MOTION))
def test_delete_running_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A running program is deleted or kept (A-4.11-1), as the reply to the deletion states."""
    with executing_task(subject, line, RUN) as task:
        reply = try_request(line, "delete_program", task.program)
        task.require_executing()
    if reply is None:
        raise CaseSkipped("the robot did not answer a deletion while a program ran (A-4-3)")
    listed = task.program in program_names(subject, line)
    if not reply.accepted:
        expect(
            listed,
            "deleting a running program was answered 0, but it is no longer listed",
            expected="still listed",
            observed=show(task.program),
            requirement="4.11/2",
        )
        return
    subject.tolerate("4.11/5", "delete_guard", "allow", "a running program was deleted")
    expect(
        not listed,
        "a program that was deleted while it ran is still listed afterwards",
        expected="not in the list",
        observed=show(task.program),
    )


@case("4.11/4", "4.11/2", hazards=_DESTRUCTIVE)
def test_missing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Deleting a name that is not stored is not answered 1, however similar it is to another."""
    name = store_program(subject, line, long_name(subject, _LONG_BYTES))
    content = short_program(subject)
    stem, dot, extension = name.rpartition(b".")
    free = subject.new_name()
    for wrong in examples(
        (
            free,
            name[:-1],
            stem,
            stem[:-1] + dot + extension,
            name + b"x",
            name[1:],
            stem + b"*" + dot + extension,
            stem[:-1] + b"?" + dot + extension,
            name[1::-1] + name[2:],  # the same letters in another order
            INHERITED,
        )
    ):
        line = _expect_refused(
            subject, line, Malformed("a program that is not stored", wrong), "4.11/4"
        )
    expect_stored(line, name, content, "4.11/4")


@case("4.11/6", "4.11/4", hazards=_DESTRUCTIVE)
def test_paths(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A name with path elements deletes nothing and changes nothing."""
    name, content = (
        store_program(subject, line),
        short_program(subject),
    )
    before = _read_state(line)
    for wrong in examples(
        (
            b"../" + name,
            b"./" + name,
            b"..\\" + name,
            b"/" + name,
            b"programs/" + name,
            b"../../../" + name,
            b"zs/../" + name,
            name + b"/",
        )
    ):
        line = _expect_refused(
            subject, line, Malformed("a name with path elements", wrong), "4.11/6"
        )
        expect_stored(line, name, content, "4.11/6")
    after = _read_state(line)
    expect(
        before == after,
        "names with path elements changed something else",
        expected=f"{before}",
        observed=f"{after}",
    )


def _read_state(line: OutgoingConnection) -> list[Any]:
    return [line.ask(name).value for name in _STATE_QUERIES]


@case("4.11/4", name="malformed", hazards=_DESTRUCTIVE)
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Malformed names delete nothing."""
    name, content = (
        store_program(subject, line),
        short_program(subject),
    )
    for wrong in examples(malformed("delete_program", name)):
        if b".." in wrong.data or wrong.data == b".":
            continue  # it may not belong to the suite
        line = _expect_refused(
            subject,
            line,
            wrong._replace(kind=UserMessage("a name with {wrong}", wrong=wrong)),
            "4.11/4",
        )
    expect_stored(line, name, content, "4.11/4")
