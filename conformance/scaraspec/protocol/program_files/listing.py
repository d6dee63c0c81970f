"""Listing: a program as readable text, with one line per node, indented by loops, IFs and moves.

The text depends only on the program, not on its layout. Control characters in names are escaped. A
number that is not in its table is shown as a number.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from types import MappingProxyType

from scaraspec.protocol.fields import show
from scaraspec.protocol.program_files.model import (
    SECOND_US,
    Node,
    Operation,
    Point,
    Program,
    SetOutput,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)
from scaraspec.protocol.program_files.structure import Structure
from scaraspec.protocol.program_files.tables import (
    Condition,
    NodeType,
    Opt,
    PortType,
    ResultType,
    ValueType,
)

_MAX_DEPTH = 20  # levels of indentation: malicious nesting could exhaust the memory
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LAST_SECOND = 253_402_300_799  # of the year 9999, the last year of `datetime`


class PointMeaning(StrEnum):
    """The meaning of the four values of a point: the options of `point_meaning` (A-6.5-2)."""

    JOINTS = "joints"
    POSE = "pose"


_AXES: Mapping[PointMeaning, tuple[tuple[str, str], ...]] = MappingProxyType(
    {
        PointMeaning.JOINTS: (("J1", "°"), ("J2", "°"), ("Z", " mm"), ("J4", "°")),
        PointMeaning.POSE: (("x", " mm"), ("y", " mm"), ("z", " mm"), ("thetaX", "°")),
    }
)
_TOOL_AXES = (*_AXES[PointMeaning.POSE], ("thetaY", "°"), ("thetaZ", "°"))

_SYMBOLS: Mapping[int, str] = MappingProxyType(
    {
        Opt.ADD: "+",
        Opt.SUBTRACT: "-",
        Opt.MULTIPLY: "*",
        Opt.DIVIDE: "/",
        Opt.GREATER: ">",
        Opt.LESS: "<",
        Opt.EQUAL: "==",
        Opt.GREATER_OR_EQUAL: ">=",
        Opt.LESS_OR_EQUAL: "<=",
    }
)
_CONDITIONS: Mapping[int, str] = MappingProxyType(
    {
        Condition.GREATER: ">",
        Condition.LESS: "<",
        Condition.EQUAL: "==",
        Condition.NOT_GREATER: "<=",
        Condition.NOT_LESS: ">=",
    }
)
_PORT_TYPES: Mapping[int, str] = MappingProxyType(
    {
        PortType.UNUSED: "not configured",
        PortType.ANALOG_INPUT: "analog input",
        PortType.DIGITAL_INPUT: "digital input",
        PortType.PWM_OUTPUT: "PWM output",
        PortType.DIGITAL_OUTPUT: "digital output",
    }
)
_NODE_TEXTS: Mapping[int, str] = MappingProxyType(
    {
        NodeType.STRAIGHT_MOVE: "move straight at {0.speed_rate} %, counts {0.counts}",
        NodeType.CURVE_MOVE: "move in a curve at {0.speed_rate} %, counts {0.counts}",
        NodeType.LOOP: "loop, counts {0.counts}",
        NodeType.END_LOOP: "end loop",
        NodeType.ELSE: "else",
        NodeType.ENDIF: "end if",
    }
)


def listing(program: Program, points: PointMeaning = PointMeaning.JOINTS) -> str:
    """Return the program as lines of text; the last line ends with a newline, too.

    Args:
        program: Any program, valid or not.
        points: How to interpret the values of points.
    """
    return "".join(f"{line}\n" for line in _ListingWriter(program, points).lines())


def _coordinates(axes: tuple[tuple[str, str], ...], values: tuple[float, ...]) -> str:
    # Single precision has seven significant digits.
    return ", ".join(
        f"{name} {value:.7g}{unit}" for (name, unit), value in zip(axes, values, strict=True)
    )


class _ListingWriter:
    """Converts one program to text."""

    def __init__(self, program: Program, points: PointMeaning) -> None:
        self._program = program
        self._axes = _AXES[points]
        self._structure = Structure.of(program.nodes)
        self._unmatched = {index for index, _ in self._structure.unbalanced}
        names = {variable.key: show(variable.name) for variable in program.variables}
        uses = Counter(names.values())
        # A name is shown in place of a key only if it is an identifier and unique.
        self._names = {
            key: name for key, name in names.items() if name.isidentifier() and uses[name] == 1
        }

    def lines(self) -> Iterator[str]:
        """Yield the lines: configuration, variables, nodes."""
        program = self._program
        yield f"tool position: {_coordinates(_TOOL_AXES, program.tool_position)}"
        yield f"tool center: {_coordinates(_TOOL_AXES[:3], program.tool_center)}"
        for number, port_type in enumerate(program.ports, start=1):
            if port_type != PortType.UNUSED:
                yield f"port {number}: {_port_type(port_type)}"
        for variable in program.variables:
            yield f'variable {variable.key} "{show(variable.name)}" = {variable.value}'
        width = len(str(len(program.nodes)))
        for index, node in enumerate(program.nodes):
            indent = "  " * min(self._structure.depths[index], _MAX_DEPTH)
            alias = f'  "{show(node.alias)}"' if node.alias else ""
            unmatched = "  (unmatched)" if index in self._unmatched else ""
            yield f"{index + 1:>{width}}  {indent}{self._meaning(node)}{alias}{unmatched}"

    def _meaning(self, node: Node) -> str:
        match node.data:
            case Point(values):
                text = f"to {_coordinates(self._axes, values)}"
            case WaitInput(port, hundredths, condition):
                value = f"{hundredths // 100}.{hundredths % 100:02}"
                symbol = _CONDITIONS.get(condition, f"(condition {condition})")
                text = f"wait until {self._port(port)} {symbol} {value}"
            case WaitSeconds(duration_s):
                text = f"wait {duration_s} s"
            case SetOutput():
                text = self._output(node.data)
            case WaitTimer():
                text = f"wait until {_instant(node.data)}"
            case Operation():
                text = self._operation(node.type, node.data)
            case None:
                text = _NODE_TEXTS.get(node.type, "(node type {0.type})").format(node)
        return text

    def _port(self, number: int) -> str:
        ports = self._program.ports
        if not 1 <= number <= len(ports):
            return f"port {number} (no such port)"
        return f"port {number} ({_port_type(ports[number - 1])})"

    def _output(self, output: SetOutput) -> str:
        text = f"set {self._port(output.port)} to {output.value}"
        if output.type == PortType.DIGITAL_OUTPUT:
            return text
        if output.type == PortType.PWM_OUTPUT:
            return f"{text} with time base {output.time_base}"
        return f"{text} (output type {output.type}) with time base {output.time_base}"

    def _operation(self, node_type: int, operation: Operation) -> str:
        what = self._expression(operation)
        match operation.result_type:
            case ResultType.CALCULATION | ResultType.ASSIGNMENT:
                what = f"{self._variable(operation.result)} = {what}"
            case ResultType.SET_PORT:
                what = f"set {self._port(operation.result)} to {what}"
            case ResultType.COMPARISON:
                if operation.result:
                    what += f" (result {operation.result})"
            case _:
                what += f" (result_type {operation.result_type}, result {operation.result})"
        return f"if {what}" if node_type == NodeType.IF else what

    def _expression(self, operation: Operation) -> str:
        a = self._value(operation.value_a_type, operation.value_a)
        if operation.opt == 0 and operation.value_b_type == ValueType.NONE:
            return a
        symbol = _SYMBOLS.get(operation.opt, f"(opt {operation.opt})")
        return f"{a} {symbol} {self._value(operation.value_b_type, operation.value_b)}"

    def _value(self, value_type: int, value: int) -> str:
        match value_type:
            case ValueType.NONE:
                return "nothing"
            case ValueType.NUMBER:
                return str(value)
            case ValueType.VARIABLE:
                return self._variable(value)
            case ValueType.INPUT_PORT:
                return self._port(value)
        return f"{value} (value type {value_type})"

    def _variable(self, key: int) -> str:
        return self._names.get(key, f"variable {key}")


def _port_type(port_type: int) -> str:
    return _PORT_TYPES.get(port_type, f"port type {port_type}")


def _instant(timer: WaitTimer) -> str:
    if 0 <= timer.seconds <= _LAST_SECOND and 0 <= timer.microseconds < SECOND_US:
        date = _EPOCH + timedelta(seconds=timer.seconds, microseconds=timer.microseconds)
        return f"{date:%Y-%m-%d %H:%M:%S.%f} UTC"
    return f"second {timer.seconds} and microsecond {timer.microseconds} since 1970"
