"""Clause 3: the frames that a client sends, and the bytes between them (L85-L98)."""

from collections.abc import Sequence
from typing import Final

from scaraspec.protocol.commands import BY_NAME, PasswordChange
from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import (
    VALUES,
    answer_request,
    await_request,
    begin_operation,
    expect_carries,
    expect_local_refusal,
    for_each_supported,
    request_operation,
    sent_or_answered,
)
from scaraspec.suite.client.harness.valid_bytes import expect_valid_bytes
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, expect
from scaraspec.user_message import UserMessage

_OPERATIONS: Final = tuple(c.name for c in BY_NAME.values() if c.clause.startswith("4."))
_WITHOUT_DATA: Final = tuple(name for name in _OPERATIONS if name not in VALUES)
_LENGTHS_BYTES: Final = (127, 128, 129, 170, 200, 204, 254, 255)
_SIGNED: Final = 127
_TOO_LONG_BYTES: Final = (256, 257, 300, 511, 512, 600)
_WIDE: Final = (
    "程" * 130
).encode()  # fewer than 255 characters, but more bytes, also in GB18030 (A-T-2)
_PAUSE_S: Final = 0.3
_TOGETHER: Final = (
    *("set_tool_coordinates", "get_version", "set_network", "get_joint_angles"),
    *("delete_program", "get_tool_coordinates", "set_initial_tool_position", "get_time"),
)
"""Operations whose requests are long and short in turn."""
_ROUNDS: Final = 20
_TWICE: Final = {
    "get_status": ("00", "01"),
    "get_version": ("1.0.0", "1.0.1"),
    "get_time": ("20141222143000", "20141222143001"),
}
"""Two different replies to the same query."""


@client_case("3/1", "3/2", "3/3", "3/7", "3/10", "3/15", "3/32")
def test_every_request(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends one correct frame for every operation with the example of the document."""

    def each(name: str) -> None:
        call, request = request_operation(subject, line, name)
        answer_request(line, name, request)
        subject.wait_for_answer(call)
        expect_valid_bytes(line)

    for_each_supported(_OPERATIONS, each)


@client_case("3/8")
def test_requests_without_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends length 0 and then the end byte for every operation without data."""

    def each(name: str) -> None:
        call, request = request_operation(subject, line, name)
        answer_request(line, name, request)
        subject.wait_for_answer(call)
        expect_valid_bytes(line)

    for_each_supported(_WITHOUT_DATA, each)


@client_case("3/6", "3/7", "3/1")
def test_lengths(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends a pair of passwords of up to 255 bytes correctly, or refuses it."""
    for size_bytes in examples(_LENGTHS_BYTES):
        old = b"o" * ((size_bytes - 1) // 2)
        pair = PasswordChange(old, b"n" * (size_bytes - 1 - len(old)))
        call = begin_operation(subject, "set_password", pair)
        if sent_or_answered(subject, line, call) is None:
            continue  # the client has a lower limit
        _expect_frame(line, call, BY_NAME["set_password"].request.encode(pair))
        line.reply("set_password", data=b"0")
        subject.wait_for_answer(call)


def _expect_frame(line: IncomingConnection, call: Call, data: bytes) -> None:
    """Require that an operation produces one frame with this data."""
    expect_valid_bytes(line, length_requirement="3/6" if len(data) > _SIGNED else "3/7")
    frame = line.request(call.name, call).frame
    expect(
        frame.data.rstrip(b"|\0") == data,
        "the request carries wrong data",
        expected=UserMessage("{count} bytes", count=len(data)),
        observed=UserMessage("{count} bytes", count=len(frame.data)),
        requirement="T/10",
    )


@client_case("3/28")
def test_too_long(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses values of more than 255 bytes and sends no part of them."""

    def each(name: str) -> None:
        for size_bytes in examples(_TOO_LONG_BYTES):
            expect_local_refusal(subject, line, name, b"x" * size_bytes)
        expect_local_refusal(subject, line, name, _WIDE)

    for_each_supported(("delete_program", "set_default_program", "run_program", "login"), each)


# ---------------------------------------------------------------------- between the frames


@client_case("3/32", "3/10", name="idle")
def test_idle(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends nothing undefined while idle or while a request is pending."""
    line.wait(_PAUSE_S)
    expect_valid_bytes(line)
    call = subject.begin("get_version")
    line.request("get_version", call)
    line.wait(_PAUSE_S)
    expect_valid_bytes(line)
    line.reply("get_version", data=REPLIES["get_version"])
    subject.expect_result(call, "1.0.0")


@client_case("3/10", "3/32", name="farewell")
def test_disconnect_sends_nothing(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends nothing undefined when it disconnects."""
    subject.wait_for_answer(subject.begin("disconnect"))
    line.pump()
    expect_valid_bytes(line)


# ---------------------------------------------------------------------- started together


@client_case("3/1", name="together")
def test_requests_started_together(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Operations are started at the same time; the bytes of their requests are not mixed."""
    subject.require_concurrency(line)
    supported: list[str] = []

    def each(name: str) -> None:
        call, request = request_operation(subject, line, name)
        answer_request(line, name, request)
        subject.wait_for_answer(call)
        supported.append(name)

    for_each_supported(_TOGETHER, each)
    for _ in examples(range(_ROUNDS)):
        calls = [begin_operation(subject, name) for name in supported]
        pending = calls.copy()
        try:
            while pending:
                call = _next_requested(subject, line, pending)
                pending.remove(call)
                request = await_request(line, call.name, call)
                expect_carries(subject, request, call.name, VALUES.get(call.name))
                answer_request(line, call.name, request)
            expect_valid_bytes(line)
        except CaseFailed as error:  # each request alone is correct
            error.requirement = "3/1"
            raise
        for call in calls:
            subject.wait_for_answer(call)


def _next_requested(
    subject: ClientUnderTest, line: IncomingConnection, calls: Sequence[Call]
) -> Call:
    """Return the operation whose request has arrived; the first one if none arrives."""
    line.wait_for_any(subject.answer_timeout_s)
    sent = {seen.name for seen in line.inbox}
    return next((call for call in calls if call.name in sent), calls[0])


# ---------------------------------------------------------------------- one at a time


@client_case("3/25")
def test_one_at_a_time(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Two equal queries are started at the same time; each gets its own reply."""
    subject.require_concurrency(line)
    name, _ = subject.prefer_unpolled(*_TWICE)
    if subject.has_polled(name):
        raise CaseSkipped(
            UserMessage("the client polls all of {queries}", queries=", ".join(_TWICE))
        )
    one, other = _TWICE[name]
    first = subject.begin(name)
    line.request(name, first)
    second = subject.begin(name)  # not earlier: a driver may start two operations in any order
    line.wait(_PAUSE_S)
    if any(seen.name == name for seen in line.inbox):
        subject.tolerate(
            "3/25",
            "A-3-14",
            "two open requests",
            UserMessage(
                "the client sends {command} twice without waiting for the reply", command=name
            ),
        )
    line.reply(name, one)
    if sent_or_answered(subject, line, second) is None:
        subject.expect_result(second, one)  # the client used the reply to the first query
    else:
        line.request(name, second)
        line.reply(name, other)
        subject.expect_result(second, other)
    subject.expect_result(first, one)
