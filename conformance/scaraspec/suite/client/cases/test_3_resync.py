"""Clause 3: bytes that are not a frame. Where the next frame begins is an open point (A-3-10).

The document does not define this. The client must not take such bytes for a reply, and it must
accept the next frame on the same connection or on a new one.
"""

from contextlib import suppress
from typing import Final

from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import await_request
from scaraspec.suite.client.harness.two_stage import (
    RUN,
    begin_and_accept,
    expect_final_failure,
    reopen,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, NoReply

_TURN_S: Final = 0.02
_SETTLE_S: Final = 0.3
_SLOW_DRIVER_S: Final = 3.0  # a client times out on a reply after 5 s (A-3-15)
_GOOD: Final = Frame(C2A, 0x09, b"00").encode()
_STRAYS: Final = (
    b"\x00",
    b"\xaa",
    b"\xff" * 10,
    b"\r\n",
    b"help\r\n" * 20,
    b"\xaa\x09\x00",
    bytes(range(0xA0)) * 20,
)
"""None of these bytes begins a frame."""

_SPOILT: Final = tuple(
    Frame(C2A, 0x09, b"11").encode()[:-1] + bytes((end,)) for end in (0x00, 0x0D, 0xAB, 0xBB, 0xFF)
)
_HALVES: Final = (
    b"\xcc",
    b"\xcc\x09",
    b"\xcc\x09\x02",
    b"\xcc\x09\x02\x30\x30",
    b"\xcc\x09\x04",  # the missing bytes are as many as in the reply to the next login
    b"\xcc\x0b\xff" + b"0|a.rob|b.rob" * 4,
    b"\xcc\x90\x30\x02",
)


def _settles(line: IncomingConnection, call: Call, within_s: float) -> bool:
    """Whether the operation or the connection ends within this time."""
    for _ in range(round(within_s / _TURN_S)):
        if call.answer is not None or line.ended:
            return True
        line.wait(_TURN_S)
    return False


def _recovers(
    subject: ClientUnderTest, line: IncomingConnection, requirement: str, *segments: bytes
) -> IncomingConnection:
    """Send segments with invalid bytes and one reply, and require that the client recovers.

    Returns:
        The connection to continue with.

    Raises:
        CaseFailed: The client takes other bytes for the reply, or stalls.
    """
    call = subject.begin("get_status")
    await_request(line, "get_status", call)
    with suppress(NoReply):
        for segment in segments:
            line.send_bytes(segment)
            line.wait(_TURN_S)
    if not _settles(line, call, _SETTLE_S):
        subject.tolerate(
            requirement,
            "resync",
            "flush",
            "the client dropped a frame that arrived with invalid bytes",
        )
        with suppress(NoReply):
            line.send_bytes(_GOOD)
        if not _settles(line, call, _SLOW_DRIVER_S):
            raise CaseFailed(
                "the client accepts no frame after invalid bytes",
                expected="the next reply is accepted, or the connection ends",
                observed="neither",
                requirement=requirement,
            )
    if not line.ended and (call.answer is None or call.ok):
        subject.expect_result(call, "00", requirement=requirement)
        return line
    subject.expect_failure(call, requirement=requirement)
    subject.tolerate(requirement, "resync", "close", "the client aborted the operation")
    line.close()
    subject.wait_for_answer(subject.begin("disconnect"))
    return subject.open(judged=False)


@client_case("3/19")
def test_stray_bytes(subject: ClientUnderTest) -> None:
    """Bytes that begin no frame arrive before a reply."""
    line = subject.open(judged=False)
    for stray in examples(_STRAYS):
        line = _recovers(subject, line, "3/19", stray, _GOOD)


@client_case("3/19", name="joined")
def test_joined_with_a_reply(subject: ClientUnderTest) -> None:
    """Bytes that begin no frame arrive in one segment with a reply, before and after it."""
    line = subject.open(judged=False)
    for stray in examples(_STRAYS):
        line = _recovers(subject, line, "3/19", stray + _GOOD + stray)


@client_case("3/20")
def test_wrong_end(subject: ClientUnderTest) -> None:
    """A reply with a wrong end byte arrives before the correct reply with other data."""
    line = subject.open(judged=False)
    for spoilt in examples(_SPOILT):
        line = _recovers(subject, line, "3/20", spoilt, _GOOD)


@client_case("3/20", name="result")
def test_wrong_end_of_a_result(subject: ClientUnderTest) -> None:
    """A final result with a wrong end byte reports success; the correct one reports a failure."""
    line = subject.open(judged=False)
    for end in examples((0x00, 0xAB)):
        call = begin_and_accept(subject, line, RUN)
        line.wait(_TURN_S)
        spoilt = line.result_frame(RUN.name).encode()[:-1] + bytes((end,))
        with suppress(NoReply):
            line.send_bytes(spoilt)
            line.wait(_TURN_S)
            for _ in range(2):  # a client may drop frames that arrive with invalid bytes
                if not _settles(line, call, _SETTLE_S):
                    line.result(RUN.name, "12")
        expect_final_failure(
            subject, call, "the client accepted a final result with a wrong end byte"
        )
        line = reopen(subject, line)


@client_case("3/29")
def test_half_a_frame(subject: ClientUnderTest) -> None:
    """The connection ends in the middle of a reply; the client works on the next connection."""
    for number, half in examples(enumerate(_HALVES)):
        line = subject.open(judged=False)
        call = subject.begin("get_status")
        await_request(line, "get_status", call)
        line.send_bytes(half)
        line.wait(_TURN_S)
        line.close() if number % 2 else line.reset()
        subject.expect_failure(call)
        subject.wait_for_answer(subject.begin("disconnect"))
        line = subject.open()
        call = subject.begin("get_status")
        line.serve(call, "00")
        subject.expect_result(call, "00")
        line.close()
        subject.wait_for_answer(subject.begin("disconnect"))


@client_case("3/29", name="silence")
def test_silence_after_half_a_frame(subject: ClientUnderTest) -> None:
    """A reply stops in the middle; the client can disconnect and connect again."""
    for half in examples(_HALVES):
        line = subject.open(judged=False)
        subject.require_concurrency(line)
        call = subject.begin("get_status")
        line.request("get_status", call)
        line.send_bytes(half)
        line.wait(_TURN_S)
        subject.open()
