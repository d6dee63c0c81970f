"""Clause 2: TCP carries a stream, and its segmentation has no meaning (L79; A-2-6)."""

import itertools
from collections.abc import Mapping
from typing import Final

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import (
    SLOWEST_S,
    ask_together,
    segment_sizes,
    send_parts,
    serves_one_at_a_time,
)
from scaraspec.suite.controller.harness.malformed.mutation_targets import (
    GET_STATUS,
    GET_TIME,
    GET_VERSION,
)
from scaraspec.suite.controller.harness.outgoing_connection import (
    SEGMENT_S,
    OutgoingConnection,
    split_bytes,
)
from scaraspec.suite.controller.harness.requests.queries import (
    Query,
    some_queries,
    supported_queries,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import NoReply
from scaraspec.user_message import UserMessage

_BURST_REQUESTS: Final = (
    250  # more than a kilobyte, the size of a small buffer; the judge tracks 256
)
_WITH_DATA: Final = [Query("get_analog_input", 1), Query("get_status")]
"""A query with data, and one that every controller supports."""
_QUERY_FRAMES: Final = (GET_TIME, GET_VERSION, GET_STATUS)


@case("2/5", slow=True)
def test_cut_at_every_byte(subject: ControllerUnderTest) -> None:
    """Requests split at every byte, and a login split into single bytes, are answered."""
    line = subject.open()
    for name in ("get_time", "get_version", "get_status"):
        frame = line.request(name).encode()
        for cut in examples(range(1, len(frame))):
            send_parts(line, (frame[:cut], frame[cut:]), subject, SEGMENT_S)
            line.reply(name)
    line.close()
    if not subject.access.needs_login:
        return
    login = _login(subject, line)
    halves = [(login[:cut], login[cut:]) for cut in range(1, len(login))]
    for parts in examples((*halves, split_bytes(login, [1] * len(login)))):
        line = subject.open(login=False)
        send_parts(line, parts, subject, SEGMENT_S)
        line.reply("login")
        line.close()


@case("2/5", name="slowly", slow=True)
def test_slowly(subject: ControllerUnderTest) -> None:
    """A request sent byte by byte, and a login in three parts, are answered despite 1 s pauses."""
    parts = {subject.open(): ("get_status", split_bytes(GET_STATUS, (1, 1, 1)))}
    if not subject.supports_multiple_connections:
        _send_slowly(subject, parts)
        parts.clear()
        subject.close_lines()
    if subject.access.needs_login:
        line = subject.open(login=False)
        parts[line] = ("login", split_bytes(_login(subject, line), (1, 5)))
    _send_slowly(subject, parts)


@case("2/5", name="pause")
def test_pause(subject: ControllerUnderTest) -> None:
    """Requests with pauses of almost a second are answered: three in a frame, one after data."""
    parts = {subject.open(): ("get_status", split_bytes(GET_STATUS, (1, 1, 1)))}
    if subject.supports_multiple_connections:
        line, query = subject.open(), supported_queries(subject, _WITH_DATA)[0]
        frame = query.frame(line).encode()
        parts[line] = (query.name, split_bytes(frame, (len(frame) - 1,)))
    _send_slowly(subject, parts)


def _send_slowly(
    subject: ControllerUnderTest, parts: Mapping[OutgoingConnection, tuple[str, list[bytes]]]
) -> None:
    """Send on several connections at the same time, part by part; wait for each reply."""
    for number, current_parts in enumerate(
        itertools.zip_longest(*(sent for _, sent in parts.values()))
    ):
        if number:
            subject.pause(SLOWEST_S / subject.ics.time_scale)
        for line, part in zip(parts, current_parts, strict=True):
            line.send_bytes(part or b"")
    for line, (name, _) in parts.items():
        line.reply(name)


@case("2/5", name="random")
@given(queries=some_queries, sizes=segment_sizes)
def test_random_cuts(subject: ControllerUnderTest, queries: list[Query], sizes: list[int]) -> None:
    """Consecutive queries in segments of random sizes are all answered."""
    line = subject.open()
    if serves_one_at_a_time(subject):
        for query in supported_queries(subject, queries):
            ask_together(subject, line, [query], sizes)
    else:
        ask_together(subject, line, queries, sizes)
    line.close()


@case("2/5", "2/6", name="across", slow=True)
def test_segments_across_frames(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Segments that contain the end of one frame and the start of the next are all answered."""
    for cut in examples(range(1, 4)):
        parts = split_bytes(b"".join(_QUERY_FRAMES * 2), (cut, *[4] * 5))
        send_parts(line, parts, subject, SEGMENT_S)
        for name in ("get_time", "get_version", "get_status") * 2:
            line.reply(name)


@case("2/6")
@given(queries=some_queries)
def test_several_in_one_segment(subject: ControllerUnderTest, queries: list[Query]) -> None:
    """Several queries in one segment are all answered."""
    line = subject.open()
    _expect_served_together(subject, line, queries)
    line.close()


@case("2/6", name="burst")
def test_burst(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Hundreds of requests in one segment are all answered.

    The first one has an odd length, so that a buffer of 256 bytes, or of any power of two, ends
    inside a request.
    """
    longer = Query("get_analog_input", 1)
    cycle = (Query("get_time"), Query("get_version"), Query("get_status"), longer)
    _expect_served_together(
        subject, line, [longer, *(cycle[n % len(cycle)] for n in range(_BURST_REQUESTS))]
    )


@case("2/6", name="login")
def test_login_and_more(subject: ControllerUnderTest) -> None:
    """A query in the same segment as the login is served, because the login comes first."""
    line = subject.open(login=False)
    login = _login(subject, line) if subject.access.needs_login else b""
    line.send_bytes(login + GET_STATUS)
    if login:
        line.reply("login")
    _expect_reply_or_one_at_a_time(subject, line, "get_status")


def _login(subject: ControllerUnderTest, line: OutgoingConnection) -> bytes:
    return line.request("login", subject.password).encode()


def _expect_served_together(
    subject: ControllerUnderTest, line: OutgoingConnection, queries: list[Query]
) -> None:
    """Expect a reply to each query, or only to the first if the ICS claims so (A-3-14)."""
    if not serves_one_at_a_time(subject):
        ask_together(subject, line, queries)
        return
    served = supported_queries(subject, queries)[:1]
    line.send_bytes(
        b"".join(query.frame(line).encode() for query in supported_queries(subject, queries))
    )
    for query in served:
        line.reply(query.name)
    subject.tolerate("2/6", "pipelining", "one", "only the first request of a segment is served")


def _expect_reply_or_one_at_a_time(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> None:
    try:
        line.reply(name)
    except NoReply:
        if not serves_one_at_a_time(subject) or line.ending is not None:
            raise
        subject.tolerate(
            "2/6",
            "pipelining",
            "one",
            UserMessage("{name} after another request was not served", name=name),
        )
