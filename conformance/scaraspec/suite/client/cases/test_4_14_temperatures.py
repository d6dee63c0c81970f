"""4.14: reading the temperatures; the reply has opcode 0x0F, or 0x0E as printed (A-4.14-1)."""

import math
from itertools import product
from typing import Any, Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.driver_values import matches
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported, request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect

_NAME: Final = "get_motor_temperatures"
_SETTING: Final = "set_default_program"
_AS_PRINTED: Final = Frame(C2A, 0x0E, b"20|38|34|22")
_TEMPERATURES: Final = {"inner_arm": 20, "outer_arm": 38, "wrist": 34, "rotation": 22}
_SHORT_S: Final = 0.1
_IGNORED_S: Final = 1.0
"""A client on a busy machine that has not answered after this time has ignored the reply."""
_texts: Final = st.integers(-400, 1500).map(lambda tenths: f"{tenths / 10:g}") | st.integers(
    -40, 150
).map(str)


@client_case("4.14/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends get_motor_temperatures without data and reports the reply."""
    expect_reported(subject, line, _NAME, requirement="T/9")


def _is_whole(reported: Any, due: dict[str, float]) -> bool:
    """Whether the reported temperatures are whole degrees, rounded up or down."""
    return isinstance(reported, dict) and any(
        matches(reported, dict(zip(due, whole, strict=True)))
        for whole in product(*((math.floor(value), math.ceil(value)) for value in due.values()))
    )


@client_case("T/9", name="temperatures")
def test_temperatures(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports the temperatures in order, with signs and decimals (A-4.14-2)."""

    @example(("20", "38.5", "-4", "0"))
    @example(("1", "2", "3", "4"))
    @given(st.tuples(*[_texts] * 4))
    def each(texts: tuple[str, ...]) -> None:
        call, _ = request_operation(subject, line, _NAME)
        line.reply(_NAME, data="|".join(texts).encode())
        due = dict(zip(_TEMPERATURES, map(float, texts), strict=True))
        if subject.wait_for_answer(call).ok and not _is_whole(call.result, due):
            subject.expect_result(call, due)
        elif any("." in text for text in texts):
            subject.tolerate(
                "T/9", "A-4.14-2", "integers", "the client does not report decimals of temperatures"
            )
        else:
            subject.expect_done(call)

    each()


@client_case("4.14/4")
def test_as_printed(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The temperatures arrive with opcode 0x0E, and with 0x0F if the client ignores 0x0E."""
    call, _ = request_operation(subject, line, _NAME)
    line.send_frame(_AS_PRINTED)
    answered = subject.answers_within(call, _IGNORED_S)
    if answered and not call.ok:
        subject.tolerate(
            "4.14/4", "op_temp_reply", "0x0F", "the client rejects temperatures with opcode 0x0E"
        )
        return
    if not answered:
        subject.tolerate(
            "4.14/4", "op_temp_reply", "0x0F", "the client ignores temperatures with opcode 0x0E"
        )
        line.send_frame(_AS_PRINTED._replace(opcode=0x0F))
    subject.expect_result(call, _TEMPERATURES)


@client_case("4.14/4", name="mistaken")
def test_not_mistaken(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Temperatures with opcode 0x0E are not the reply to set_default_program."""
    call, _ = request_operation(subject, line, "set_default_program")
    line.send_frame(_AS_PRINTED)
    line.wait(_SHORT_S)
    expect(
        not call.ok,
        "the client took temperatures for the reply to set_default_program",
        expected="no answer yet",
        observed=f"{call}",
    )
    if call.answer is None:
        line.reply("set_default_program", data=b"0")
        subject.expect_failure(call)


@client_case("4.14/4", name="both")
def test_both(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A query of temperatures and set_default_program are pending together; each gets its reply.

    Both orders of the requests and both orders of the replies are tried.
    """
    subject.require_concurrency(line)
    for names, swapped in examples(product(((_NAME, _SETTING), (_SETTING, _NAME)), (False, True))):
        calls = {name: request_operation(subject, line, name)[0] for name in names}
        asking, setting = calls[_NAME], calls[_SETTING]
        frames = [_AS_PRINTED, Frame(C2A, 0x0E, b"1")]
        for frame in reversed(frames) if swapped else frames:
            line.send_frame(frame)
        if not subject.answers_within(asking, _IGNORED_S):
            message = "the client ignores temperatures with opcode 0x0E"
            subject.tolerate("4.14/4", "op_temp_reply", "0x0F", message)
            line.send_frame(_AS_PRINTED._replace(opcode=0x0F))
        subject.expect_result(asking, _TEMPERATURES)
        subject.expect_done(setting)
