"""Clause 6.6: what operations calculate, compare, store and set (L944-986).

Each program shows its results by its outputs; the suite's own model determines the expected ones.
"""

from collections.abc import Iterator
from typing import Final

from scaraspec.protocol.program_files import Node, Opt
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import (
    Bits,
    digits,
    driven_inputs,
    inputs,
    inputs_unchanged,
    outputs,
    set_output,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect
from scaraspec.suite.program_files import writing as programs
from scaraspec.suite.program_files.bench import PROGRAMS, Bench, bench
from scaraspec.suite.program_files.model import (
    COMPARISONS,
    Assign,
    Calculate,
    Flip,
    If,
    Put,
    Statement,
    calculated,
    compared,
    nodes_of,
)
from scaraspec.suite.program_files.writing import INPUTS, OUTPUTS, input_port, number, variable
from scaraspec.user_message import UserMessage

_PASSED, _FAILED = OUTPUTS[0], OUTPUTS[-1]
_X, _Y, _Z, _W = 7, 1000, -2, 0x10007
"""Keys of variables; none equals its position, and two have the same lowest two bytes."""

_OPERATIONS: Final = (
    (Opt.ADD, 19, 23),
    (Opt.SUBTRACT, 19, 23),
    (Opt.MULTIPLY, -4097, 4099),  # does not fit a float
    (Opt.DIVIDE, 19, 4),
    (Opt.DIVIDE, -210_000, 70_000),  # no later calculation hides a lost sign
    (Opt.SUBTRACT, -5, -3),
    (Opt.DIVIDE, 16_777_217, 1),  # does not fit a float
)

_CHAIN: Final = (
    (7, Opt.ADD, 3),
    (10, Opt.SUBTRACT, 14),
    (-4, Opt.MULTIPLY, -6),
    (24, Opt.DIVIDE, 5),  # 4: integer division
    (4, Opt.SUBTRACT, -30),
    (34, Opt.MULTIPLY, 1000),
    (34000, Opt.ADD, 40000),
    (74000, Opt.DIVIDE, 20000),  # 3: rounded down
    (3, Opt.MULTIPLY, -70000),
    (-210000, Opt.DIVIDE, 70000),
    (-3, Opt.ADD, 3),
    (0, Opt.SUBTRACT, -1_000_000_001),  # more digits than a float of four bytes
)
"""Calculations that each use the previous result."""

_DOUBLED: Final = -17
"""A value that is added to itself; the sum is multiplied by itself."""

_PAIRS: Final = (
    *((1, 2), (2, 2), (3, 2), (-1, 1), (-2, -3), (70000, 4464), (0, 0), (-3, -3)),
    (2_000_000_000, -2_000_000_000),  # the difference does not fit an int
    (16_777_217, 16_777_216),  # equal as floats
)
"""Operands to compare: less, equal and greater, negative, over 16 bits, and beyond a float."""


@case("6.6a/11", hazards=PROGRAMS)
def test_calculations(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chain of sums, differences, products and quotients of integers has the right results."""
    block: list[Statement] = [Calculate(_X, variable(_X), opt, number(b)) for _, opt, b in _CHAIN]
    a, opt, b = _CHAIN[-1]
    expected = number(calculated(opt, a, b))
    block.append(If(variable(_X), Opt.EQUAL, expected, [Flip(_PASSED)], [Flip(_FAILED)]))
    block.append(Assign(_X, number(_DOUBLED)))
    block += [Calculate(_X, variable(_X), opt, variable(_X)) for opt in (Opt.ADD, Opt.MULTIPLY)]
    expected = number((2 * _DOUBLED) ** 2)
    block.append(If(variable(_X), Opt.EQUAL, expected, [], [Flip(_FAILED)]))
    with bench(subject, line) as robot:
        robot.performs(block, {_X: _CHAIN[0][0]})


@case("6.6a/11", name="each", hazards=PROGRAMS)
def test_each_calculation(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each of the four calculations is correct; each result is shown by a separate output."""
    block: list[Statement] = []
    for port, (opt, a, b) in zip(OUTPUTS, _OPERATIONS, strict=False):
        block.append(Calculate(_Y, number(a), opt, number(b)))
        expected = number(calculated(opt, a, b))
        block.append(If(variable(_Y), Opt.EQUAL, expected, [Flip(port)]))
    with bench(subject, line) as robot:
        robot.performs(block, {_Y: 1})


@case("6.6a/12", hazards=PROGRAMS)
def test_comparisons(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each of the five comparisons is true exactly for the right operands."""
    with bench(subject, line) as robot:
        robot.performs([*_comparisons(), Flip(_PASSED)])


def _comparisons() -> Iterator[Statement]:
    """Yield statements that flip an output if a comparison is wrong."""
    for a, b in _PAIRS:
        for opt in COMPARISONS:
            if compared(opt, a, b):
                yield If(number(a), opt, number(b), [], [Flip(_FAILED)])
            else:
                yield If(number(a), opt, number(b), [Flip(_FAILED)])


@case("6.6a/13", hazards=PROGRAMS)
def test_results(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A result is stored in the variable with its key, or set at its port, and nowhere else."""
    block: list[Statement] = [
        Put(OUTPUTS[4], number(0)),
        Put(OUTPUTS[4], variable(_X)),
        Assign(_X, number(-70_021)),
        Calculate(_Y, variable(_Y), Opt.ADD, number(2)),
        Put(OUTPUTS[1], number(0)),
        Put(OUTPUTS[2], number(1)),
        Put(OUTPUTS[3], number(1)),
        Put(OUTPUTS[3], number(0)),
        Assign(_Z, variable(_X)),
        Calculate(_W, number(5), Opt.ADD, number(6)),
    ]
    for key, expected in {_X: -70_021, _Y: 102, _Z: -70_021, _W: 11}.items():
        block.append(If(variable(key), Opt.EQUAL, number(expected), [], [Flip(_FAILED)]))
    with bench(subject, line) as robot:
        robot.performs([*block, Flip(_PASSED)], {_X: 1, _Y: 100, _Z: 300, _W: 400})


@case("6.6a/13", name="ports", hazards=PROGRAMS)
def test_port_settings(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An operation sets every output to 1 and to 0, regardless of its value before.

    The second program has the same bytes as the first, in another order.
    """
    with bench(subject, line) as robot:
        for values in examples(((0, 1), (1, 0))):
            robot.performs([Put(port, number(value)) for value in values for port in OUTPUTS])


@case("6.6a/14", hazards=PROGRAMS)
def test_operands(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A number operand is a number, and a key operand is the variable with this key."""
    block: list[Statement] = [
        Calculate(_Z, number(_X), Opt.SUBTRACT, variable(_X)),  # 7 - 50
        If(variable(_Z), Opt.EQUAL, number(_X - 50), [], [Flip(_FAILED)]),
        Calculate(_Z, variable(_Y), Opt.SUBTRACT, number(_Y)),  # 60 - 1000
        If(variable(_Z), Opt.EQUAL, number(60 - _Y), [], [Flip(_FAILED)]),
        Calculate(_Z, variable(_Y), Opt.SUBTRACT, variable(_Z)),  # overwrites its own operand
        If(variable(_Z), Opt.EQUAL, number(_Y), [], [Flip(_FAILED)]),
        Calculate(_Z, variable(_Y), Opt.ADD, variable(_Y)),  # the same variable twice
        If(variable(_Z), Opt.EQUAL, number(120), [], [Flip(_FAILED)]),
        If(variable(_X), Opt.LESS, variable(_Y), [], [Flip(_FAILED)]),
        If(number(_X), Opt.LESS, number(_Y), [], [Flip(_FAILED)]),
        If(variable(_X), Opt.EQUAL, number(_X), [Flip(_FAILED)]),
        If(number(60), Opt.EQUAL, variable(_Y), [], [Flip(_FAILED)]),
        Flip(_PASSED),
    ]
    with bench(subject, line) as robot:
        robot.performs(block, {_X: 50, _Y: 60, _Z: 0})


@case("6.6a/14", name="inputs", hazards=PROGRAMS)
def test_input_operands(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An input operand has the state that 0x42 reports, as 0 or as a greater value."""
    with bench(subject, line) as robot:
        _check_input_operands(robot, line)


@case("6.6a/14", name="driven-inputs", needs=("set_input",), hazards=PROGRAMS, attended=True)
def test_driven_input_operands(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Inputs that the hook `set_input` sets work as operands."""
    with bench(subject, line) as robot, driven_inputs(subject, line) as drive:
        for pattern in examples((0b101001, 0b010110)):
            drive.set_ports({p: bool(pattern >> index & 1) for index, p in enumerate(INPUTS)})
            _check_input_operands(robot, line)


def _check_input_operands(robot: Bench, line: OutgoingConnection) -> None:
    """Compare the operands with 0x42, while the outputs of the same ports have other states."""
    block: list[Statement] = []
    for port, output in zip(INPUTS, OUTPUTS, strict=False):
        block.append(If(input_port(port), Opt.GREATER, number(0), [Flip(output)]))
        block.append(Assign(_X, input_port(port)))
        block.append(If(variable(_X), Opt.EQUAL, input_port(port), [], [Flip(output)]))
    for port, on in zip(INPUTS, inputs(line), strict=False):
        set_output(line, port, on=not on)  # it may be wired to an input
    with inputs_unchanged(line) as states:
        robot.performs([*block, Flip(_FAILED)], {_X: -1}, inputs=states)


@case("6.6a/2", hazards=PROGRAMS)
def test_result_of_a_comparison(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A result of 0 in the file means true; others have no effect, or invert (A-6.6a-1)."""
    as_compared, inverted = (True, False), (False, True)
    with bench(subject, line) as robot:
        robot.run(_two_branches(robot.before, 0))
        expect(
            _branches_taken(robot.before, outputs(line)) == as_compared,
            "with a result of 0, an IF does not follow its comparison",
            expected="only the branch of the true comparison",
            observed=digits(outputs(line)),
        )
        outcomes = set()
        for result in examples((1, -1, 256)):
            before = outputs(line)
            if not robot.accepts(robot.file(_two_branches(before, result))):
                subject.tolerate(
                    "6.6a/2",
                    "A-6.6a-1",
                    "refused",
                    UserMessage("a comparison with result {result} is refused", result=result),
                )
                return
            robot.finish()
            outcomes.add(_branches_taken(before, outputs(line)))
    expect(
        outcomes in ({as_compared}, {inverted}),
        "results other than 0 have no consistent meaning",
        expected="all without effect, or all inverting",
        observed=UserMessage(
            "branches executed, of the true and the false comparison: {values}",
            values=sorted(outcomes),
        ),
    )
    if outcomes == {as_compared}:
        subject.set_reading("cmp_result", "output")
        return
    subject.set_reading("cmp_result", "polarity")
    message = "a result other than 0 in the file inverts a comparison"
    subject.tolerate("6.6a/2", "cmp_result", "polarity", message)


def _two_branches(before: Bits, result: int) -> list[Node]:
    """Return a branch of a true comparison and one of a false one; each flips an output."""
    nodes: list[Node] = []
    for port, (a, b) in zip(OUTPUTS, ((2, 1), (1, 2)), strict=False):
        comparison = programs.compare(number(a), Opt.GREATER, number(b), result=result)
        nodes += programs.branch(comparison, nodes_of([Flip(port)], before))
    return nodes


def _branches_taken(before: Bits, after: Bits) -> tuple[bool, bool]:
    """Return which of the two branches was executed."""
    first, second = (before[port - 1] != after[port - 1] for port in OUTPUTS[:2])
    return first, second
