"""Clauses 3 and 4: how a client writes text, numbers and fields (A-0-1, A-0-3, A-T-1 to A-T-6)."""

import math
from typing import Any, Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import (
    BY_NAME,
    MoveTarget,
    Network,
    PasswordChange,
    Point,
    PortValue,
    Pose,
)
from scaraspec.protocol.fields import show
from scaraspec.protocol.payloads import Record
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import (
    OPENINGS,
    VALUES,
    answer_request,
    begin_operation,
    expect_carries,
    expect_local_refusal,
    expect_not_sent,
    for_each_supported,
    request_operation,
    sent_or_answered,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect, expect_in
from scaraspec.suite.engine.strategies import payload_values
from scaraspec.user_message import UserMessage

_SEVERAL: Final = tuple(
    name
    for name in VALUES
    if isinstance(BY_NAME[name].request, Record) and len(BY_NAME[name].request.fields) > 1
)
_NAMED: Final = ("delete_program", "set_default_program", "run_program", "simulate_program")
_DIGITS: Final = ("set_time", "set_digital_output", "set_gripper_center", "get_analog_input")
_BARRED: Final = (b"a|b.rob", b"|a.rob", b"a.rob|", b"|")
_LONG_BYTES: Final = (30, 31, 32, 33, 64, 100, 128, 255)
_TIDIED: Final = (
    *(b" pro1.rob", b"pro1.rob ", b"  pro1  ", b".pro1.rob", b"pro1..rob", b"pro1.rob."),
    *(b"pro--1.rob", b"pro  1.rob", b"pro\t1.rob", b"pro%201.rob", b"pro$&${1}.rob"),
    *(b"pro[1].rob", b"pro{1.rob", b"007", b"1.50", b"1e3", b"0x1F"),
)
"""Names that a program may normalize, expand, or take for a pattern, a list or a number."""
_UNICODE: Final = (
    "cafe\N{COMBINING ACUTE ACCENT}.rob",
    "caf\N{LATIN SMALL LETTER E WITH ACUTE}.rob",
    "\N{FULLWIDTH LATIN SMALL LETTER A}.rob",
    "\N{ANGSTROM SIGN}.rob",
    "\N{HANGUL CHOSEONG HIEUH}\N{HANGUL JUNGSEONG A}.rob",
    "\N{CJK COMPATIBILITY IDEOGRAPH-F900}.rob",
)
"""Names that Unicode normalization alters: each form alters one of them."""
_CONTROL: Final = 0x20
_PORTS: Final = 8

_NUMBERS: Final = (0, 1, -1, -0.5, 0.001, 0.125, 34.6, 100000, 12345678, -99999.5, 12345.678)


def _sends(
    subject: ClientUnderTest,
    line: IncomingConnection,
    name: str,
    value: Any = None,
    *,
    requirement: str = "",
) -> ReceivedFrame:
    """Begin an operation, require that its request carries the value, and finish it."""
    call, request = request_operation(subject, line, name, value, requirement=requirement)
    answer_request(line, name, request)
    subject.wait_for_answer(call)
    return request


# ---------------------------------------------------------------------- fields


@client_case("T/1")
def test_bars(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """One bar separates the fields of every request with several fields."""

    def each(name: str) -> None:
        request = _sends(subject, line, name)
        expect(
            request.frame.data.rstrip(b"|\0").count(b"|") == len(BY_NAME[name].request.fields) - 1,
            "the fields are not separated by one bar",
            expected=BY_NAME[name].request.form,
            observed=show(request.frame.data),
        )

    for_each_supported(_SEVERAL, each)


@client_case("T/1", name="values")
def test_bars_between_short_and_long(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """One bar separates fields of minimal and of large length."""
    for name, value in examples(
        (
            ("set_password", PasswordChange(b"o", b"n")),
            ("set_password", PasswordChange(b"o" * 60, b"n" * 60)),
            ("set_network", Network("1.1.1.1", "255.0.0.0", "1.1.1.2")),
            ("set_initial_tool_position", Pose(0, 0, 0, 0, 0, 0)),
            ("set_initial_tool_position", Pose(-100.5, 200.5, -300.5, -90.5, 0, 0)),
            ("set_tool_coordinates", MoveTarget(1, 0, 0, 0, 0, 0, 0)),
        )
    ):
        with subject.allow_refusal():
            _sends(subject, line, name, value, requirement="T/1")


# ---------------------------------------------------------------------- characters


@client_case("T/2")
def test_no_quotation_marks(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No request contains the quotation marks of the examples."""

    def each(name: str) -> None:
        data = _sends(subject, line, name, requirement="T/2").frame.data
        marks = [mark for mark in ('"', "'", "“", "”") if mark.encode() in data]
        expect(not marks, "a request contains a quotation mark", observed=show(data))

    for_each_supported(VALUES, each)


@client_case("T/3")
def test_digits_are_characters(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The digits of numbers, ports and times are characters, not binary values."""

    def each(name: str) -> None:
        data = _sends(subject, line, name, requirement="T/3").frame.data
        expect(
            all(byte >= _CONTROL for byte in data.rstrip(b"\0")),
            "digits are not sent as characters",
            expected=BY_NAME[name].request.form,
            observed=show(data),
        )

    for_each_supported(_DIGITS, each)


@client_case("T/4")
def test_ends_of_texts(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Nothing follows the last character; a NUL or a bar only causes a warning."""

    def each(name: str) -> None:
        _sends(subject, line, name, requirement="T/4")

    for_each_supported(("login", "set_time", "set_network", *_NAMED), each)


# ---------------------------------------------------------------------- numbers


@client_case("T/5", "T/10")
def test_numbers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends small, large, whole and fractional numbers as plain decimal text."""
    for number in examples(_NUMBERS):
        point = Point(number, -number, 0)
        with subject.allow_refusal():
            _sends(subject, line, "set_gripper_center", point, requirement="T/10")


@client_case("T/5", name="poses")
def test_numbers_of_poses(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends poses of many numbers as plain decimal text."""
    tenths = st.integers(-10_000, 10_000).map(lambda number: number / 10)

    @given(st.tuples(*[tenths] * 6))
    @example((0.1, -0.1, 99.9, -179.9, 0, 0))
    def each(numbers: tuple[float, ...]) -> None:
        x, y, z, theta, *_ = numbers
        pose = Pose(x, y, z, theta, 0, 0)
        with subject.allow_refusal():
            _sends(subject, line, "set_initial_tool_position", pose, requirement="T/10")

    each()


# ---------------------------------------------------------------------- bars in texts


@client_case("T/6")
def test_bar_in_a_name(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses to delete a program with a bar in its name."""
    expect_local_refusal(subject, line, "delete_program", b"pro|1.rob")


@client_case("T/6", name="everywhere")
def test_bars_in_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses names and passwords with bars in every operation."""

    def each(name: str) -> None:
        for barred in examples(_BARRED):
            expect_local_refusal(subject, line, name, barred)

    for_each_supported(("login", *_NAMED), each)


@client_case("T/6", name="files")
def test_bars_in_file_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses to upload and download files with bars in their names."""
    local = subject.make_file(b"SCARA")
    expect_not_sent(subject, line, subject.begin("upload", local=local, remote="a|b.rob"))
    local = subject.missing_file()
    expect_not_sent(subject, line, subject.begin("download", remote="a|b.rob", local=local))


# ---------------------------------------------------------------------- whole values


@client_case("T/10")
def test_values(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends many values of every operation completely and in order."""

    def each(name: str) -> None:
        @given(payload_values(BY_NAME[name].request))
        def send(value: Any) -> None:
            with subject.allow_refusal():
                _sends(subject, line, name, _ordinary(value))

        send()

    for_each_supported(VALUES, each)


def _ordinary(value: Any) -> Any:
    """Return the value without parts that a client may have its own reasons to refuse."""
    match value:
        case MoveTarget() | Pose():  # two angles have no meaning (L1006)
            return value._replace(theta_y=0.0, theta_z=0.0)
        case PortValue():
            return value._replace(port=_port(value.port))
        case int():
            return _port(value)
    return value


def _port(number: int) -> int:
    """Return a port that exists for every kind of port."""
    return (number - 1) % _PORTS + 1


@client_case("T/10", name="long-names")
def test_long_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends long names completely, or refuses them."""

    def each(name: str) -> None:
        for size_bytes in examples(_LONG_BYTES):
            value = b"".join(b"%d" % (i % 10) for i in range(size_bytes - 4)) + b".rob"
            call = begin_operation(subject, name, value)
            if sent_or_answered(subject, line, call) is None:
                continue  # refused
            request = line.request(name, call)
            expect(
                request.frame.data.rstrip(b"\0") == value,
                UserMessage(
                    "the client does not send a name of {size_bytes} bytes completely",
                    size_bytes=size_bytes,
                ),
                expected=show(value, limit=255),
                observed=show(request.frame.data, limit=255),
            )
            answer_request(line, name, request)
            subject.wait_for_answer(call)

    for_each_supported(_NAMED, each)


@client_case("T/10", name="outer-blanks")
def test_outer_blanks(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends names with outer blanks or special characters unchanged, or refuses them."""

    def each(name: str) -> None:
        for value in examples(_TIDIED):
            call = begin_operation(subject, name, value)
            if sent_or_answered(subject, line, call) is None:
                continue  # refused
            request = line.request(name, call)
            expect_carries(subject, request, name, value)
            answer_request(line, name, request)
            subject.wait_for_answer(call)

    for_each_supported(_NAMED, each)


@client_case("T/10", name="unicode")
def test_unicode_forms(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client composes and decomposes no characters of a name, or refuses the name."""

    def each(name: str) -> None:
        opening = OPENINGS.get(name, name)
        for text in examples(_UNICODE):
            call = _begin_with_name(subject, name, text)
            if sent_or_answered(subject, line, call) is None:
                continue  # refused
            request = line.request(opening, call)
            answer_request(line, opening, request)
            subject.wait_for_answer(call)
            sent, forms = request.frame.data.rstrip(b"\0"), (text.encode(), text.encode("gb18030"))
            expect_in(sent, forms, "the client altered the characters of a name")  # A-T-2

    for_each_supported((*_NAMED, *OPENINGS), each)


def _begin_with_name(subject: ClientUnderTest, name: str, text: str) -> Call:
    match name:
        case "upload":
            return subject.begin(name, local=subject.make_file(b"!"), remote=text)
        case "download":
            return subject.begin(name, remote=text, local=subject.missing_file())
    return begin_operation(subject, name, text.encode())


@client_case("T/10", name="sequence")
def test_values_in_sequence(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the same operation repeatedly with shorter and longer values."""
    for name in (b"LongNameOfAProgramWithout0.txt", b"a.txt", b"pro1.txt", b"b.txt", b"pro12.txt"):
        _sends(subject, line, "delete_program", name)
    for x in (300.5, 1, -20.5, 0, 300):
        _sends(subject, line, "set_gripper_center", Point(x, math.floor(x), -x))
