"""4.9: reading the running program."""

from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.fields import NAME_MAX_BYTES, RunTime
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.driver_values import expected_value
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported, request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.strategies import names

_DAY_S: Final = 86400
_NO_OCTAL: Final = 8 * _DAY_S + 9 * 3600 + 8 * 60 + 9  # days, hours, minutes, seconds
_SECONDS: Final = (
    *(0, 1, 59, 60, 3599, 3600, _NO_OCTAL),
    *(_DAY_S - 1, _DAY_S, 10 * _DAY_S, 100 * _DAY_S - 1),
)
_LONG_BYTES: Final = (30, 31, 64, 100, 200)
_RUN_TIME: Final = RunTime("run_time_s")


def _expect_reported(
    subject: ClientUnderTest, line: IncomingConnection, name: bytes, run_time_s: int
) -> None:
    data = b"1|" + name + b"|" + _RUN_TIME.write(run_time_s, DEFAULT)
    tolerated_as = ("A-4.9-5", "30") if len(name) > NAME_MAX_BYTES else None
    expect_reported(subject, line, "get_running_program", data, tolerated_as=tolerated_as)


@client_case("4.9/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends get_running_program without data and reports the reply."""
    expect_reported(subject, line, "get_running_program", requirement="T/9")


@client_case("T/9", name="running-program")
def test_running(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports the names and run times of programs that run for up to 100 days."""

    @example(b"a", 1)
    @given(names, st.sampled_from(_SECONDS) | st.integers(0, 100 * _DAY_S - 1))
    def each(name: bytes, run_time_s: int) -> None:
        _expect_reported(subject, line, name, run_time_s)

    each()
    for run_time_s in examples(_SECONDS):
        _expect_reported(subject, line, b"pro1.rob", run_time_s)


@client_case("T/9", name="running-long-name")
def test_long_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports a running program whose name has 30 bytes or more (A-4.9-5).

    The names also contain blanks and several dots.
    """
    for name in examples((b"pick and place.rob", b"pick.v1.2.rob")):
        _expect_reported(subject, line, name, 90061)
    for size_bytes in examples(_LONG_BYTES):
        _expect_reported(subject, line, b"n" * (size_bytes - 4) + b".rob", 90061)


@client_case("T/9", name="nothing-runs")
def test_nothing_runs(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No program runs; the reply is the flag alone."""
    expect_reported(subject, line, "get_running_program", b"0")


@client_case("T/9", name="running-readings")
def test_readings(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No program runs, with empty fields after the flag, or with a binary flag (A-T-1)."""
    running = expected_value(RunningProgram(b"pro1.rob", 3661))
    for data, reported, reading in examples(
        (
            (b"0||", None, ("runinfo_none", "0")),
            (b"\x00", None, ("runinfo_binary", "ascii")),
            (b"\x01|pro1.rob|00010101", running, ("runinfo_binary", "ascii")),
        )
    ):
        call, _ = request_operation(subject, line, "get_running_program")
        line.reply("get_running_program", data=data)
        subject.wait_for_answer(call)
        if call.ok:
            subject.expect_result(call, reported)
        else:
            subject.tolerate("T/9", *reading, "the client accepts only the form of the document")
