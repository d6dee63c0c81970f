"""Forwarding times: the parts of a latency that belong to the robot and to the recorder."""

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


def forwarded(event: WireEvent, forwarded_ns: int) -> ForwardedChunk:
    """Return the same bytes with a forwarding time."""
    place = (event.time_ns, event.connection, event.direction, event.kind)
    return ForwardedChunk(*place, event.data, event.offset_bytes, 0, event.note, forwarded_ns)


def latencies(events: Sequence[WireEvent]) -> list[Latency | None]:
    """Return the latency of each exchange."""
    printed, judge, found = LatencyTracker(), Judge(needs_login=False), []
    for event in events:
        printed.write(event)
        for item in judge.feed(event):
            if isinstance(item, FrameSeen):
                printed.frame(item)
            elif isinstance(item, Exchange):
                found.append(printed.exchange(item))
    return found


@pytest.fixture
def exchange(talk: Any) -> list[WireEvent]:
    """Return a request and its reply after two milliseconds."""
    talk.ask("get_status", None, "00")
    events: list[WireEvent] = talk.events
    return events


def test_time_in_the_recorder_is_not_counted_for_the_robot(exchange: list[WireEvent]) -> None:
    """The request waits in the recorder for half of the time."""
    request, reply = exchange
    events = [forwarded(request, request.time_ns + MS), forwarded(reply, reply.time_ns + MS // 4)]
    assert latencies(events) == [Latency(robot_ns=MS, recorder_ns=MS + MS // 4)]


def test_a_reply_counts_from_its_first_piece(exchange: list[WireEvent]) -> None:
    """The robot has replied when the first byte arrives, however slow the rest is."""
    request, reply = exchange
    begun = replace(reply, data=reply.data[:2])
    rest = replace(reply, data=reply.data[2:], offset_bytes=2, time_ns=reply.time_ns + 7 * MS)
    events = [forwarded(event, event.time_ns + 1000) for event in (request, begun, rest)]
    assert latencies(events) == [Latency(robot_ns=2 * MS - 1000, recorder_ns=2000)]


def test_no_latency_without_both_forwarding_times(exchange: list[WireEvent]) -> None:
    """If one forwarding time is unknown, there is no latency."""
    request, reply = exchange
    assert latencies([forwarded(request, request.time_ns), reply]) == [None]
    assert latencies([request, forwarded(reply, reply.time_ns)]) == [None]
    assert latencies([forwarded(request, 0), forwarded(reply, reply.time_ns)]) == [None]


def test_frames_without_an_exchange_are_not_kept(talk: Any) -> None:
    """Unsolicited frames do not fill the memory."""
    printed, judge = LatencyTracker(), Judge(needs_login=False)
    for _ in range(10_000):
        talk.send(C2A, Frame(C2A, 0x09, b"00").encode())
    for event in talk.events:
        printed.write(forwarded(event, event.time_ns))
        for item in judge.feed(event):
            if isinstance(item, FrameSeen):
                printed.frame(item)
    assert len(printed._chunks) <= 5000


def test_redaction_keeps_forwarding_times(passed: list[WireEvent]) -> None:
    """Masked bytes have the forwarding time of the original bytes."""
    redactor = Redactor()
    kept = [event for given in passed for event in redactor.feed(given)]
    kept += redactor.flush()
    before = {(e.offset_bytes, e.direction): e for e in passed if isinstance(e, ForwardedChunk)}
    after = [event for event in kept if isinstance(event, ForwardedChunk)]
    assert len(after) == len(before)
    for event in after:
        known = before[event.offset_bytes, event.direction]
        assert (event.forwarded_ns, event.kernel_time) == (known.forwarded_ns, known.kernel_time)
