"""Delivery: the same bytes in other segments: cut, joined, slow. What they say is not changed."""

import itertools
from collections.abc import Iterable
from typing import Final

from hypothesis import strategies as st

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.queries import (
    Query,
    supported_queries,
    wait_for_replies,
)

SEGMENT_S: Final = 0.02
"""A pause that keeps what follows out of the segment before."""

SLOWEST_S: Final = 0.9
"""Of 1 s inside a frame, which has to be survived (A-3-11), less what a link adds to a pause."""

segment_sizes = st.lists(st.integers(1, 60), max_size=12)
"""How many bytes the segments have, one after the other; the rest is the last."""


def split_bytes(data: bytes, sizes: Iterable[int]) -> list[bytes]:
    """Cut into pieces of these sizes; the rest is the last."""
    ends = itertools.accumulate(sizes, initial=0)
    cuts = [*[end for end in ends if end < len(data)], len(data)]
    return [data[begin:end] for begin, end in itertools.pairwise(cuts)]


def send_parts(
    line: OutgoingConnection, parts: Iterable[bytes], subject: ControllerUnderTest, pause_s: float
) -> None:
    """Send parts one by one, with a pause between them."""
    for number, part in enumerate(parts):
        if number:
            subject.pause(pause_s)
        line.send_bytes(part)


def serves_one_at_a_time(subject: ControllerUnderTest) -> bool:
    """Whether the subject claims to serve no request that comes before the reply to another."""
    return subject.dialect["pipelining"] == "one"


def ask_together(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    queries: list[Query],
    sizes: Iterable[int] = (),
) -> None:
    """Send queries without waiting, in segments of these sizes or all in one; await all replies.

    Raises:
        NoReply: One was not answered.
    """
    queries = supported_queries(subject, queries)
    data = b"".join(query.frame(line).encode() for query in queries)
    for part in split_bytes(data, sizes):
        line.send_bytes(part)
    wait_for_replies(line, queries)
