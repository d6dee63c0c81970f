"""Console commands: lines that inject faults, repair the plant and set inputs at run time.

`console` reads the lines.
"""

import reprlib
from collections.abc import Callable, Mapping
from typing import Final

from scaraspec.protocol.errors import Joint, code_for_joints
from scaraspec.user_message import UserMessage, sentence_of
from scaraspec.virtual_controller.plant import NoSuchPortError, Plant

HELP: Final = """\
motor-fault JOINT[,JOINT]... [lasting]   joints: inner_arm, outer_arm, wrist, rotation
position-fault [lasting]                 code 05
angle-fault [lasting]                    code 06
repair                                   remove lasting causes; a reset then clears the faults
clear                                    remove all faults and their causes
disk-full on|off                         make the disk full, or not full
input PORT 0|1                           set a digital input, 1 to 8
analog PORT VALUE                        set an analog input, 1 to 8
help                                     show this help"""

_JOINTS: Final = {joint.name.lower(): joint for joint in Joint}


class ConsoleCommandError(Exception):
    """The line cannot be executed. The text is one sentence."""


def execute(line: str, plant: Plant, now_s: float) -> str:
    """Execute a command line.

    Args:
        line: The command with its arguments.
        plant: The plant that it changes.
        now_s: The current time in seconds.

    Returns:
        A short description of the effect; empty for an empty line; `HELP` for ``help``.

    Raises:
        ConsoleCommandError: The line is not a valid command.
    """
    words = line.split()
    if not words:
        return ""
    command = _COMMANDS.get(words[0])
    if command is None:
        raise ConsoleCommandError(
            UserMessage(
                "there is no command {name}: the commands are {commands}",
                name=reprlib.repr(words[0]),
                commands=", ".join(_COMMANDS),
            )
        )
    return command(words[1:], plant, now_s)


def _motor_fault(words: list[str], plant: Plant, now_s: float) -> str:
    names, lasting = _with_lasting(words)
    if len(names) != 1:
        raise ConsoleCommandError(
            UserMessage(
                "motor-fault takes joints separated by commas: {joints}", joints=", ".join(_JOINTS)
            )
        )
    joints = names[0].split(",")
    for name in joints:
        if name not in _JOINTS:
            raise ConsoleCommandError(
                UserMessage(
                    "there is no joint {name}: the joints are {joints}",
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
                    "a fault takes no argument {argument}, only the word lasting",
                    argument=reprlib.repr(others[0]),
                )
            )
        return _fail(code, plant, now_s, lasting=lasting)

    return command


def _fail(code: str, plant: Plant, now_s: float, *, lasting: bool) -> str:
    plant.fail(code, now_s, lasting=lasting)
    return UserMessage("status {code}", code=plant.fault_code)


def _with_lasting(words: list[str]) -> tuple[list[str], bool]:
    return [word for word in words if word != "lasting"], "lasting" in words


def _repair(words: list[str], plant: Plant, _: float) -> str:
    _require_no_arguments(words)
    plant.repair()
    return "the causes of all faults are removed"


def _clear(words: list[str], plant: Plant, _: float) -> str:
    _require_no_arguments(words)
    plant.repair()
    plant.clear_faults()
    return "all faults are removed"


def _disk_full(words: list[str], plant: Plant, _: float) -> str:
    if words not in (["on"], ["off"]):
        raise ConsoleCommandError("disk-full takes on or off")
    plant.disk_full = words == ["on"]
    return "the disk is full" if plant.disk_full else "the disk has room"


def _input(words: list[str], plant: Plant, _: float) -> str:
    port, value = _port(words, "0 or 1")
    if value not in ("0", "1"):
        raise ConsoleCommandError(
            UserMessage("a digital input must be 0 or 1, not {value}", value=reprlib.repr(value))
        )
    try:
        plant.digital_inputs[port] = value == "1"
    except NoSuchPortError as error:
        raise ConsoleCommandError(sentence_of(error)) from None
    return UserMessage("digital input {port} is {value}", port=port, value=value)


def _analog(words: list[str], plant: Plant, _: float) -> str:
    port, value = _port(words, "a number")
    try:
        plant.analog_inputs[port] = float(value)
    except NoSuchPortError as error:
        raise ConsoleCommandError(sentence_of(error)) from None
    except ValueError:
        raise ConsoleCommandError(
            UserMessage("{value} is not a valid analog value", value=reprlib.repr(value))
        ) from None
    return UserMessage(
        "analog input {port} is {value:g}", port=port, value=plant.analog_inputs[port]
    )


def _port(words: list[str], value_form: str) -> tuple[int, str]:
    match words:
        case [port, value] if port.isdecimal() and len(port) <= 3:  # noqa: PLR2004 - no port has more digits
            return int(port), value
    raise ConsoleCommandError(
        UserMessage("an input takes a port, 1 to 8, and {value_form}", value_form=value_form)
    )


def _help(words: list[str], _plant: Plant, _now_s: float) -> str:
    _require_no_arguments(words)
    return HELP


def _require_no_arguments(words: list[str]) -> None:
    if words:
        raise ConsoleCommandError(
            UserMessage(
                "this command takes no argument, but {argument} was given",
                argument=reprlib.repr(words[0]),
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
