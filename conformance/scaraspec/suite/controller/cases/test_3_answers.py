"""Clause 3: every valid request is answered under its own opcode, also in long sessions."""

from typing import Final

from hypothesis import settings

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import expect_round_trip
from scaraspec.suite.controller.harness.requests.queries import (
    Query,
    some_queries,
    supported_queries,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.user_message import UserMessage

_STATE: Final = (Hazard.STATE,)
_REQUESTS_PER_EXAMPLE: Final = 60  # requests for each configured example
_FILES_PER_EXAMPLE: Final = 2
_FILE_BYTES: Final = 300
_CONSTANT: Final = (
    "get_network",
    "get_version",
    "get_gripper_center",
    "get_initial_tool_position",
)
_SETTINGS: Final = (
    ("get_gripper_center", "set_gripper_center"),
    ("get_initial_tool_position", "set_initial_tool_position"),
    ("get_time", "set_time"),
)


# ---------------------------------------------------------------------- own opcode


@case("3/11")
def test_opcodes_of_queries(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every query is answered under its own opcode."""
    for query in examples(supported_queries(subject)):
        _expect_own_opcode(line, *query)
    _expect_own_opcode(line, "download_name", subject.new_name())


@case("3/11", name="settings", hazards=_STATE)
def test_opcodes_of_settings(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Settings that are set to their current values, and an upload, keep their opcodes."""
    for name, setter in examples(_SETTINGS):
        value = line.ask(name).value
        if value is not None and setter not in subject.ics.unsupported:
            _expect_own_opcode(line, setter, value)
    _expect_own_opcode(line, "upload_name", subject.new_name())
    if subject.access.needs_login:
        _expect_own_opcode(line, "login", subject.password)


@case("3/11", name="loss", hazards=(Hazard.DESTRUCTIVE,))
def test_opcode_of_a_deletion(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The deletion of a missing file is answered under its own opcode."""
    _expect_own_opcode(line, "delete_program", subject.new_name())


def _expect_own_opcode(line: OutgoingConnection, name: str, value: object = None) -> ReceivedFrame:
    """Send a request; if the reply is missing, report whether it came under another opcode.

    Raises:
        CaseFailed: The reply has another opcode.
        NoReply: There is no reply.
    """
    try:
        return line.ask(name, value)
    except NoReply as error:
        if not line.inbox:
            error.requirement = "3/31"
            raise
        raise CaseFailed(
            UserMessage("{name} was answered under another opcode", name=name),
            expected=f"{BY_NAME[name].opcode:02X}",
            observed=f"{line.inbox[0].frame}",
            requirement="3/11",
        ) from None


# ---------------------------------------------------------------------- every request


@case("3/31")
@given(queries=some_queries)
def test_queries_one_by_one(subject: ControllerUnderTest, queries: list[Query]) -> None:
    """Queries in any order are answered one by one."""
    line = subject.open()
    for query in supported_queries(subject, queries, unanswered=True):
        line.ask(*query)
    line.close()


@case("3/31", name="twice")
def test_queries_twice(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every query that is sent twice in a row is answered twice."""
    for query in examples(supported_queries(subject)):
        line.ask(*query)
        line.ask(*query)


@case("3/31", name="after-refusals")
def test_queries_after_refusals(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Valid requests are answered after each of many refused requests."""
    missing = subject.new_name()
    for _ in range(50):
        line.ask("download_name", missing)
        line.ask("get_status")


@case("3/31", name="long-session")
def test_long_session(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Thousands of queries on one connection are all answered, the last like the first."""
    queries = supported_queries(subject)
    rounds = settings().max_examples * _REQUESTS_PER_EXAMPLE // len(queries)
    first_data: dict[str, bytes] = {}
    for number in range(rounds):
        for query in queries:
            data = line.ask(*query).frame.data
            expect(
                query.name not in _CONSTANT or first_data.setdefault(query.name, data) == data,
                UserMessage(
                    "in round {number} of a long session, {query} has another reply",
                    number=number,
                    query=query.name,
                ),
                expected=show(first_data.get(query.name, b"")),
                observed=show(data),
            )
        line.inbox.clear()


@case("3/31", name="many-files", hazards=_STATE)
def test_many_files(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Many files are uploaded, downloaded and deleted on one connection, and all are unchanged."""
    content = content_of(_FILE_BYTES)
    for _ in range(settings().max_examples * _FILES_PER_EXAMPLE):
        expect_round_trip(subject, line, content)
