"""Clause 3: every valid request is answered, under its own opcode, however long it goes on."""

from typing import Final

from hypothesis import settings

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import expect_round_trip
from scaraspec.suite.controller.harness.requests.queries import Query, known_to, some_queries
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.user_message import UserMessage

_STATE: Final = (Hazard.STATE,)
_LONG: Final = 60  # requests for each example that is asked for
_FILES: Final = 2
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


# ---------------------------------------------------------------------- under its opcode


@case("3/11")
def test_opcodes_of_queries(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every query is answered under the opcode that it has."""
    for query in examples(known_to(subject)):
        _ask_under_its_opcode(line, *query)
    _ask_under_its_opcode(line, "download_name", subject.new_name())


@case("3/11", name="settings", hazards=_STATE)
def test_opcodes_of_settings(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Settings, which are set to what they are, and an upload are answered under their opcodes."""
    for name, setter in examples(_SETTINGS):
        value = line.ask(name).value
        if value is not None and setter not in subject.ics.unsupported:
            _ask_under_its_opcode(line, setter, value)
    _ask_under_its_opcode(line, "upload_name", subject.new_name())
    if subject.access.needs_login:
        _ask_under_its_opcode(line, "login", subject.password)


@case("3/11", name="loss", hazards=(Hazard.DESTRUCTIVE,))
def test_opcode_of_a_deletion(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The deletion of a file that is not there is answered under its opcode."""
    _ask_under_its_opcode(line, "delete_program", subject.new_name())


def _ask_under_its_opcode(
    line: OutgoingConnection, name: str, value: object = None
) -> ReceivedFrame:
    """Ask, and where the reply is not found, say whether it came under another opcode.

    Raises:
        CaseFailed: It did.
        NoReply: It did not come at all.
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


# ---------------------------------------------------------------------- at all


@case("3/31")
@given(queries=some_queries)
def test_queries_one_by_one(subject: ControllerUnderTest, queries: list[Query]) -> None:
    """Queries in any order, with others before and behind, are answered one by one."""
    line = subject.open()
    for query in known_to(subject, queries):
        line.ask(*query)
    line.close()


@case("3/31", name="twice")
def test_queries_twice(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every query is asked twice in a row, and is answered twice."""
    for query in examples(known_to(subject)):
        line.ask(*query)
        line.ask(*query)


@case("3/31", name="after-refusals")
def test_behind_refusals(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Behind each of many requests that are refused, valid ones are answered."""
    missing = subject.new_name()
    for _ in range(50):
        line.ask("download_name", missing)
        line.ask("get_status")


@case("3/31", name="long-session")
def test_long_session(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Thousands of queries on one connection are all answered, the last ones as the first."""
    queries = known_to(subject)
    rounds = settings().max_examples * _LONG // len(queries)
    said: dict[str, bytes] = {}
    for number in range(rounds):
        for query in queries:
            data = line.ask(*query).frame.data
            expect(
                query.name not in _CONSTANT or said.setdefault(query.name, data) == data,
                UserMessage(
                    "in round {number} of a long session {query} is answered otherwise",
                    number=number,
                    query=query.name,
                ),
                expected=show(said.get(query.name, b"")),
                observed=show(data),
            )
        line.inbox.clear()


@case("3/31", name="many-files", hazards=_STATE)
def test_many_files(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """File after file is sent, fetched and deleted on one connection, the last as the first."""
    content = content_of(_FILE_BYTES)
    for _ in range(settings().max_examples * _FILES):
        expect_round_trip(subject, line, content)
