"""4.24: moving to tool coordinates (0x39, L481-516)."""

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import Pose
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.poses import expect_pose
from scaraspec.suite.client.harness.request_checks import request_unless_refused
from scaraspec.suite.client.harness.two_stage import (
    MOVE,
    begin_and_accept,
    expect_execution_failed,
    expect_finished,
    expect_refused,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect_equal, expect_in
from scaraspec.user_message import UserMessage

_MOVE = "set_tool_coordinates"
_THERE = Pose(200, 300, 324, 34.6, 0, 0)
_NO_SPEEDS = (0, -1, 101, 255, 256, 257, 1000, 0.5, 99.5, 100.4)
_SPEEDS = range(1, 101)
_MOST_DIGITS = 9  # with leading zeros; a longer text is not a speed

_tenths = st.integers(-9_999, 9_999).map(lambda tenths: tenths / 10)
_poses = st.builds(Pose, *[_tenths] * 4, st.just(0.0), st.just(0.0))


@client_case("4.24/1", attended=True)
def test_move(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A move succeeds; another move fails."""
    for code in examples(("", "12")):
        call = subject.begin(_MOVE, speed=60, **_THERE._asdict())
        request = line.request(_MOVE, call)
        expect_pose(subject, request, _THERE, speed=60)
        line.reply(_MOVE, data=b"1")
        line.result(_MOVE, code)
        if code:
            expect_execution_failed(subject, call)
        else:
            expect_finished(subject, call)


@client_case("4.24/1", "7/2", name="numbers")
def test_numbers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends speeds and poses of every size and sign as decimals, in order."""

    @example(1, Pose(0, 0, 0, 0, 0, 0))
    @example(100, Pose(-0.1, 0.1, -100, -179.9, 0, 0))
    @example(50, Pose(-1234.567, 1000.001, 0.001, 123.456, 0, 0))
    @given(st.integers(1, 100), _poses)
    def each(speed: int, expected: Pose) -> None:
        call = subject.begin(_MOVE, speed=speed, **expected._asdict())
        with subject.allow_refusal():
            request = line.serve(call, data=b"1")
            line.result(_MOVE)
            expect_pose(subject, request, expected, speed=speed)
            expect_finished(subject, call)

    each()


@client_case("4.24/2")
def test_every_speed(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends each speed from 1 to 100 % as a whole number."""
    for speed in examples(range(1, 101)):
        call = subject.begin(_MOVE, speed=speed, **_THERE._asdict())
        sent = line.request(_MOVE, call)
        expect_equal(
            _speed_of(sent),
            speed,
            UserMessage("the client sent a wrong speed: {request}", request=sent),
        )
        line.reply(_MOVE, data=b"0|05")
        expect_refused(subject, call)


@client_case("4.24/2", name="beyond")
def test_no_speed(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses or corrects a speed that is not a whole percentage from 1 to 100."""
    for speed in examples(_NO_SPEEDS):
        call = subject.begin(_MOVE, speed=speed, **_THERE._asdict())
        sent = request_unless_refused(line, call)
        if sent is not None:
            expect_in(
                _speed_of(sent),
                _SPEEDS,
                UserMessage("the client sent an invalid speed for {speed}", speed=speed),
            )
            line.reply(_MOVE, data=b"0|05")
            expect_refused(subject, call)
    call = begin_and_accept(subject, line, MOVE)  # a refused move has no later effect
    line.result(_MOVE)
    expect_finished(subject, call)


def _speed_of(sent: ReceivedFrame) -> int | None:
    """The speed in a move request; None if it is not a whole number."""
    text = sent.seen.text.split(b"|")[0]
    return int(text) if text.isdigit() and len(text) <= _MOST_DIGITS else None
