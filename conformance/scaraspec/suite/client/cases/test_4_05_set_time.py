"""4.5: setting the time."""

from datetime import datetime
from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.fields import Clock, Diagnostics
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import (
    request_operation,
    sent_or_answered,
)
from scaraspec.suite.client.harness.valid_bytes import expect_valid_bytes
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect
from scaraspec.user_message import UserMessage

_TIMES: Final = st.datetimes(datetime(2000, 1, 1), datetime(2099, 12, 31, 23, 59, 59))  # noqa: DTZ001 - the document names no zone
_IMPOSSIBLE: Final = (
    "20141301000000",
    "20140001000000",
    "20140100000000",
    "20140132000000",
    "20140230120000",
    "20140431120000",
    "20140631120000",
    "20140931120000",
    "20141131120000",
    "20150229120000",
    "21000229120000",
    "20141222240000",
    "20141222126000",
    "20141222120061",
    "20141332250000",
    "201412221430",
    "2014122214300",
    "201412221430000",
    "20141222143000\n",  # many regular expressions with $ accept this
    "2014+122143000",  # most languages parse the parts as numbers, also of the next one
    "２０１４１２２２１４３０００",
)
_EDGES: Final = tuple(
    datetime(*numbers)  # noqa: DTZ001 - the document names no zone
    for numbers in (
        (2014, 1, 1),
        (2014, 12, 31, 23, 59, 59),
        (2016, 2, 29, 12),
        (2014, 3, 31, 0, 0, 1),
        (2014, 9, 30, 12, 0, 0),
    )
)
_CLOCK: Final = Clock("time")


@client_case("4.5/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Setting the time to the example of the document succeeds once and is then refused."""
    call, _ = request_operation(subject, line, "set_time")
    line.reply("set_time", data=b"1")
    subject.expect_done(call)
    call, _ = request_operation(subject, line, "set_time")
    line.reply("set_time", data=b"0")
    subject.expect_failure(call)


@client_case("4.5/1", name="times")
def test_times(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends times of two centuries as 14 digits with leading zeros."""

    @example(datetime(1999, 12, 31, 23, 59, 59))  # noqa: DTZ001 - the document names no zone
    @example(datetime(2001, 2, 3, 4, 5, 6))  # noqa: DTZ001 - the document names no zone
    @example(datetime(2016, 2, 29))  # noqa: DTZ001 - the document names no zone
    @example(datetime(2099, 12, 31, 23, 59, 59))  # noqa: DTZ001 - the document names no zone
    @given(_TIMES)
    def each(time: datetime) -> None:
        with subject.allow_refusal():
            call, _ = request_operation(subject, line, "set_time", time.replace(microsecond=0))
            line.reply("set_time", data=b"1")
            subject.expect_done(call)

    each()


@client_case("4.5/2", name="edges")
def test_edges_of_the_calendar(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the first and last times of years, months and days unchanged."""
    for time in examples(_EDGES):
        call, _ = request_operation(subject, line, "set_time", time)
        line.reply("set_time", data=b"1")
        subject.expect_done(call)


@client_case("4.5/2", "4.5/1")
def test_impossible_times(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client does not send invalid times or times that are not 14 digits."""
    for text in examples(_IMPOSSIBLE):
        call = subject.begin("set_time", time=text)
        if sent_or_answered(subject, line, call) is None:
            subject.expect_failure(call)
            continue
        expect_valid_bytes(line)
        request = line.request("set_time", call)
        notes = Diagnostics()
        _CLOCK.read(request.frame.data, notes)
        expect(
            not notes.issues,
            UserMessage("the client sends the invalid time {time}", time=text),
            expected="nothing, or a time of the calendar",
            observed=f"{request}",
        )
        line.reply("set_time", data=b"0")
        subject.wait_for_answer(call)
