"""Programs: user programs (clause 6) as the suite writes them, as plain as they can be.

Nodes are put together and made a file in the layout, byte order and manner of counting that a
dialect names; values keep to what every reading takes alike. What a subject makes of a program is
not known here, and none of these moves the arm: points are the business of the cases about them.
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
"""The analog input that they read."""
OUTPUTS: Final = range(10, 17)
"""Digital outputs that they set; no port is of two kinds, however ports are numbered (A-4.32-2)."""

LONGEST_WAIT_S: Final = 255  # what a wait node holds (L887)
_LOOP_BODY: Final = 4  # nodes; a robot that loops as often as it counts goes round as often
_LOOP_WAIT_S: Final = 60

PORT_TYPES: Final = (
    *[PortType.DIGITAL_INPUT] * INPUTS.stop,
    *[PortType.ANALOG_INPUT] * (OUTPUTS.start - 1 - INPUTS.stop),
    *[PortType.DIGITAL_OUTPUT] * (OUTPUTS.stop - OUTPUTS.start + 1),
    *[PortType.UNUSED] * (PORTS - OUTPUTS.stop),
)
"""How they are configured; it suits ports counted from 1 and from 0 (A-6.3-2)."""

EMPTY: Final = Program(ports=PORT_TYPES)
"""A program without nodes."""


# ---------------------------------------------------------------------- whole files


def layout_of(dialect: Dialect) -> Layout:
    """The likeliest layout of the reading that a dialect names (A-6.1-2)."""
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
    """The file of a program.

    Args:
        dialect: Names the layout.
        nodes: Every node.
        variables: Every variable.
        layout: The very layout, where more is known than its reading.
        base: Has its configuration.
    """
    made = replace(base, variables=tuple(variables), nodes=tuple(nodes))
    return build(made, layout or layout_of(dialect))


def wait_program(
    dialect: Dialect, seconds: int, *, layout: Layout | None = None, base: Program = EMPTY
) -> bytes:
    """A program that waits for so many seconds and ends."""
    return program_file(dialect, wait(seconds), layout=layout, base=base)


def endless_program(
    dialect: Dialect, *, layout: Layout | None = None, base: Program = EMPTY
) -> bytes:
    """A program that loops until it is stopped; for a quarter of an hour where loops count."""
    body = wait(_LOOP_WAIT_S) * _LOOP_BODY
    return program_file(dialect, loop(dialect, body), layout=layout, base=base)


def outputs_program(
    dialect: Dialect, outputs: Iterable[tuple[int, bool]], *, layout: Layout | None = None
) -> bytes:
    """A program that sets digital outputs, port by port in this order, and ends."""
    nodes = [set_output(port, on=on) for port, on in outputs]
    return program_file(dialect, nodes, layout=layout)


# ---------------------------------------------------------------------- nodes

Values = tuple[float, float, float, float]
"""What a point holds: joint angles, or x, y, z and thetaX (A-6.5-2)."""


def wait(seconds: int) -> list[Node]:
    """Wait for so many seconds, with as many nodes as that takes (L928)."""
    whole, rest = divmod(seconds, LONGEST_WAIT_S)
    durations = [LONGEST_WAIT_S] * whole + [rest] * (rest > 0 or not whole)
    return [Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(each)) for each in durations]


def set_output(port: int, *, on: bool) -> Node:
    """Set a digital output (TTL, L936)."""
    data = SetOutput(PortType.DIGITAL_OUTPUT, port, int(on))
    return Node(b"", NodeType.SET_OUTPUT, data=data)


def wait_until(epoch_us: int) -> Node:
    """Wait until an instant, in microseconds since 1970 (L938)."""
    return Node(b"", NodeType.WAIT_TIMER, data=WaitTimer(*divmod(epoch_us, SECOND_US)))


def straight(speed_percent: int, points: Sequence[Values]) -> list[Node]:
    """Go straight from point to point (L911)."""
    return _move(NodeType.STRAIGHT_MOVE, speed_percent, points)


def curve(speed_percent: int, points: Sequence[Values]) -> list[Node]:
    """Go along a curve through points (L912)."""
    return _move(NodeType.CURVE_MOVE, speed_percent, points)


def _move(kind: NodeType, speed_percent: int, points: Sequence[Values]) -> list[Node]:
    followers = [Node(b"", NodeType.POINT, data=Point(values)) for values in points]
    return [Node(b"", kind, speed_percent, len(points)), *followers]


def wait_input(port: int, condition: Condition, value_hundredths: int) -> Node:
    """Wait until an input meets a condition (L930-934)."""
    data = WaitInput(port, value_hundredths, condition)
    return Node(b"", NodeType.WAIT_INPUT, data=data)


def loop(dialect: Dialect, body: Sequence[Node]) -> list[Node]:
    """Repeat nodes, none of which is itself a loop or a move; counted as the dialect says."""
    counts = len(body) + (dialect["counts_mode"] == "with-end")
    return [Node(b"", NodeType.LOOP, counts=counts), *body, Node(b"", NodeType.END_LOOP)]


def branch(
    comparison: Operation, then: Iterable[Node], otherwise: Iterable[Node] | None = None
) -> list[Node]:
    """An IF; None for one without an ELSE (L917-919)."""
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
    """An operand that stands for itself (L971)."""
    return ValueType.NUMBER, value


def variable(key: int) -> Operand:
    """An operand that stands for a variable (L972)."""
    return ValueType.VARIABLE, key


def input_port(port: int) -> Operand:
    """An operand that stands for the state of an input (L973)."""
    return ValueType.INPUT_PORT, port


def compare(a: Operand, opt: int, b: Operand, *, result: int = 0) -> Operation:
    """A comparison; 0 is the result on which all readings agree (A-6.6a-1)."""
    return Operation(ResultType.COMPARISON, result, *a, *b, opt)


def calculate(key: int, a: Operand, opt: int, b: Operand) -> Node:
    """Calculate into a variable (L963)."""
    return _compute(Operation(ResultType.CALCULATION, key, *a, *b, opt))


def assign(key: int, a: Operand) -> Node:
    """Assign to a variable: A alone, on which all readings agree (L964; A-6.6a-2)."""
    return _compute(Operation(ResultType.ASSIGNMENT, key, *a))


def set_port(port: int, a: Operand) -> Node:
    """Set an output port by an operation (L965)."""
    return _compute(Operation(ResultType.SET_PORT, port, *a))


def _compute(operation: Operation) -> Node:
    return Node(b"", NodeType.COMPUTE, data=operation)
