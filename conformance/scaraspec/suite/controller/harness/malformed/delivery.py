"""Delivery: sends the same bytes in other segments: split, joined or slow."""

from collections.abc import Iterable
from random import Random
from typing import Final

from hypothesis import strategies as st

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import (
    OutgoingConnection,
    split_bytes,
)
from scaraspec.suite.controller.harness.requests.queries import (
    Query,
    supported_queries,
    wait_for_replies,
)
from scaraspec.suite.engine.expectations import CaseSkipped
from scaraspec.suite.engine.transfer_timeouts import transfer_timeouts_of

_LIMIT_S: Final = 1.0
"""The pause inside a frame that a controller must survive (A-3-11), in seconds of its clock."""
_LINK_S: Final = 0.1
"""How much longer a pause may become on a link, or because this machine is busy."""
SLOWEST_S: Final = _LIMIT_S - _LINK_S
"""The longest pause inside a frame, in seconds."""
_PART_OF_TRANSFER: Final = 0.5  # a transfer may pause twice as long


def longest_pause_s(subject: ControllerUnderTest) -> float:
    """Return the longest pause inside a frame in our seconds, also during a transfer.

    Delays are as long for a fast subject. The pause leaves room for them, and is at least half of
    the limit.
    """
    of_transfer_s = _PART_OF_TRANSFER * transfer_timeouts_of(subject).must_survive_s
    limit_s = _LIMIT_S / subject.ics.time_scale
    return min(max(limit_s - _LINK_S, limit_s / 2), of_transfer_s)


segment_sizes = st.lists(st.integers(1, 60), max_size=12)
"""The sizes of the segments in bytes; the rest is the last segment."""


def send_parts(
    line: OutgoingConnection, parts: Iterable[bytes], subject: ControllerUnderTest, pause_s: float
) -> None:
    """Send parts one by one, with a pause between them, in seconds."""
    for number, part in enumerate(parts):
        if number:
            subject.pause(pause_s)
        line.send_bytes(part)


def ask_slowly(subject: ControllerUnderTest, random: Random) -> None:
    """Send a query on another connection, with the longest pause at any place in it.

    Nothing is sent if there can be no other connection, or if a query may remain unanswered while
    a program runs (A-4-3).

    Raises:
        NoReply: The query was not answered.
    """
    if subject.traits.unresponsive_while_executing is not False:
        return
    if not subject.supports_multiple_connections:
        return
    line, query = subject.open(), random.choice(supported_queries(subject))
    frame = query.frame(line).encode()
    parts = split_bytes(frame, (random.randrange(1, len(frame)),))
    send_parts(line, parts, subject, longest_pause_s(subject))
    line.reply(query.name)
    line.close()


def serves_one_at_a_time(subject: ControllerUnderTest) -> bool:
    """Whether the subject claims to serve no request before it has replied to the last one."""
    return subject.dialect["pipelining"] == "one"


def require_pipelining(subject: ControllerUnderTest) -> None:
    """Skip the case if the subject claims to serve one request at a time.

    Raises:
        CaseSkipped: It claims this.
    """
    if serves_one_at_a_time(subject):
        raise CaseSkipped("the controller serves one request at a time (pipelining)")


def ask_together(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    queries: list[Query],
    sizes: Iterable[int] = (),
) -> None:
    """Send queries together, in segments of these sizes or in one, and wait for all replies.

    Raises:
        NoReply: A query was not answered.
    """
    queries = supported_queries(subject, queries)
    data = b"".join(query.frame(line).encode() for query in queries)
    for part in split_bytes(data, sizes):
        line.send_bytes(part)
    wait_for_replies(line, queries)
