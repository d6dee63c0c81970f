"""Passages: whose the time between a request and its reply was."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.redaction import Redactor
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk, Latency, LatencyTracker

MS = 1_000_000


def passage(event: WireEvent, forwarded_ns: int) -> ForwardedChunk:
    """The same bytes, passed on."""
    place = (event.time_ns, event.connection, event.direction, event.kind)
    return ForwardedChunk(*place, event.data, event.offset_bytes, 0, event.note, forwarded_ns)


def latencies(events: Sequence[WireEvent]) -> list[Latency | None]:
    """What is told of each exchange."""
    told, judge, found = LatencyTracker(), Judge(needs_login=False), []
    for event in events:
        told.write(event)
        for item in judge.feed(event):
            if isinstance(item, FrameSeen):
                told.frame(item)
            elif isinstance(item, Exchange):
                found.append(told.exchange(item))
    return found


@pytest.fixture
def asked(talk: Any) -> list[WireEvent]:
    """A request, and its reply after two milliseconds."""
    talk.ask("get_status", None, "00")
    events: list[WireEvent] = talk.events
    return events


def test_waiting_in_the_recorder_is_not_the_robots(asked: list[WireEvent]) -> None:
    """A request that lay in the recorder for half of the time left the robot the other half."""
    request, reply = asked
    events = [passage(request, request.time_ns + MS), passage(reply, reply.time_ns + MS // 4)]
    assert latencies(events) == [Latency(robot_ns=MS, recorder_ns=MS + MS // 4)]


def test_a_reply_counts_from_its_first_piece(asked: list[WireEvent]) -> None:
    """The robot has answered when its first byte comes in, however slow the rest is."""
    request, reply = asked
    begun = replace(reply, data=reply.data[:2])
    rest = replace(reply, data=reply.data[2:], offset_bytes=2, time_ns=reply.time_ns + 7 * MS)
    events = [passage(event, event.time_ns + 1000) for event in (request, begun, rest)]
    assert latencies(events) == [Latency(robot_ns=2 * MS - 1000, recorder_ns=2000)]


def test_half_a_knowledge_is_none(asked: list[WireEvent]) -> None:
    """Where one of the two was not seen passing on, nothing is told."""
    request, reply = asked
    assert latencies([passage(request, request.time_ns), reply]) == [None]
    assert latencies([request, passage(reply, reply.time_ns)]) == [None]
    assert latencies([passage(request, 0), passage(reply, reply.time_ns)]) == [None]


def test_frames_that_no_exchange_comes_for_are_forgotten(talk: Any) -> None:
    """A controller that talks and talks fills no memory."""
    told, judge = LatencyTracker(), Judge(needs_login=False)
    for _ in range(10_000):
        talk.send(C2A, Frame(C2A, 0x09, b"00").encode())
    for event in talk.events:
        told.write(passage(event, event.time_ns))
        for item in judge.feed(event):
            if isinstance(item, FrameSeen):
                told.frame(item)
    assert len(told._chunks) <= 5000


def test_redacting_keeps_what_is_known(passed: list[WireEvent]) -> None:
    """Hidden bytes were passed on when the bytes were."""
    redactor = Redactor()
    kept = [event for given in passed for event in redactor.feed(given)]
    kept += redactor.flush()
    before = {(e.offset_bytes, e.direction): e for e in passed if isinstance(e, ForwardedChunk)}
    after = [event for event in kept if isinstance(event, ForwardedChunk)]
    assert len(after) == len(before)
    for event in after:
        known = before[event.offset_bytes, event.direction]
        assert (event.forwarded_ns, event.kernel_time) == (known.forwarded_ns, known.kernel_time)
