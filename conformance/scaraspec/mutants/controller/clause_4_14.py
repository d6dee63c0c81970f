"""Mutants of clause 4.14: the temperatures of the motors."""

from collections.abc import Callable

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, sent_frame
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session


def _reply(change: Callable[[bytes], bytes]) -> Core:
    return first_reply("get_motor_temperatures", change)


row(
    "temperatures-of-three-motors",
    "4.14/2",
    "The reply has no temperature of the rotation motor.",
    _reply(lambda data: data.rpartition(b"|")[0]),
)
row(
    "temperatures-with-units",
    "4.14/2",
    "Each temperature has a unit.",
    _reply(lambda data: data.replace(b"|", b"C|") + b"C"),
)
row(
    "temperatures-with-commas",
    "4.14/2",
    "Each temperature has a decimal comma.",
    _reply(lambda data: data.replace(b"|", b",0|") + b",0"),
)
row(
    "temperatures-without-bars",
    "4.14/2",
    "There are no bars between the temperatures.",
    _reply(lambda data: data.replace(b"|", b"")),
)


@mutant("cold-motor-is-not-told", "4.14/2", subtle=True)
class OmitsColdMotor(ControllerCore):
    """From the third reply on, the first temperature of 25 degrees is an empty field."""

    _count = 0

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x0F:
            self._count += 1
            if self._count >= 3:
                frame = frame._replace(data=frame.data.replace(b"25", b"", 1))
        super().emit(session, frame)


row(
    "temperatures-under-another-opcode",
    "4.14/3",
    "The temperatures have the opcode 0x10.",
    sent_frame(lambda frame: frame.opcode == 0x0F, opcode=0x10),
)
