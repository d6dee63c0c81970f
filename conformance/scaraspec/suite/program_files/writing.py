"""Writing: builds simple user programs (clause 6).

Nodes become a file in the layout, byte order and counting mode of a dialect. Values are limited to
those that have the same meaning in every reading. Only the cases about points build programs that
move the arm.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

from scaraspec.protocol.program_files import (
    LAYOUTS,
    Condition,
    Layout,
    Node,
    NodeType,
    Operation,
    Point,
    PortType,
    Program,
    ResultType,
    SetOutput,
    ValueType,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
    build,
)
from scaraspec.protocol.program_files.model import PORTS, SECOND_US
from scaraspec.protocol.readings import Dialect

INPUTS: Final = range(1, 7)
"""Digital inputs that programs read."""
ANALOG: Final = 8
"""The analog input that programs read."""
OUTPUTS: Final = range(10, 17)
"""Digital outputs that programs set; no port has two types in any port numbering (A-4.32-2)."""

LONGEST_WAIT_S: Final = 255  # the maximum of a wait node (L887)
_LOOP_BODY: Final = 4  # nodes, so that a robot that repeats `counts` times loops this often
_LOOP_WAIT_S: Final = 60

PORT_TYPES: Final = (
    *[PortType.DIGITAL_INPUT] * INPUTS.stop,
    *[PortType.ANALOG_INPUT] * (OUTPUTS.start - 1 - INPUTS.stop),
    *[PortType.DIGITAL_OUTPUT] * (OUTPUTS.stop - OUTPUTS.start + 1),
    *[PortType.UNUSED] * (PORTS - OUTPUTS.stop),
)
"""The port configuration; valid for ports numbered from 1 and from 0 (A-6.3-2)."""

EMPTY: Final = Program(ports=PORT_TYPES)
"""A program without nodes."""


# ---------------------------------------------------------------------- whole files


def layout_of(dialect: Dialect) -> Layout:
    """Return the most likely layout for the readings of a dialect (A-6.1-2)."""
    return next(
        layout
        for layout in LAYOUTS.values()
        if layout.reading == dialect["prog_layout"] and layout.byte_order == dialect["endian"]
    )


def program_file(
    dialect: Dialect,
    nodes: Iterable[Node],
    variables: Iterable[Variable] = (),
    *,
    layout: Layout | None = None,
    base: Program = EMPTY,
) -> bytes:
    """Return the file of a program.

    Args:
        dialect: The readings.
        nodes: The nodes.
        variables: The variables.
        layout: The layout; None for the most likely one of the dialect.
        base: The program with the configuration.
    """
    made = replace(base, variables=tuple(variables), nodes=tuple(nodes))
    return build(made, layout or layout_of(dialect))


def wait_program(
    dialect: Dialect, seconds: int, *, layout: Layout | None = None, base: Program = EMPTY
) -> bytes:
    """Return a program that waits for a time, in seconds, and ends."""
    return program_file(dialect, wait(seconds), layout=layout, base=base)


def outputs_program(
    dialect: Dialect, outputs: Iterable[tuple[int, bool]], *, layout: Layout | None = None
) -> bytes:
    """Return a program that sets digital outputs in this order, and ends."""
    nodes = [set_output(port, on=on) for port, on in outputs]
    return program_file(dialect, nodes, layout=layout)


# ---------------------------------------------------------------------- nodes

Values = tuple[float, float, float, float]
"""The values of a point: joint angles, or x, y, z and thetaX (A-6.5-2)."""


def wait(seconds: int) -> list[Node]:
    """Return the nodes that wait for a time, in seconds (L928)."""
    whole, rest = divmod(seconds, LONGEST_WAIT_S)
    durations = [LONGEST_WAIT_S] * whole + [rest] * (rest > 0 or not whole)
    return [Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(each)) for each in durations]


def set_output(port: int, *, on: bool) -> Node:
    """Return a node that sets a digital output (TTL, L936)."""
    data = SetOutput(PortType.DIGITAL_OUTPUT, port, int(on))
    return Node(b"", NodeType.SET_OUTPUT, data=data)


def wait_until(epoch_us: int) -> Node:
    """Return a node that waits until a time, in microseconds since 1970 (L938)."""
    return Node(b"", NodeType.WAIT_TIMER, data=WaitTimer(*divmod(epoch_us, SECOND_US)))


def straight(speed_percent: int, points: Sequence[Values]) -> list[Node]:
    """Return the nodes that move the arm in straight lines from point to point (L911)."""
    return _move(NodeType.STRAIGHT_MOVE, speed_percent, points)


def curve(speed_percent: int, points: Sequence[Values]) -> list[Node]:
    """Return the nodes that move the arm along a curve through points (L912)."""
    return _move(NodeType.CURVE_MOVE, speed_percent, points)


def _move(kind: NodeType, speed_percent: int, points: Sequence[Values]) -> list[Node]:
    followers = [Node(b"", NodeType.POINT, data=Point(values)) for values in points]
    return [Node(b"", kind, speed_percent, len(points)), *followers]


def wait_input(port: int, condition: Condition, value_hundredths: int) -> Node:
    """Return a node that waits until an input meets a condition (L930-934)."""
    data = WaitInput(port, value_hundredths, condition)
    return Node(b"", NodeType.WAIT_INPUT, data=data)


def loop(dialect: Dialect, body: Sequence[Node]) -> list[Node]:
    """Return a loop around `body`, which must contain no loop and no move.

    The dialect defines whether the count of nodes includes the end node.
    """
    counts = len(body) + (dialect["counts_mode"] == "with-end")
    return [Node(b"", NodeType.LOOP, counts=counts), *body, Node(b"", NodeType.END_LOOP)]


def endless_loop(dialect: Dialect) -> list[Node]:
    """Return a loop that lasts until it is stopped; at least 15 minutes if loops are counted."""
    return loop(dialect, wait(_LOOP_WAIT_S) * _LOOP_BODY)


def branch(
    comparison: Operation, then: Iterable[Node], otherwise: Iterable[Node] | None = None
) -> list[Node]:
    """Return the nodes of an IF; without an ELSE if `otherwise` is None (L917-919)."""
    middle = [] if otherwise is None else [Node(b"", NodeType.ELSE), *otherwise]
    return [
        Node(b"", NodeType.IF, data=comparison),
        *then,
        *middle,
        Node(b"", NodeType.ENDIF),
    ]


# ---------------------------------------------------------------------- operations

Operand = tuple[ValueType, int]


def number(value: int) -> Operand:
    """Return an operand that is a number (L971)."""
    return ValueType.NUMBER, value


def variable(key: int) -> Operand:
    """Return an operand that is a variable (L972)."""
    return ValueType.VARIABLE, key


def input_port(port: int) -> Operand:
    """Return an operand that is the state of an input (L973)."""
    return ValueType.INPUT_PORT, port


def compare(a: Operand, opt: int, b: Operand, *, result: int = 0) -> Operation:
    """Return a comparison; result 0 has the same meaning in all readings (A-6.6a-1)."""
    return Operation(ResultType.COMPARISON, result, *a, *b, opt)


def calculate(key: int, a: Operand, opt: int, b: Operand) -> Node:
    """Return a node that calculates `a` `opt` `b` and stores the result in a variable (L963)."""
    return _compute(Operation(ResultType.CALCULATION, key, *a, *b, opt))


def assign(key: int, a: Operand) -> Node:
    """Return a node that assigns an operand to a variable (L964).

    All readings permit an assignment of operand A (A-6.6a-2).
    """
    return _compute(Operation(ResultType.ASSIGNMENT, key, *a))


def set_port(port: int, a: Operand) -> Node:
    """Return a node that sets an output port to the value of an operand (L965)."""
    return _compute(Operation(ResultType.SET_PORT, port, *a))


def _compute(operation: Operation) -> Node:
    return Node(b"", NodeType.COMPUTE, data=operation)
