"""Program model: statements that are converted to nodes, and whose result is calculated.

The model follows only the document. It uses blocks instead of markers, and shares no code with an
interpreter. Its values have the same meaning in all readings: no overflow, no division with a
negative remainder, port values 0 and 1, comparisons with result 0 in the file.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from scaraspec.protocol.program_files import Condition, Node, Opt, ValueType, Variable
from scaraspec.suite.controller.harness.requests.ports import ALL_OUTPUTS, Bits, with_port
from scaraspec.suite.program_files import writing as programs
from scaraspec.suite.program_files.writing import Operand, number, variable


class Flip(NamedTuple):
    """Set an output to the inverse of its state before the program, with an output node (4)."""

    port: int


class Put(NamedTuple):
    """Set an output to an operand that is 0 or 1, with an operation (L965)."""

    port: int
    value: Operand


class Assign(NamedTuple):
    """Assign an operand to a variable (L964)."""

    key: int
    value: Operand


class Calculate(NamedTuple):
    """Calculate a value and store it in a variable (L963)."""

    key: int
    a: Operand
    opt: Opt
    b: Operand


class Wait(NamedTuple):
    """Wait for whole seconds (L928)."""

    seconds: int


class Until(NamedTuple):
    """Wait until an instant, in microseconds since 1970 (L938); `State` does not know the time."""

    at_us: int


class Pass(NamedTuple):
    """Wait for a condition that an input meets already (L930-934): it has no effect."""

    port: int
    condition: Condition
    value: int


class Go(NamedTuple):
    """Move the arm in straight lines or along a curve (L911-912); `State` does not follow it."""

    speed_percent: int
    points: Sequence[programs.Values]
    curved: bool = False


class If(NamedTuple):
    """Execute one of two blocks (L917-919); None for no ELSE."""

    a: Operand
    opt: Opt
    b: Operand
    then: "Block"
    otherwise: "Block | None" = None


Statement = Flip | Put | Assign | Calculate | Wait | Until | Pass | Go | If
Block = Sequence[Statement]


@dataclass
class State:
    """The state of a program.

    Attributes:
        initial: The outputs before the program.
        inputs: The digital inputs, which do not change.
        variables: The values of the variables, by key.
        outputs: The current outputs.
        written: The outputs that were set.
        waited_s: The sum of the waits, in seconds.
    """

    initial: Bits
    inputs: Bits
    variables: dict[int, int]
    outputs: Bits = field(init=False)
    written: set[int] = field(init=False, default_factory=set)
    waited_s: int = 0

    def __post_init__(self) -> None:
        self.outputs = self.initial

    def value(self, operand: Operand) -> int:
        """Return the value of an operand (L967-973)."""
        kind, number = operand
        if kind is ValueType.VARIABLE:
            return self.variables[number]
        return int(self.inputs[number - 1]) if kind is ValueType.INPUT_PORT else number

    def execute(self, block: Block) -> None:
        """Execute the statements.

        Raises:
            UndefinedResultError: The document does not define their result.
        """
        for statement in block:
            match statement:
                case Flip(port):
                    self._put(port, on=not self.initial[port - 1])
                case Put(port, value):
                    if (put := self.value(value)) not in (0, 1):
                        raise UndefinedResultError(f"{put} is not a port value")
                    self._put(port, on=bool(put))
                case Assign(key, value):
                    self.variables[key] = self.value(value)
                case Calculate(key, a, opt, b):
                    self.variables[key] = calculated(opt, self.value(a), self.value(b))
                case Wait(seconds):
                    self.waited_s += seconds
                case If(a, opt, b, then, otherwise):
                    holds = compared(opt, self.value(a), self.value(b))
                    self.execute(then if holds else otherwise or ())

    def _put(self, port: int, *, on: bool) -> None:
        self.written.add(port)
        self.outputs = with_port(self.outputs, port, on=on)


class UndefinedResultError(ValueError):
    """The document does not define the result of a program (A-6.6a-4, L965)."""


def calculated(opt: Opt, a: int, b: int) -> int:
    """Return the result of a calculation (L978-981).

    Raises:
        UndefinedResultError: The result overflows, the divisor is 0, or the remainder is negative.
    """
    if opt is Opt.DIVIDE and (b == 0 or (a % b and (a < 0 or b < 0))):
        raise UndefinedResultError(f"{a} / {b}")
    result = {
        Opt.ADD: lambda: a + b,
        Opt.SUBTRACT: lambda: a - b,
        Opt.MULTIPLY: lambda: a * b,
        Opt.DIVIDE: lambda: a // b,
    }[opt]()
    if not -(2**31) <= result < 2**31:
        raise UndefinedResultError(f"{result} is not an int32")
    return result


def compared(opt: Opt, a: int, b: int) -> bool:
    """Whether a comparison holds (L982-986)."""
    return {
        Opt.GREATER: a > b,
        Opt.LESS: a < b,
        Opt.EQUAL: a == b,
        Opt.GREATER_OR_EQUAL: a >= b,
        Opt.LESS_OR_EQUAL: a <= b,
    }[opt]


def new_state(variables: Mapping[int, int], inputs: Bits = ()) -> State:
    """Return the state before a program, with all outputs off."""
    return State((False,) * len(ALL_OUTPUTS), inputs, dict(variables))


def is_defined(block: Block, variables: Mapping[int, int], inputs: Bits = ()) -> bool:
    """Whether the document defines the result of a program."""
    try:
        new_state(variables, inputs).execute(block)
    except UndefinedResultError:
        return False
    return True


def value_checks(values: Mapping[int, int], failed: int) -> list[Statement]:
    """Return statements that flip an output for each variable with another value."""
    return [
        If(variable(key), Opt.EQUAL, number(value), [], [Flip(failed)])
        for key, value in values.items()
    ]


def nodes_of(block: Block, initial: Bits) -> list[Node]:
    """Return the nodes of these statements, for these outputs before the program."""
    return [node for statement in block for node in _nodes(statement, initial)]


def _nodes(statement: Statement, initial: Bits) -> Iterable[Node]:
    match statement:
        case Wait(seconds):
            return programs.wait(seconds)
        case Go(speed_percent, points, curved):
            return (programs.curve if curved else programs.straight)(speed_percent, points)
        case If(a, opt, b, then, otherwise):
            return programs.branch(
                programs.compare(a, opt, b),
                nodes_of(then, initial),
                None if otherwise is None else nodes_of(otherwise, initial),
            )
    return [_node(statement, initial)]


def _node(statement: Flip | Put | Assign | Calculate | Until | Pass, initial: Bits) -> Node:
    match statement:
        case Flip(port):
            return programs.set_output(port, on=not initial[port - 1])
        case Put(port, value):
            return programs.set_port(port, value)
        case Assign(key, value):
            return programs.assign(key, value)
        case Calculate(key, a, opt, b):
            return programs.calculate(key, a, opt, b)
        case Until(at_us):
            return programs.wait_until(at_us)
        case Pass(port, condition, hundredths):
            return programs.wait_input(port, condition, hundredths)


def variables_of(values: Mapping[int, int]) -> list[Variable]:
    """Return the variable records of a program."""
    return [Variable(key, f"v{key}".encode(), value) for key, value in values.items()]


COMPARISONS: Final = (
    Opt.GREATER,
    Opt.LESS,
    Opt.EQUAL,
    Opt.GREATER_OR_EQUAL,
    Opt.LESS_OR_EQUAL,
)
CALCULATIONS: Final = (Opt.ADD, Opt.SUBTRACT, Opt.MULTIPLY, Opt.DIVIDE)
