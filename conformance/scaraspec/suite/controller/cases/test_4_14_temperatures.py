"""Clause 4.14: the motor temperatures (0x0F, L289-302)."""

from scaraspec.protocol.commands import BY_NAME, JointValues
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect

_REPEATS = 5
_PAUSE_S = 0.05


@case("4.14/2", "4.14/5")
def test_temperatures(line: OutgoingConnection) -> None:
    """The temperatures are four numbers with separators in each reply."""
    for _ in range(_REPEATS):
        reply = line.ask("get_motor_temperatures")
        expect(
            isinstance(reply.value, JointValues),
            "the temperatures are not four numbers with separators",
            expected="inner arm|outer arm|wrist|rotation",
            observed=f"{reply}",
        )
        line.wait(_PAUSE_S)


@case("4.14/3")
def test_opcode(line: OutgoingConnection) -> None:
    """The temperatures have the opcode 0x0F, or 0x0E as printed."""
    command = BY_NAME["get_motor_temperatures"]
    line.send("get_motor_temperatures")
    frames = line.collect_replies()
    replies = [
        received
        for received in frames
        if received.frame.opcode in (command.opcode, command.alternate_reply_opcode)
    ]
    if not replies:
        observed = "; ".join(f"{received.frame}" for received in frames)
        if not observed:
            message = "the request for the temperatures was not answered"
            raise NoReply(message, expected="a reply", observed="silence")
        message = "the temperatures have the opcode of another command"
        raise CaseFailed(message, expected="0F, or 0E", observed=observed)
