"""Listing: a program as readable text, with one line per node, indented by loops, IFs and moves.

The text depends only on the program, not on its layout. Control characters in names are escaped. A
number that is not in its table is shown as a number. Lines are messages: a command can show them in
another language.
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
from scaraspec.user_message import UserMessage

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
        PortType.UNUSED: UserMessage("not configured"),
        PortType.ANALOG_INPUT: UserMessage("analog input"),
        PortType.DIGITAL_INPUT: UserMessage("digital input"),
        PortType.PWM_OUTPUT: UserMessage("PWM output"),
        PortType.DIGITAL_OUTPUT: UserMessage("digital output"),
    }
)
_NODE_TEXTS: Mapping[int, str] = MappingProxyType(
    {
        NodeType.STRAIGHT_MOVE: "move straight at {speed} %, counts {counts}",
        NodeType.CURVE_MOVE: "move in a curve at {speed} %, counts {counts}",
        NodeType.LOOP: "loop, counts {counts}",
        NodeType.END_LOOP: "end loop",
        NodeType.ELSE: UserMessage("else"),
        NodeType.ENDIF: "end if",
    }
)


def listing(program: Program, points: PointMeaning = PointMeaning.JOINTS) -> str:
    """Return the program as lines of text; the last line ends with a newline, too.

    Args:
        program: Any program, valid or not.
        points: How to interpret the values of points.
    """
    return "".join(f"{line}\n" for line in listing_lines(program, points))


def listing_lines(
    program: Program, points: PointMeaning = PointMeaning.JOINTS
) -> Iterator[UserMessage]:
    """Yield the lines of the listing as messages; the arguments are those of `listing`."""
    return _ListingWriter(program, points).lines()


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

    def lines(self) -> Iterator[UserMessage]:
        """Yield the lines: configuration, variables, nodes."""
        program = self._program
        position = _coordinates(_TOOL_AXES, program.tool_position)
        yield UserMessage("tool position: {position}", position=position)
        center = _coordinates(_TOOL_AXES[:3], program.tool_center)
        yield UserMessage("tool center: {center}", center=center)
        for number, port_type in enumerate(program.ports, start=1):
            if port_type != PortType.UNUSED:
                yield UserMessage(
                    "port {number}: {type}", number=number, type=_port_type(port_type)
                )
        for variable in program.variables:
            yield UserMessage(
                'variable {key} "{name}" = {value}',
                key=variable.key,
                name=show(variable.name),
                value=variable.value,
            )
        width = len(str(len(program.nodes)))
        for index, node in enumerate(program.nodes):
            indent = "  " * min(self._structure.depths[index], _MAX_DEPTH)
            line = UserMessage(
                "{number}{meaning}",
                number=f"{index + 1:>{width}}  {indent}",
                meaning=self._meaning(node),
            )
            if node.alias:
                line = UserMessage('{line}  "{alias}"', line=line, alias=show(node.alias))
            if index in self._unmatched:
                line = UserMessage("{line}  (unmatched)", line=line)
            yield line

    def _meaning(self, node: Node) -> str:
        text: str
        match node.data:
            case Point(values):
                text = UserMessage("to {point}", point=_coordinates(self._axes, values))
            case WaitInput(port, hundredths, condition):
                symbol = _CONDITIONS.get(condition)
                text = UserMessage(
                    "wait until {port} {symbol} {value}",
                    port=self._port(port),
                    symbol=symbol or UserMessage("(condition {number})", number=condition),
                    value=f"{hundredths // 100}.{hundredths % 100:02}",
                )
            case WaitSeconds(duration_s):
                text = UserMessage("wait {duration_s} s", duration_s=duration_s)
            case SetOutput():
                text = self._output(node.data)
            case WaitTimer():
                text = UserMessage("wait until {instant}", instant=_instant(node.data))
            case Operation():
                text = self._operation(node.type, node.data)
            case None:
                template = _NODE_TEXTS.get(node.type, "(node type {type})")
                text = UserMessage(
                    template, speed=node.speed_rate, counts=node.counts, type=node.type
                )
        return text

    def _port(self, number: int) -> str:
        ports = self._program.ports
        if not 1 <= number <= len(ports):
            return UserMessage("port {number} (no such port)", number=number)
        port_type = _port_type(ports[number - 1])
        return UserMessage("port {number} ({type})", number=number, type=port_type)

    def _output(self, output: SetOutput) -> str:
        text = self._setting(output.port, f"{output.value}")
        if output.type == PortType.DIGITAL_OUTPUT:
            return text
        if output.type != PortType.PWM_OUTPUT:
            text = UserMessage("{text} (output type {type})", text=text, type=output.type)
        return UserMessage("{text} with time base {base}", text=text, base=output.time_base)

    def _setting(self, port: int, value: str) -> UserMessage:
        return UserMessage("set {port} to {value}", port=self._port(port), value=value)

    def _operation(self, node_type: int, operation: Operation) -> str:
        what = self._expression(operation)
        result = operation.result
        match operation.result_type:
            case ResultType.CALCULATION | ResultType.ASSIGNMENT:
                what = UserMessage(
                    "{variable} = {value}", variable=self._variable(result), value=what
                )
            case ResultType.SET_PORT:
                what = self._setting(result, what)
            case ResultType.COMPARISON:
                if result:
                    what = UserMessage("{what} (result {result})", what=what, result=result)
            case _:
                what = UserMessage(
                    "{what} (result_type {type}, result {result})",
                    what=what,
                    type=operation.result_type,
                    result=result,
                )
        return UserMessage("if {what}", what=what) if node_type == NodeType.IF else what

    def _expression(self, operation: Operation) -> str:
        a = self._value(operation.value_a_type, operation.value_a)
        if operation.opt == 0 and operation.value_b_type == ValueType.NONE:
            return a
        symbol = _SYMBOLS.get(operation.opt)
        return UserMessage(
            "{a} {symbol} {b}",
            a=a,
            symbol=symbol or UserMessage("(opt {number})", number=operation.opt),
            b=self._value(operation.value_b_type, operation.value_b),
        )

    def _value(self, value_type: int, value: int) -> str:
        match value_type:
            case ValueType.NONE:
                return UserMessage.of("nothing", "no value", {})
            case ValueType.NUMBER:
                return str(value)
            case ValueType.VARIABLE:
                return self._variable(value)
            case ValueType.INPUT_PORT:
                return self._port(value)
        return UserMessage("{value} (value type {type})", value=value, type=value_type)

    def _variable(self, key: int) -> str:
        return self._names.get(key) or UserMessage("variable {number}", number=key)


def _port_type(port_type: int) -> str:
    return _PORT_TYPES.get(port_type) or UserMessage("port type {number}", number=port_type)


def _instant(timer: WaitTimer) -> str:
    if 0 <= timer.seconds <= _LAST_SECOND and 0 <= timer.microseconds < SECOND_US:
        date = _EPOCH + timedelta(seconds=timer.seconds, microseconds=timer.microseconds)
        return f"{date:%Y-%m-%d %H:%M:%S.%f} UTC"
    return UserMessage(
        "second {seconds} and microsecond {microseconds} since 1970",
        seconds=timer.seconds,
        microseconds=timer.microseconds,
    )
