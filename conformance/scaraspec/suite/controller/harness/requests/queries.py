"""Queries: read-only requests that any case may send at any time.

The query of the default program is not included, because it may remain unanswered (A-4.12-2).
"""

from typing import Any, Final, NamedTuple

from hypothesis import strategies as st

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.connection import ReceivedFrame


class Query(NamedTuple):
    """A read-only request and its value."""

    name: str
    value: Any = None

    def frame(self, line: OutgoingConnection) -> Frame:
        """Return its frame."""
        return line.request(self.name, self.value)


QUERIES: Final = (
    Query("get_network"),
    Query("get_time"),
    Query("get_version"),
    Query("get_status"),
    Query("get_running_program"),
    Query("list_programs"),
    Query("get_motor_temperatures"),
    Query("get_gripper_center"),
    Query("get_initial_tool_position"),
    Query("get_tool_coordinates"),
    Query("get_joint_angles"),
    Query("get_digital_inputs"),
    Query("get_analog_input", 1),
    Query("get_digital_outputs"),
)

some_queries = st.lists(st.sampled_from(QUERIES), min_size=1, max_size=12)
"""Queries in any order and number."""


def supported_queries(
    subject: ControllerUnderTest,
    queries: tuple[Query, ...] | list[Query] = QUERIES,
    *,
    unanswered: bool = False,
) -> list[Query]:
    """Return the queries that the ICS does not exclude and that have been answered so far.

    Args:
        subject: The controller under test.
        queries: The queries to select from.
        unanswered: Also return queries that were never answered: they fail their own case, 3/31.
    """
    excluded = subject.ics.unsupported | (frozenset() if unanswered else subject.unanswered)
    return [query for query in queries if query.name not in excluded]


def ask_all(subject: ControllerUnderTest, line: OutgoingConnection) -> list[ReceivedFrame]:
    """Send each supported query once, and return the replies.

    Raises:
        NoReply: A query was not answered.
    """
    return [line.ask(*query) for query in supported_queries(subject)]


def wait_for_replies(line: OutgoingConnection, queries: list[Query]) -> list[ReceivedFrame]:
    """Wait for the replies to queries that were sent, in any order.

    Raises:
        NoReply: A reply does not arrive.
    """
    return [line.reply(query.name) for query in queries]


def opcodes_of(*names: str) -> frozenset[int]:
    """Return the opcodes of these commands."""
    return frozenset(BY_NAME[name].opcode for name in names)
