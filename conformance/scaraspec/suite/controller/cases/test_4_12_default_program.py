"""Clause 4.12: read the default program (0x0D or 0x13, L265-275)."""

from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.state.defaults import (
    OPCODES,
    default_program_preserved,
    expect_default,
    query_default,
    reports_no_default,
)
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import CaseSkipped, expect
from scaraspec.suite.program_files.listed import store_program
from scaraspec.traffic.events import FrameSeen


def _replies(subject: ControllerUnderTest, line: OutgoingConnection) -> list[FrameSeen]:
    """Return the replies to both opcodes; if one has no program, only the other."""
    replies = [reply for opcode in OPCODES if (reply := query_default(subject, line, opcode))]
    return [reply for reply in replies if not reports_no_default(reply)] or replies


@case("4.12/2", "4.12/4")
def test_both_opcodes(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The two opcodes return the same default program, or one of them is not answered."""
    replies = _replies(subject, line)
    if not replies:
        message = "neither 0x0D nor 0x13 is answered: there may be no default program"
        subject.tolerate("4.12/4", "default_none", "silence", message)
        return
    expect(
        len({reply.value for reply in replies}) == 1,
        "the two opcodes returned different default programs",
        observed=", ".join(f"{reply.frame}" for reply in replies),
        requirement="4.12/3",
    )


@case("4.12/5", "4.12/2", "4.12/3", hazards=(Hazard.STATE,))
def test_default_program_is_returned(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """The default program is returned for 0x0D, 0x13 or both."""
    with default_program_preserved(subject, line):
        store_program(subject, line)
        name = store_program(subject, line)
        answer = line.ask("set_default_program", name)
        expect(
            answer.accepted,
            "a stored program cannot be made the default program",
            expected="1",
            observed=f"{answer}",
            requirement="4.13/2",
        )
        replies = _replies(subject, line)
        expect(
            replies,
            "neither 0x0D nor 0x13 is answered although there is a default program",
            expected=show(name),
            observed="silence",
        )
        for reply in replies:
            expect(
                reply.value == name,
                "the default program was returned with another name",
                expected=show(name),
                observed=f"{reply.frame}",
                requirement="4.12/3",
            )
        reply_opcodes = {f"0x{reply.frame.opcode:02X}" for reply in replies}
        subject.set_reading(
            "op_get_default", "both" if len(reply_opcodes) > 1 else reply_opcodes.pop()
        )


@case("4.12/4", "4.13/3", hazards=(Hazard.DESTRUCTIVE, Hazard.STATE), name="deleted")
def test_none(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After the default program is deleted, no program or its name is returned.

    The deletion of another program changes nothing. The deleted program becomes the default program
    again when it is stored and set again.
    """
    with default_program_preserved(subject, line):
        other, name = store_program(subject, line), store_program(subject, line)
        if not line.ask("set_default_program", name).accepted:
            raise CaseSkipped("no program can be made the default program")
        expect_default(subject, line, name, "4.12/3")
        if line.ask("delete_program", other).accepted:
            expect_default(subject, line, name, "4.13/3")
        if not line.ask("delete_program", name).accepted:
            raise CaseSkipped("the default program cannot be deleted (A-4.11-1)")
        for _ in range(2):  # other programs, which may take its place in the store
            store_program(subject, line)
        for reply in _replies(subject, line):
            expect(
                reply.value in (b"", name),
                "without a default program, the reply is not empty or 0",
                expected="no data, or 0",
                observed=f"{reply.frame}",
            )
        line = ensure_open(subject, line)  # an unknown opcode may have closed the old one
        store_program(subject, line, name)
        if line.ask("set_default_program", name).accepted:
            expect_default(subject, line, name, "4.13/3")
