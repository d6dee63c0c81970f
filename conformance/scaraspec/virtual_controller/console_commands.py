"""Control: lines of text that break, repair and drive the plant while the controller runs.

What a line means lives here; where lines come from does not.
"""

import reprlib
from collections.abc import Callable, Mapping
from typing import Final

from scaraspec.protocol.errors import Joint, code_for_joints
from scaraspec.user_message import UserMessage
from scaraspec.virtual_controller.plant import NoSuchPortError, Plant

HELP: Final = """\
motor-fault JOINT[,JOINT]... [lasting]   joints: inner_arm, outer_arm, wrist, rotation
position-fault [lasting]                 code 05
angle-fault [lasting]                    code 06
repair                                   take lasting causes away; a reset then clears the faults
clear                                    take all faults and their causes away
disk-full on|off                         let the disk take nothing more
input PORT 0|1                           drive a digital input, 1 to 8
analog PORT VALUE                        drive an analog input, 1 to 8
help                                     show this"""

_JOINTS: Final = {joint.name.lower(): joint for joint in Joint}


class ConsoleCommandError(Exception):
    """A line that cannot be obeyed; the text is one sentence."""


def execute(line: str, plant: Plant, now_s: float) -> str:
    """Do what a line says.

    Returns:
        What was done, in a few words; nothing for an empty line; the whole of `HELP` if asked.

    Raises:
        ControlError: The line says nothing that can be done.
    """
    words = line.split()
    if not words:
        return ""
    command = _COMMANDS.get(words[0])
    if command is None:
        raise ConsoleCommandError(
            UserMessage(
                "there is no command {words}: they are {commands}",
                words=reprlib.repr(words[0]),
                commands=", ".join(_COMMANDS),
            )
        )
    return command(words[1:], plant, now_s)


def _motor_fault(words: list[str], plant: Plant, now_s: float) -> str:
    names, lasting = _with_lasting(words)
    if len(names) != 1:
        raise ConsoleCommandError(
            UserMessage(
                "motor-fault takes joints between commas: {joints}", joints=", ".join(_JOINTS)
            )
        )
    joints = names[0].split(",")
    for name in joints:
        if name not in _JOINTS:
            raise ConsoleCommandError(
                UserMessage(
                    "there is no joint {name}: they are {joints}",
                    name=reprlib.repr(name),
                    joints=", ".join(_JOINTS),
                )
            )
    code = code_for_joints(_JOINTS[name] for name in joints).text
    return _fail(code, plant, now_s, lasting=lasting)


def _fault(code: str) -> Callable[[list[str], Plant, float], str]:
    def command(words: list[str], plant: Plant, now_s: float) -> str:
        others, lasting = _with_lasting(words)
        if others:
            raise ConsoleCommandError(
                UserMessage(
                    "a fault takes no {others}, only the word lasting",
                    others=reprlib.repr(others[0]),
                )
            )
        return _fail(code, plant, now_s, lasting=lasting)

    return command


def _fail(code: str, plant: Plant, now_s: float, *, lasting: bool) -> str:
    plant.fail(code, now_s, lasting=lasting)
    return f"status {plant.fault_code}"


def _with_lasting(words: list[str]) -> tuple[list[str], bool]:
    return [word for word in words if word != "lasting"], "lasting" in words


def _repair(words: list[str], plant: Plant, _: float) -> str:
    _none(words)
    plant.repair()
    return "the causes of all faults are gone"


def _clear(words: list[str], plant: Plant, _: float) -> str:
    _none(words)
    plant.repair()
    plant.clear_faults()
    return "all faults are gone"


def _disk_full(words: list[str], plant: Plant, _: float) -> str:
    if words not in (["on"], ["off"]):
        raise ConsoleCommandError("disk-full takes on or off")
    plant.disk_full = words == ["on"]
    return "the disk is full" if plant.disk_full else "the disk has room"


def _input(words: list[str], plant: Plant, _: float) -> str:
    port, value = _port(words, "0 or 1")
    if value not in ("0", "1"):
        raise ConsoleCommandError(
            UserMessage("a digital input is 0 or 1, not {value}", value=reprlib.repr(value))
        )
    try:
        plant.digital_inputs[port] = value == "1"
    except NoSuchPortError as error:
        raise ConsoleCommandError(str(error)) from None
    return f"digital input {port} is {value}"


def _analog(words: list[str], plant: Plant, _: float) -> str:
    port, value = _port(words, "a number")
    try:
        plant.analog_inputs[port] = float(value)
    except NoSuchPortError as error:
        raise ConsoleCommandError(str(error)) from None
    except ValueError:
        raise ConsoleCommandError(
            UserMessage("no analog input can be {value}", value=reprlib.repr(value))
        ) from None
    return f"analog input {port} is {plant.analog_inputs[port]:g}"


def _port(words: list[str], kind: str) -> tuple[int, str]:
    match words:
        case [port, value] if port.isdecimal() and len(port) <= 3:  # noqa: PLR2004 - no port has more digits
            return int(port), value
    raise ConsoleCommandError(UserMessage("an input takes its port, 1 to 8, and {kind}", kind=kind))


def _help(words: list[str], _plant: Plant, _now_s: float) -> str:
    _none(words)
    return HELP


def _none(words: list[str]) -> None:
    if words:
        raise ConsoleCommandError(
            UserMessage(
                "this command takes nothing more, not {words}", words=reprlib.repr(words[0])
            )
        )


_COMMANDS: Mapping[str, Callable[[list[str], Plant, float], str]] = {
    "motor-fault": _motor_fault,
    "position-fault": _fault("05"),
    "angle-fault": _fault("06"),
    "repair": _repair,
    "clear": _clear,
    "disk-full": _disk_full,
    "input": _input,
    "analog": _analog,
    "help": _help,
}
