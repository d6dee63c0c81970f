"""Mutants of clause 4.32: setting a digital output."""

import re
from collections.abc import Callable
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    after,
    answer_when,
    decoded,
    executes_first,
    executing,
    on_request,
)
from scaraspec.protocol.commands import PortValue
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import NoSuchPortError, Ports
from scaraspec.virtual_controller.session import Request, Session

_SET = "set_digital_output"


def _parses(
    pattern: bytes,
    make: Callable[[re.Match[bytes]], PortValue] = lambda found: PortValue(
        int(found[1]), int(found[2])
    ),
) -> Core:
    """The data of settings that match a pattern are read as the value that `make` returns."""

    def parse(_core: ControllerCore, frame: Frame, value: Any) -> Any:
        found = re.fullmatch(pattern, frame.data)
        return make(found) if found else value

    return decoded(_SET, parse)


def _sets(put: Callable[[Ports[bool], int, int], None]) -> Core:
    """`put` executes settings: it receives all outputs, the port and the value 0 or 1."""

    def execute(core: ControllerCore, request: Request) -> bool:
        try:
            put(core.plant.digital_outputs, *request.value)
        except NoSuchPortError:
            return False
        return True

    return on_request(_SET, execute)


@mutant("setting-is-echoed", "4.32/4")
class EchoesSettings(ControllerCore):
    """A setting is answered with its port and value."""

    _data = b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self._data = frame.data
        super().handle(session, frame, now_s)

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x43 and frame.data == b"1":
            frame = frame._replace(data=self._data)
        super().emit(session, frame)


row(
    "refusals-of-ports-are-reasoned",
    "4.32/4",
    "A setting that fails is answered with 0 and a code.",
    first_reply(_SET, {b"0": b"0|05"}),
)
row(
    "refuses-and-sets-above-eight",
    "4.32/4 4.32/6",
    "A setting of an output above 8 is answered as failed, but it is executed.",
    after(_SET, lambda _, request, done: done and request.value.port <= 8),
)
row(
    "settings-are-lost-while-running",
    "4.32/4 4.32/6",
    "While a program runs, a setting is answered as done, but it is not executed.",
    answer_when(_SET, lambda core, _: core.robot.task is not None, value=True),
    subtle=True,
)
row(
    "settings-are-lost-while-moving",
    "4.32/4 4.32/6",
    "During a move or a jog, a setting is answered as done, but it is not executed.",
    answer_when(_SET, executing("jog", "set_tool_coordinates"), value=True),
    subtle=True,
)
row(
    "settings-are-lost-while-released",
    "4.32/4 4.32/6",
    "While the joints are released, a setting is answered as done, but it is not executed.",
    answer_when(_SET, lambda core, _: not core.plant.locked, value=True),
    subtle=True,
)
row(
    "ports-in-one-byte",
    "4.32/5",
    "Only the lowest byte of a port number is used.",
    _parses(rb"([0-9]+)\|([01])", lambda found: PortValue(int(found[1]) & 0xFF, int(found[2]))),
)
row(
    "ports-from-zero",
    "4.32/5",
    "Port 0 sets the first output.",
    _parses(rb"0+\|([01])", lambda found: PortValue(1, int(found[1]))),
)
row(
    "ports-below-zero",
    "4.32/5",
    "A negative port number counts the outputs from the end.",
    _parses(rb"-([0-9]+)\|([01])", lambda found: PortValue(17 - int(found[1]), int(found[2]))),
)
row(
    "says-it-has-set-any-port",
    "4.32/5",
    "A setting is always answered as done, even if the port does not exist.",
    first_reply(_SET, lambda _: b"1"),
)


def _set_to_one(outputs: Ports[bool], port: int, value: int) -> None:
    if value == 1:
        outputs[port] = True


def _toggle(outputs: Ports[bool], port: int, value: int) -> None:
    outputs[port] = value == 1 and not outputs[port]


def _clear_others(outputs: Ports[bool], port: int, value: int) -> None:
    outputs[port] = value == 1
    for other, _ in enumerate(outputs, start=1):
        if other != port:
            outputs[other] = False


def _set_pair(outputs: Ports[bool], port: int, value: int) -> None:
    outputs[port] = value == 1
    if port == 8:
        outputs[16] = value == 1


def _wrap(outputs: Ports[bool], port: int, value: int) -> None:
    outputs[(port - 1) % 16 + 1 if 16 < port <= 40 else port] = value == 1


def _set_below_sixteen(outputs: Ports[bool], port: int, value: int) -> None:
    if port < 16:
        outputs[port] = value == 1


