"""4.21: setting the initial tool position (0x36, L445-455)."""

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import Pose
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.poses import expect_pose
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect_equal

_DRAWN = Pose(200, 300, 324, 34.6, 34.5, 0)  # L450
_tenths = st.integers(-9_999, 9_999).map(lambda tenths: tenths / 10)


@client_case("4.21/1", attended=True)
def test_set(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Setting the initial tool position succeeds once and is then refused."""
    call = subject.begin("set_initial_tool_position", **_DRAWN._asdict())
    expect_pose(subject, line.serve(call), _DRAWN)
    subject.expect_done(call)
    other = Pose(300, 200, 225, 4, 0, 0)
    call = subject.begin("set_initial_tool_position", **other._asdict())
    expect_pose(subject, line.serve(call, value=False), other)
    subject.expect_failure(call)


@client_case("4.21/1", "7/2", name="numbers")
def test_numbers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends six numbers of every size and sign as decimals between bars, in order."""

    @example(Pose(0, 0, 0, 0, 0, 0))
    @example(Pose(-0.1, 0.1, -100, -179.9, 360, -360))
    @example(Pose(1, 2, 3, 4, 5, 6))
    @given(st.builds(Pose, *[_tenths] * 6))
    def each(expected: Pose) -> None:
        call = subject.begin("set_initial_tool_position", **expected._asdict())
        with subject.allow_refusal():
            expect_pose(subject, line.serve(call), expected)
            subject.expect_done(call)

    each()


@client_case("4.21/6")
def test_length(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The length byte counts the bytes sent: 23 for the text whose row prints 25 (A-4.21-1)."""
    for expected in examples(
        (_DRAWN, Pose(0, 0, 0, 0, 0, 0), Pose(-123.4, -234.5, 345.6, -178.9, -90.5, 0.5))
    ):
        call = subject.begin("set_initial_tool_position", **expected._asdict())
        with subject.allow_refusal():
            request = line.serve(call)
            subject.expect_done(call)
            expect_equal(line.invalid_bytes, [], "the client sent invalid bytes with the request")
            line.pump()
            expect_pose(subject, request, expected)
