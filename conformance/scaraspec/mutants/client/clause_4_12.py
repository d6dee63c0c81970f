"""Mutants of clauses 4.12 to 4.14: the default program, and temperatures with its opcode."""

from scaraspec.client.pending_operation import PendingOperation
from scaraspec.mutants.client import row
from scaraspec.mutants.operators.client.frames import received, received_while, sent
from scaraspec.mutants.operators.client.messages import request_data
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_GET_DEFAULT = BY_NAME["get_default_program"]
_SET_DEFAULT = BY_NAME["set_default_program"].opcode
_TEMPERATURES = BY_NAME["get_motor_temperatures"].opcode


def _under_both_opcodes(frame: Frame) -> list[Frame]:
    if frame.opcode == _GET_DEFAULT.opcode and _GET_DEFAULT.alternate_opcode:
        return [frame, frame._replace(opcode=_GET_DEFAULT.alternate_opcode, data=b"pro1.rob")]
    return [frame]


def _temperatures_as_yes(frame: Frame, pending: list[PendingOperation]) -> Frame:
    setting = any(each.command.opcode == _SET_DEFAULT for each in pending)
    mistaken = setting and frame.opcode == _SET_DEFAULT and b"|" in frame.data
    return frame._replace(data=b"1") if mistaken else frame


def _yes_as_temperatures(frame: Frame, pending: list[PendingOperation]) -> Frame:
    expected = any(each.command.opcode == _TEMPERATURES for each in pending)
    if expected and frame.opcode == _SET_DEFAULT:
        return frame._replace(opcode=_TEMPERATURES)
    return frame


def _reversed_temperatures(frame: Frame) -> Frame:
    if frame.opcode == _SET_DEFAULT and frame.data.count(b"|") > 1:
        return frame._replace(data=b"|".join(frame.data.split(b"|")[::-1]))
    return frame


row(
    "asks-for-the-default-with-data",
    "4.12/1",
    "The request for the default program contains a 0.",
    request_data("get_default_program", lambda data: data + b"0"),
)
row(
    "asks-for-the-default-under-both",
    "4.12/1",
    "The default program is requested with 0D and, with a program name, with 13.",
    sent(_under_both_opcodes),
    subtle=True,
)
row(
    "sends-the-path",
    "4.13/1",
    "The name of the default program is sent with its folder.",
    request_data("set_default_program", lambda data: b"/programs/" + data),
)
row(
    "sends-the-first-part-of-names",
    "4.13/1",
    "The text after the last of several dots in the name of the default program is sent as rob.",
    request_data(
        "set_default_program",
        lambda data: data.rpartition(b".")[0] + b".rob" if data.count(b".") > 1 else data,
    ),
    subtle=True,
)
row(
    "asks-for-every-motor",
    "4.14/1",
    "The request for the temperatures contains the numbers of the motors.",
    request_data("get_motor_temperatures", lambda data: data + b"1|2|3|4"),
)
row(
    "takes-temperatures-for-yes",
    "4.14/4",
    "Temperatures with the opcode 0E are taken as acceptance of a new default program.",
    received_while(_temperatures_as_yes),
)
row(
    "takes-yes-for-temperatures",
    "4.14/4",
    "Any reply with the opcode 0E is taken as temperatures if they are expected.",
    received_while(_yes_as_temperatures),
    subtle=True,
)
row(
    "reads-printed-temperatures-backwards",
    "4.14/4 T/9",
    "Temperatures with the opcode 0E are read in reverse order.",
    received(_reversed_temperatures),
    subtle=True,
)
