"""Defaults: sets, queries and restores the default program (4.12, 4.13)."""

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
"""The opcodes of the query, as in its heading and as in its table (A-4.12-1)."""
_ZERO: Final = b"0"


@contextmanager
def default_program_preserved(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> Iterator[None]:
    """Restore the default program when the context ends.

    If there was none, the default program ends when its file is deleted.
    """
    before = _default(line)
    try:
        yield
    finally:
        if before:
            with suppress(CaseFailed, CaseInconclusive):
                ensure_open(subject, line).ask("set_default_program", data=before)


def _default(line: OutgoingConnection) -> bytes:
    """Return the default program; empty if there is none, with or without a reply (A-4.12-2)."""
    line.send("get_default_program")
    for seen in line.collect_replies():
        if seen.name == "get_default_program" and isinstance(seen.value, bytes):
            return seen.value
    return b""


def query_default(
    subject: ControllerUnderTest, line: OutgoingConnection, opcode: int
) -> FrameSeen | None:
    """Query the default program with one of the two opcodes.

    Returns:
        The reply; None if the opcode is not served (A-3-9).

    Raises:
        CaseFailed: The reply has the other opcode.
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
        "the opcode of the reply differs from that of the request",
        expected=f"{opcode:02X}",
        observed=f"{replies[0].frame}",
        requirement="4.12/2",
    )
    return replies[0]


def reports_no_default(reply: FrameSeen) -> bool:
    """Whether a reply is 0: no default program, or an unknown opcode (A-3-9)."""
    return reply.frame.data == _ZERO


def _query_with_other_opcode(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> FrameSeen | None:
    """Query with the opcode that the dialect does not use; note it if it is served."""
    first = line.request("get_default_program").opcode
    other = next(opcode for opcode in OPCODES if opcode != first)
    reply = query_default(subject, line, other)
    if reply is None or reports_no_default(reply):
        return None
    subject.set_reading("op_get_default", f"0x{other:02X}")
    return reply


def expect_default(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, requirement: str
) -> None:
    """Require that this is the default program.

    Raises:
        CaseFailed: The default program is another one.
    """
    answer: ReceivedFrame | FrameSeen | None
    try:
        answer = line.ask("get_default_program")
    except NoReply:
        answer = _query_with_other_opcode(subject, line)
        if answer is None:
            raise
    if answer.frame.data == _ZERO:  # the opcode may be unknown
        answer = _query_with_other_opcode(subject, line) or answer
    expect(
        answer.value == name,
        "the default program is another one than expected",
        expected=show(name),
        observed=f"{answer.frame}",
        requirement=requirement,
    )
