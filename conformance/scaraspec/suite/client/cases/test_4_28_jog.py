"""4.28: jogging (0x3D, L596-637)."""

from typing import Final

from scaraspec.protocol import payloads
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import (
    RUN,
    begin_and_accept,
    expect_execution_failed,
    expect_finished,
    expect_refused,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect, expect_equal, show_value
from scaraspec.user_message import UserMessage

_DIRECTIONS: Final = {"+y": 1, "-y": 2, "+x": 3, "-x": 4}  # L605-608
_JOG: Final = "jog"
_ASCII: Final = ord("0")


def _expect_direction(sent: bytes, number: int) -> None:
    expect_equal(len(sent), 1, "a jog carries a wrong number of data bytes", requirement="4.28/1")
    expect(
        sent[0] in (number, _ASCII + number),
        "a jog carries a wrong direction",
        expected=UserMessage("{number}, as a digit or a byte", number=number),
        observed=show_value(sent),
        requirement="4.28/3",
    )


@client_case("4.28/1", "4.28/3", attended=True)
def test_jog(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends one byte for each of the four directions."""
    for direction, number in examples(_DIRECTIONS.items()):
        call = subject.begin(_JOG, direction=direction)
        _expect_direction(line.request(_JOG, call).frame.data, number)
        line.reply(_JOG, data=b"1")
        line.result(_JOG)
        expect_finished(subject, call)


@client_case("4.28/3", "4.28/1", name="refused")
def test_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A jog that was refused or failed does not change the direction of the next one."""
    for direction, number in examples(_DIRECTIONS.items()):
        call = subject.begin(_JOG, direction=direction)
        _expect_direction(line.request(_JOG, call).frame.data, number)
        line.reply(_JOG, data=b"0|06")
        expect_refused(subject, call, "06")
        call = subject.begin(_JOG, direction=direction)
        _expect_direction(line.request(_JOG, call).frame.data, number)
        line.reply(_JOG, data=b"1")
        line.result(_JOG, "05")
        expect_execution_failed(subject, call, "05")


@client_case("4.28/2")
def test_byte(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The data byte is 1 to 4, always as a digit or always as a binary number (A-4.28-1)."""
    forms = set()
    for direction in examples((*_DIRECTIONS, *reversed(_DIRECTIONS))):
        call = subject.begin(_JOG, direction=direction)
        sent = line.request(_JOG, call).frame.data
        read = payloads.Jog().decode(sent)
        expect(
            read.value is not None,
            "a jog carries an invalid byte",
            expected="1 to 4, as a digit or a byte",
            observed=show_value(sent),
        )
        forms.add(dict(read.readings)["jog_byte"])
        line.reply(_JOG, data=b"1")
        line.result(_JOG)
        expect_finished(subject, call)
        call = begin_and_accept(subject, line, RUN)
        line.result(RUN.name)
        expect_finished(subject, call)
    form = forms.pop()
    expect(
        not forms,
        "the form of the jog byte changes",
        expected=UserMessage("always {form}", form=form),
        observed="both",
    )
    subject.detected_readings["jog_byte"] = form
    if form == "binary":
        subject.tolerate(
            "4.28/2", "jog_byte", form, "the client sends the direction of a jog as a binary number"
        )
