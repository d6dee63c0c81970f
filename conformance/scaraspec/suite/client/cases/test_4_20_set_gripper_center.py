"""4.20: setting the gripper center (0x35, L433-443)."""

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import Point
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.request_checks import expect_numbers
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given

_tenths = st.integers(-99_999, 99_999).map(lambda tenths: tenths / 10)


@client_case("4.20/1", attended=True)
def test_set(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Setting the gripper center succeeds once and is then refused."""
    call = subject.begin("set_gripper_center", x=200, y=300, z=456)
    expect_numbers(line.serve(call), (200, 300, 456))
    subject.expect_done(call)
    call = subject.begin("set_gripper_center", x=1, y=2, z=3)
    expect_numbers(line.serve(call, value=False), (1, 2, 3))
    subject.expect_failure(call)


@client_case("4.20/1", name="numbers")
def test_numbers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends numbers of every size and sign as decimals between bars, in order."""

    @example(Point(0, 0, 0))
    @example(Point(-0.1, 0.1, -100))
    @example(Point(0.00001, 1e6, -0.00001))  # C's %g and others write these with an exponent
    @example(
        Point(1e-7, -1e-7, 1.2e-14)
    )  # JavaScript writes these with an exponent; the last is a rounding error
    @example(Point(-9999.9, 9999.9, 1000))
    @given(st.builds(Point, _tenths, _tenths, _tenths))
    def each(expected: Point) -> None:
        call = subject.begin("set_gripper_center", **expected._asdict())
        with subject.allow_refusal():
            expect_numbers(line.serve(call), expected)
            subject.expect_done(call)

    each()
