"""Defaults: the default program, made, told and put back (4.12, 4.13)."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Final

from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply, expect
from scaraspec.traffic.events import FrameSeen

if TYPE_CHECKING:
    from scaraspec.suite.engine.connection import ReceivedFrame

OPCODES: Final = (0x0D, 0x13)
"""What asks for the default program, as headed and as printed (A-4.12-1)."""
_ZERO: Final = b"0"


@contextmanager
def default_program_preserved(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> Iterator[None]:
    """Put the default program back afterwards; where there was none it ends with its file."""
    before = _default(line)
    try:
        yield
    finally:
        if before:
            with suppress(CaseFailed, CaseInconclusive):
                ensure_open(subject, line).ask("set_default_program", data=before)


def _default(line: OutgoingConnection) -> bytes:
    """The default program; empty where there is none, which need not be answered (A-4.12-2)."""
    line.send("get_default_program")
    for seen in line.collect_replies():
        if seen.name == "get_default_program" and isinstance(seen.value, bytes):
            return seen.value
    return b""


def query_default(
    subject: ControllerUnderTest, line: OutgoingConnection, opcode: int
) -> FrameSeen | None:
    """Ask with one of the two opcodes; the reply, None where it is not served (A-3-9).

    Raises:
        CaseFailed: The reply bears the other one.
    """
    line = ensure_open(subject, line)
    line.send_frame(Frame(A2C, opcode))
    try:
        replies = [seen for seen in line.collect_replies() if seen.frame.opcode in OPCODES]
    except NoReply:
        return None
    if not replies:
        return None
    expect(
        replies[0].frame.opcode == opcode,
        "the reply bears another opcode than the request",
        expected=f"{opcode:02X}",
        observed=f"{replies[0].frame}",
        requirement="4.12/2",
    )
    return replies[0]


def reports_no_default(reply: FrameSeen) -> bool:
    """Whether a reply is the 0 that means no default program, or no such opcode (A-3-9)."""
    return reply.frame.data == _ZERO


def _by_the_other_opcode(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> FrameSeen | None:
    """The default program, if the opcode of the reply is not that of the request."""
    asked = line.request("get_default_program").opcode
    other = next(opcode for opcode in OPCODES if opcode != asked)
    told = query_default(subject, line, other)
    if told is None or reports_no_default(told):
        return None
    subject.set_reading("op_get_default", f"0x{other:02X}")
    return told


def expect_default(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, requirement: str
) -> None:
    """Fail the subject unless this is its default program.

    Raises:
        CaseFailed: It is another one.
    """
    answer: ReceivedFrame | FrameSeen | None
    try:
        answer = line.ask("get_default_program")
    except NoReply:
        answer = _by_the_other_opcode(subject, line)
        if answer is None:
            raise
    if answer.frame.data == _ZERO:  # perhaps to an opcode that it does not know
        answer = _by_the_other_opcode(subject, line) or answer
    expect(
        answer.value == name,
        "the default program is another one than it should be",
        expected=show(name),
        observed=f"{answer.frame}",
        requirement=requirement,
    )