def _set_at_most_eight(outputs: Ports[bool], port: int, value: int) -> None:
    if value != 1 or sum(outputs) < 8:
        outputs[port] = value == 1


row(
    "settings-never-switch-off",
    "4.32/6",
    "A setting to 0 is answered as done, but it has no effect.",
    _sets(_set_to_one),
)
row(
    "settings-toggle",
    "4.32/6",
    "A setting to 1 toggles an output.",
    _sets(_toggle),
)
row(
    "settings-clear-the-others",
    "4.32/6",
    "A setting switches all other outputs off.",
    _sets(_clear_others),
)
row(
    "settings-of-pairs",
    "4.32/6",
    "Output 16 is set together with output 8.",
    _sets(_set_pair),
    subtle=True,
)
row(
    "settings-beyond-the-last-wrap",
    "4.32/6",
    "A setting of a port from 17 to 40 is answered as done and sets one of the outputs.",
    _sets(_wrap),
    subtle=True,
)
row(
    "highest-output-is-dead",
    "4.32/6",
    "A setting of output 16 is answered as done, but it has no effect.",
    _sets(_set_below_sixteen),
    subtle=True,
)


@mutant("outputs-show-late", "4.32/6", subtle=True)
class ReportsOldOutputs(ControllerCore):
    """The first reply after a setting has the outputs before that setting."""

    _before = ""

    def set_digital_output(self, request: Request) -> bool:
        self._before = super().get_digital_outputs(request)
        return super().set_digital_output(request)

    def get_digital_outputs(self, request: Request) -> str:
        before, self._before = self._before, ""
        return before or super().get_digital_outputs(request)


def _clear(outputs: Ports[bool]) -> None:
    for port, _ in enumerate(outputs, start=1):
        outputs[port] = False


@mutant("outputs-go-off-with-the-link", "4.32/6", subtle=True)
class ClearsOutputsOnClose(ControllerCore):
    """All outputs are switched off when a connection ends."""

    def close(self, connection: int, now_s: float) -> list[Any]:
        _clear(self.plant.digital_outputs)
        return super().close(connection, now_s)


row(
    "no-more-than-eight-outputs",
    "4.32/6",
    "While eight outputs are on, switching on another one is answered as done without effect.",
    _sets(_set_at_most_eight),
    subtle=True,
)


@mutant("settings-wear-out", "4.32/6", subtle=True)
class IgnoresLateSettings(ControllerCore):
    """After 150 settings, settings are answered as done, but they have no effect."""

    _settings = 0

    def set_digital_output(self, request: Request) -> bool:
        self._settings += 1
        return self._settings > 150 or super().set_digital_output(request)


row(
    "settings-as-in-c",
    "4.32/7",
    "The numbers of a setting are read up to the first other character, and the rest is ignored.",
    _parses(rb"\s*([0-9]+)[^|]*\|\s*([01])(?s:.*)"),
)
row(
    "settings-with-any-separator",
    "4.32/7",
    "Any byte is accepted between port and value.",
    _parses(rb"([0-9]+)[^0-9]([01])"),
)
row(
    "settings-without-value",
    "4.32/7",
    "A port without a value is switched on.",
    _parses(rb"([0-9]+)\|?", lambda found: PortValue(int(found[1]), 1)),
)
row(
    "settings-of-the-first-two",
    "4.32/7",
    "Further fields after port and value are ignored.",
    _parses(rb"([0-9]+)\|([01])\|(?s:.*)"),
)
row(
    "settings-by-characters",
    "4.32/7",
    "Any value that does not begin with a digit is read as 1.",
    _parses(rb"([0-9]+)\|([^0-9|](?s:.*))", lambda found: PortValue(int(found[1]), 1)),
)


@mutant("empty-settings-clear-all", "4.32/7")
class ClearsOutputsOnEmptySetting(ControllerCore):
    """A setting without data switches all outputs off."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x43 and not frame.data:
            _clear(self.plant.digital_outputs)
        super().handle(session, frame, now_s)


row(
    "other-values-set-the-next-port",
    "4.32/7",
    "A value of two or more digits switches on the output before the port.",
    _parses(rb"([0-9]+)\|[0-9]{2,}", lambda found: PortValue(int(found[1]) - 1, 1)),
)

row(
    "two-outputs-per-connection",
    "4.32/6",
    "Only the first two outputs of a connection are set; later ones are answered 1.",
    executes_first("set_digital_output", 2),
    subtle=True,
)
