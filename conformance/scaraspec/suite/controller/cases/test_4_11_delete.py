"""Clause 4.11: deleting a program (0x0C, L253-263).

Only what the suite itself has uploaded is deleted, and no name is tried that something else could
bear.
"""

from typing import Any, Final

from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import Malformed, malformed, offer
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import NameRefused, expect_stored, upload
from scaraspec.suite.controller.harness.requests.motion import stop_motion
from scaraspec.suite.controller.harness.two_stage.tasks import RUN, lasting, try_request
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseSkipped, expect
from scaraspec.suite.program_files.layout import short_program
from scaraspec.suite.program_files.listed import INHERITED, long_name, program_names, store_program
from scaraspec.user_message import UserMessage

_DESTRUCTIVE: Final = (Hazard.STATE, Hazard.DESTRUCTIVE)
_TIMES: Final = 3
_LONG_BYTES: Final = 25
"""Of a name: near ones are not longer than names may be (L226)."""
_STATE: Final = ("get_network", "get_gripper_center", "get_initial_tool_position", "get_version")


def _delete(line: OutgoingConnection, name: bytes) -> None:
    answer = line.ask("delete_program", name)
    expect(
        answer.accepted,
        "a program that is stored was not deleted with the answer 1",
        expected="1",
        observed=f"{answer}",
        requirement="4.11/2",
    )


def _expect_refused(
    subject: ControllerUnderTest, line: OutgoingConnection, wrong: Malformed, requirement: str
) -> OutgoingConnection:
    """Fail the subject if it says that it has deleted what is not there.

    Returns:
        The connection to go on with.
    """
    try_request = offer(subject, line, "delete_program", wrong)
    expect(
        not try_request.accepted,
        UserMessage("{kind} was deleted with the answer 1", kind=wrong.kind),
        expected="0",
        observed=f"{try_request} to {show(wrong.data)}",
        requirement=requirement,
    )
    return try_request.line


@case("4.11/3", "4.11/2", hazards=_DESTRUCTIVE)
def test_gone(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """What was deleted is neither listed nor downloadable, and its name is free again."""
    content = short_program(subject)
    other, name = store_program(subject, line), store_program(subject, line)
    for _ in range(_TIMES):
        _delete(line, name)
        expect(
            name not in program_names(subject, line),
            "a program that was deleted is still listed",
            expected="not in the list",
            observed=show(name),
        )
        expect(
            not line.ask("download_name", name).accepted,
            "a program that was deleted can be downloaded",
            expected="0",
            observed="1",
        )
        expect(
            not line.ask("delete_program", name).accepted,
            "a program that was deleted before was deleted with the answer 1",
            expected="0",
            observed="1",
            requirement="4.11/4",
        )
        upload(line, name, content)
    _delete(line, name)
    expect_stored(line, other, content, "4.11/3")
    _goes_alone(subject, line)


def _goes_alone(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Fail the subject if it takes the name of what it deletes for a pattern or a beginning."""
    try:
        name = store_program(subject, line, subject.new_name(".a"))
        others = [name.replace(b".", b"x", 1), name + b".rob"]
        for other in others:
            store_program(subject, line, other)
    except NameRefused:
        return
    _delete(line, name)
    left = program_names(subject, line)
    for other in others:
        expect(
            other in left,
            UserMessage(
                "the deletion of {name} took {other} along", name=show(name), other=show(other)
            ),
            expected="listed still",
            observed="not in the list",
            requirement="4.10/11",
        )


@case("4.11/3", name="run", hazards=(*_DESTRUCTIVE, Hazard.MOTION))
def test_not_run(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """What was deleted can be neither run nor simulated."""
    name = store_program(subject, line)
    _delete(line, name)
    try:
        for command in examples(("run_program", "simulate_program")):
            subject.moved = True
            answer = line.ask(command, name)
            if answer.accepted:  # it may fail late (A-4.15-1)
                answer = line.result(command)
            expect(
                not (answer.done or answer.accepted),
                UserMessage("{command} still finds a program that was deleted", command=command),
                expected="0|20",
                observed=f"{answer}",
            )
    finally:
        stop_motion(subject, line)


@case("4.11/3", "4.11/2", name="running", hazards=(*_DESTRUCTIVE, Hazard.MOTION))
def test_while_it_runs(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program that runs may be deleted or not (A-4.11-1); afterwards the answer holds."""
    with lasting(subject, line, RUN) as task:
        answer = try_request(line, "delete_program", task.program)
        task.lasts()
    if answer is None:
        raise CaseSkipped("the robot did not answer a deletion while a program ran (A-4-3)")
    listed = task.program in program_names(subject, line)
    if not answer.accepted:
        expect(
            listed,
            "a program that ran was deleted with the answer 0",
            expected="listed still",
            observed=show(task.program),
            requirement="4.11/2",
        )
        return
    subject.tolerate("4.11/5", "delete_guard", "allow", "a program was deleted while it ran")
    expect(
        not listed,
        "a program that was deleted while it ran is listed afterwards",
        expected="not in the list",
        observed=show(task.program),
    )


@case("4.11/4", "4.11/2", hazards=_DESTRUCTIVE)
def test_missing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A name that is not stored is not answered 1, however like a stored one it is."""
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
            name[:1] + name[2:0:-1] + name[3:],  # of the same letters, and nobody's
            INHERITED,
        )
    ):
        line = _expect_refused(
            subject, line, Malformed("a program that is not stored", wrong), "4.11/4"
        )
    expect_stored(line, name, content, "4.11/4")


@case("4.11/6", "4.11/4", hazards=_DESTRUCTIVE)
def test_paths(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A name with path elements deletes nothing, and changes nothing else either."""
    name, content = (
        store_program(subject, line),
        short_program(subject),
    )
    before = _state(line)
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
    after = _state(line)
    expect(
        before == after,
        "names with path elements have changed something else",
        expected=f"{before}",
        observed=f"{after}",
    )


def _state(line: OutgoingConnection) -> list[Any]:
    return [line.ask(name).value for name in _STATE]


@case("4.11/4", name="malformed", hazards=_DESTRUCTIVE)
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Names that are none delete nothing, and what is stored remains."""
    name, content = (
        store_program(subject, line),
        short_program(subject),
    )
    for wrong in examples(malformed("delete_program", name)):
        if b".." in wrong.data or wrong.data == b".":
            continue  # what is there is not the suite's
        line = _expect_refused(subject, line, wrong._replace(kind=f"a name with {wrong}"), "4.11/4")
    expect_stored(line, name, content, "4.11/4")
