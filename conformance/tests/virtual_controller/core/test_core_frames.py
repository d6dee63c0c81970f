"""Requests in the byte stream: pieces, joined requests, garbage, pauses, and any bytes."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import READINGS
from scaraspec.transports.link import Ending

_STATUS = b"\xaa\x09\x00\xcc"
_TIME = b"\xaa\x07\x00\xcc"
_VERSION = b"\xaa\x08\x00\xcc"


def _names(client: Any, for_s: float = 0.0) -> list[str]:
    return [name for name, _ in client.receive(for_s)]


def test_a_request_may_come_byte_by_byte(bench: Any) -> None:
    """Requirement 2/5: with pauses of one second between the bytes."""
    client = bench.client()
    for number, byte in enumerate(_STATUS):
        client.link.send(bytes([byte]))
        if number < len(_STATUS) - 1:
            assert client.receive(1.0) == []
    assert _names(client) == ["get_status"]


def test_requests_may_come_in_one_piece_and_are_answered_in_order(bench: Any) -> None:
    """Replies have the order of the requests (2/6, 3/24)."""
    client = bench.client()
    client.link.send(_STATUS + _TIME + _VERSION + _STATUS[:2])
    assert _names(client) == ["get_status", "get_time", "get_version"]
    client.link.send(_STATUS[2:])
    assert _names(client) == ["get_status"]


def test_requests_in_one_piece_act_in_order(bench: Any) -> None:
    """Requirement 3/30: the stop ends the jog that was sent before it."""
    client = bench.client()
    client.link.send(b"\xaa\x3d\x011\xcc\xaa\x32\x00\xcc\xaa\x09\x00\xcc")
    assert client.receive() == [
        ("jog", b"1"),
        ("emergency_stop", b"1"),
        ("*jog", b"11"),
        ("*emergency_stop", b"11"),
        ("get_status", b"00"),
    ]


def test_one_request_at_a_time_is_a_reading(bench_of: Any) -> None:
    """A-3-14 (a): bytes that arrive together with a request are ignored."""
    client = bench_of(pipelining="one").client()
    client.link.send(_STATUS + _TIME)
    assert _names(client) == ["get_status"]
    client.link.send(_TIME)
    assert _names(client) == ["get_time"]


def test_replies_in_any_order_are_a_reading(bench_of: Any) -> None:
    """A-3-14 (c): the reply to a query may be overtaken; other requests keep their order."""
    client = bench_of(pipelining="any-order").client()
    client.link.send(_STATUS + _TIME + _VERSION)
    assert _names(client) == ["get_time", "get_version", "get_status"]
    client.link.send(b"\xaa\x3d\x011\xcc\xaa\x32\x00\xcc")
    assert _names(client) == ["jog", "emergency_stop", "*jog", "*emergency_stop"]


@pytest.mark.parametrize(
    "garbage",
    [b"\x00", b"\xaa", b"\xcc\xaa", b"\xaa\x09\x00\xcd", b"\xaa\x07\x02\xcc", b"\xcc\x09\x00\xaa"],
    ids=bytes.hex,
)
def test_the_next_request_is_served_after_garbage(bench: Any, garbage: bytes) -> None:
    """Requirements 3/19, 3/20 and 3/23: the next frame is found byte by byte."""
    client = bench.client()
    client.link.send(garbage + _STATUS)
    client.receive(3.0)
    client.link.send(_TIME)
    assert "get_time" in _names(client)


@pytest.mark.parametrize(
    ("reading", "stream", "answered"),
    [
        ("bytewise", b"\xaa\x08\x04" + _STATUS + b"\x00" + _TIME, ["get_status", "get_time"]),
        ("framewise", b"\xaa\x08\x04" + _STATUS + b"\x00" + _TIME, ["get_time"]),
        ("framewise", b"\x00\xcc" + _STATUS, ["get_status"]),
        ("flush", b"\xaa\x08\x04" + _STATUS + b"\x00" + _TIME, []),
        ("flush", _STATUS + b"\x00" + _TIME + _TIME[:2], ["get_status"]),
    ],
)
def test_resynchronisation_is_a_reading(
    bench_of: Any, reading: str, stream: bytes, answered: list[str]
) -> None:
    """A-3-10: the search continues one byte later, after the invalid frame, or in the next
    bytes."""
    client = bench_of(resync=reading).client()
    client.link.send(stream)
    assert _names(client) == answered
    client.link.send(_VERSION)
    assert _names(client) == ["get_version"]


def test_closing_after_garbage_is_a_reading(bench_of: Any) -> None:
    """A-3-10 (d): frames before it are processed, frames after it are not."""
    client = bench_of(resync="close").client()
    client.link.send(_STATUS + b"\x00" + _TIME)
    assert _names(client) == ["get_status"]
    assert client.ending is Ending.CLOSED


@pytest.mark.parametrize("resync", ["bytewise", "framewise", "flush"])
def test_an_incomplete_frame_times_out_after_two_seconds(bench_of: Any, resync: str) -> None:
    """A-3-11: a false start byte with a large length does not lose the next request."""
    client = bench_of(resync=resync).client()
    client.link.send(b"\xaa\x08\xff")
    client.link.send(_STATUS)
    assert _names(client, for_s=1.9) == []
    assert _names(client, for_s=0.2) == (["get_status"] if resync == "bytewise" else [])
    client.link.send(_TIME)
    assert _names(client) == ["get_time"]


def test_the_timeout_of_an_incomplete_frame_is_a_reading(bench_of: Any) -> None:
    """A-3-11 (a), and any other duration."""
    client = bench_of(partial_timeout="none").client()
    client.link.send(_STATUS[:3])
    assert _names(client, for_s=3600.0) == []
    client.link.send(_STATUS[3:])
    assert _names(client) == ["get_status"]
    client = bench_of(partial_timeout="0.5").client()
    client.link.send(b"\xaa\xaa" + _STATUS[1:3])
    assert _names(client, for_s=0.6) == []


# --------------------------------------------------------------------------- any bytes and requests

_frames = st.builds(
    lambda opcode, data: Frame(A2C, opcode, data).encode(),
    st.sampled_from([op for op in BY_OPCODE if op != BY_OPCODE[0x60].opcode]) | st.integers(0, 255),
    st.binary(max_size=255)
    | st.sampled_from([b"p", b"password", b"1", b"08", b"8|1", b"password|password"])
    | st.sampled_from([b"60|200|300|324|34.6|34.5|0", b"200|300|324|34.6|34.5|0", b"1|2|3"])
    | st.sampled_from([bytes([3, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0]) + b"abc" + bytes(197)]),
)
_pieces = st.lists(st.binary(max_size=300) | _frames, max_size=30)
_dialects = st.fixed_dictionaries(
    {},
    optional={
        key: st.sampled_from([option.name for option in reading.options])
        for key, reading in READINGS.items()
    },
)

_fuzzed = settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])


def _is_up(bench: Any) -> bool:
    """Return whether a new client is served, unless the robot was switched off on purpose."""
    return not bench.core.powered or bench.client().ask("get_status") is not None


@_fuzzed
@given(pieces=_pieces, pause_s=st.floats(0, 40))
def test_no_bytes_stop_the_controller(bench_of: Any, pieces: list[bytes], pause_s: float) -> None:
    """Whatever a client sends without a login, and with any pauses, a new client is served
    afterwards."""
    bench = bench_of()
    guest = bench.guest()
    for piece in pieces:
        if guest.ending is None:
            guest.link.send(piece)
            guest.receive(pause_s)
    assert _is_up(bench)


@_fuzzed
@given(pieces=_pieces, readings=_dialects, pauses_s=st.lists(st.floats(0, 40), min_size=1))
def test_no_sequence_of_requests_stops_the_controller(
    bench_of: Any, pieces: list[bytes], readings: dict[str, str], pauses_s: list[float]
) -> None:
    """The controller replies to two clients with any requests, in any dialect."""
    bench = bench_of(**readings | {"max_clients": "many"})
    bench.store_program(b"p")
    clients = [bench.client(), bench.client()]
    for index, piece in enumerate(pieces):
        client = clients[index % 2]
        client.receive()  # the other one may have shut the robot down
        if client.ending is None:
            client.link.send(piece)
            client.receive(pauses_s[index % len(pauses_s)])
    if bench.core.powered:
        bench.pass_s(100.0)
        bench.store.save(bench.store.settings)
        client = bench.guest()
        client.ask("login", bench.store.settings.password)
        client.send("get_status")
        assert any(name == "get_status" for name, _ in client.receive(3.0))


@_fuzzed
@given(data=st.binary(max_size=60), cuts=st.lists(st.integers(0, 120), max_size=6))
def test_how_bytes_are_split_makes_no_difference(
    bench_of: Any, data: bytes, cuts: list[int]
) -> None:
    """Requirement 2/5: the same bytes give the same answers in any pieces."""
    stream = _STATUS + data + _TIME + b"\xaa" + data + _VERSION
    complete = bench_of().client()
    complete.link.send(stream)
    split = bench_of().client()
    for start, end in pairwise([0, *sorted(cuts), len(stream)]):
        split.link.send(stream[start:end])
    assert split.receive() == complete.receive()
