"""Program strategies: random programs that mean the same in all readings.

They have variables, calculations, comparisons, nested branches, outputs, inputs, waits and loops,
but no moves. A sum collects the results, so that no later statement hides a wrong one. What every
run must try is dealt like cards: each operator, each kind of operands, each limit value.
"""

import copy
import itertools
from collections.abc import Sequence
from random import Random
from typing import Any, Final, NamedTuple, TypeVar

from scaraspec.protocol.program_files import Condition, Opt
from scaraspec.suite.controller.harness.requests.ports import Bits
from scaraspec.suite.program_files.model import (
    CALCULATIONS,
    COMPARISONS,
    Assign,
    Block,
    Calculate,
    Flip,
    If,
    Pass,
    Put,
    Statement,
    UndefinedResultError,
    Wait,
    compared,
    is_defined,
    new_state,
)
from scaraspec.suite.program_files.writing import (
    INPUTS,
    OUTPUTS,
    Operand,
    input_port,
    number,
    variable,
)

T = TypeVar("T")

KEYS: Final = (1, 3, -2, 70000)
"""The keys of the variables that random programs change."""

SUM: Final = 5
"""The key of the variable that collects results."""

LOOPS: Final = 3
"""How often the body of a loop is executed."""

DONE, FAILED = OUTPUTS[0], OUTPUTS[-1]
"""Outputs that random programs do not set."""

LIMITS: Final = (
    *(0, 1, -1, 127, 128, 255, 256, -256, 32767, -32768, 65535, 65536, 70000, -65537),
    *(2**24 + 1, 2**31 - 1, -(2**31)),
)
"""Numbers at which types with fewer bits, without a sign, or of floats differ from an int32."""

MET: Final = {
    False: ((Condition.LESS, 1), (Condition.EQUAL, 0), (Condition.NOT_GREATER, 1)),
    True: ((Condition.GREATER, 0), (Condition.NOT_LESS, 1)),
}
"""Conditions and values that an input meets that is off or on, in every reading (A-6.5-10).

Most other conditions with the same value are not met.
"""

_SMALL: Final = 100
_WIDE: Final = 46340  # the product of two such numbers fits an int32, and not a float
_NEAR: Final = (0, 1, -1, 256, 65536)
"""Differences of two compared numbers."""
_SAME: Final = "same"  # the comparison of a variable with itself
_KINDS: Final = (
    *("calculate", "calculate", "calculate", "calculate", "branch", "branch", "branch", "branch"),
    *("branch", "assign", "assign", "assign", "flip", "put", "put", "pass", "wait"),
)
"""The statements of a program."""
_IN_LOOP: Final = ("calculate", "calculate", "branch", "branch", "assign", "put", "flip")
_BEFORE_LOOP: Final = ("calculate", "calculate", "assign", "put", "pass", "wait")
_BRANCHES: Final = 12  # in a program at most, because a long one may be refused (A-5-21)
_IN_BRANCH: Final = 2  # statements at most, besides the one that marks the branch
_DEPTH: Final = 5
_NESTED: Final = 0.2  # the share of the blocks of a branch that contain another branch
_WITH_ELSE: Final = 0.7  # the share of branches
_TRIES: Final = 20
_LONG_WAIT_EVERY: Final = 6  # programs, of which one waits for a second


class DrawnProgram(NamedTuple):
    """A random program.

    Attributes:
        variables: The initial values by key.
        block: Its statements.
        body: The statements of a loop after them.
    """

    variables: dict[int, int]
    block: Block
    body: Block


class ProgramDealer:
    """Draws programs that together contain everything that a run must try.

    Args:
        inputs: The states of the inputs.
        ports: The inputs that do not change.
    """

    def __init__(self, inputs: Bits, ports: Sequence[int] = INPUTS) -> None:
        self.inputs, self.ports = inputs, ports
        self._decks: dict[object, list[Any]] = {}
        self._drawn: dict[int, DrawnProgram] = {}

    def program(self, seed: int, kinds: Sequence[str] = _KINDS) -> DrawnProgram:
        """Return the program of a seed; always the same one."""
        if seed not in self._drawn:
            is_long = (len(self._drawn) + 1) % _LONG_WAIT_EVERY == 0
            writer = self._writer(seed, wait_s=int(is_long))
            self._drawn[seed] = DrawnProgram(writer.variables, writer.block(kinds), ())
        return self._drawn[seed]

    def loop(self, seed: int) -> DrawnProgram:
        """Return the program of a seed whose last part is executed `LOOPS` times."""
        tried = itertools.count(seed)
        while seed not in self._drawn:
            writer = self._writer(next(tried), wait_s=0)
            before = writer.block(_BEFORE_LOOP)
            drawn = DrawnProgram(writer.variables, before, writer.block(_IN_LOOP, depth=2))
            whole = [*drawn.block, *[*drawn.body] * LOOPS]
            if is_defined(whole, drawn.variables, self.inputs):
                self._drawn[seed] = drawn
        return self._drawn[seed]

    def deal(self, random: Random, items: tuple[T, ...]) -> T:
        """Return each of these items before any again."""
        deck = self._decks.setdefault(items, [])
        if not deck:
            deck += random.sample(items, len(items))
        dealt: T = deck.pop()
        return dealt

    def _writer(self, seed: int, *, wait_s: int) -> "_Writer":
        return _Writer(Random(seed), self, wait_s)  # noqa: S311 - it must be reproducible


class _Writer:
    """Writes random statements, and executes them to know the values that they meet."""

    def __init__(self, random: Random, dealer: ProgramDealer, wait_s: int) -> None:
        self._random, self._dealer, self._wait_s = random, dealer, wait_s
        self._branches = _BRANCHES
        self._off_inputs = [port for port in dealer.ports if not dealer.inputs[port - 1]]
        self._kinds = ("number", "variable", *["input"] * bool(self._off_inputs))
        pairs = [*itertools.product(self._kinds, repeat=2)]
        self._calculations = tuple(
            (opt, a, b)
            for opt, (a, b) in itertools.product(CALCULATIONS, pairs)
            if not (opt is Opt.DIVIDE and b == "input")
        )
        others: list[str | int] = [*self._kinds[1:], _SAME, *_NEAR]
        self._comparisons = tuple(itertools.product(COMPARISONS, others))
        self.variables = {key: self._number() for key in (*KEYS, SUM)}
        self._state = new_state(self.variables, dealer.inputs)

    def _deal(self, items: tuple[T, ...]) -> T:
        return self._dealer.deal(self._random, items)

    def block(self, kinds: Sequence[str], depth: int = _DEPTH) -> list[Statement]:
        """Return a block of these statements in any order, and execute it."""
        shuffled = self._random.sample(kinds, len(kinds))
        return [each for kind in shuffled for each in self._statements(kind, depth)]

    def _statements(self, kind: str, depth: int) -> list[Statement]:
        """Return a statement, with another one that adds its result to the sum."""
        random, tries = self._random, list[Statement]()
        match kind:
            case "calculate":
                return self._calculation()
            case "assign":
                key, kind = random.choice(KEYS), self._deal(self._kinds)
                value = self._operand(kind) if kind != "number" else number(self._deal(LIMITS))
                return self._first_defined([Assign(key, value)]) + self._collect(key)
            case "branch":
                if not (depth and self._branches):
                    return []
                self._branches -= 1
                return [self._branch(depth - 1)]
            case "flip":
                tries = [Flip(random.choice(OUTPUTS[1:-1]))]
            case "put":
                port, values = random.choice(OUTPUTS[1:-1]), [*map(variable, KEYS)]
                tries = [
                    Put(port, each) for each in self._shuffled([*values, *map(number, (0, 1))])
                ]
            case "pass" if self._dealer.ports:
                port = random.choice(self._dealer.ports)
                tries = [Pass(port, *self._deal(MET[self._dealer.inputs[port - 1]]))]
            case "wait":
                tries = [Wait(self._wait_s)]
        return self._first_defined(tries)

    def _shuffled(self, items: Sequence[T]) -> list[T]:
        return self._random.sample(items, len(items))

    def _first_defined(self, statements: Sequence[Statement]) -> list[Statement]:
        """Execute the first of these statements whose result the document defines."""
        for statement in statements:
            try:
                self._state.execute([statement])
            except UndefinedResultError:
                continue
            return [statement]
        return []

    def _calculation(self) -> list[Statement]:
        key, (opt, kind_a, kind_b) = self._random.choice(KEYS), self._deal(self._calculations)
        tries: list[Statement] = []
        for _ in range(_TRIES):
            b = self._operand(kind_b)
            if opt is Opt.DIVIDE and self._random.randrange(2):
                b = number(self._random.randint(2, 9))
            tries.append(Calculate(key, self._operand(kind_a), opt, b))
        return self._first_defined(tries) + self._collect(key)

    def _collect(self, key: int) -> list[Statement]:
        """Add a variable to the sum, or subtract it if the sum would overflow."""
        both = self._shuffled((Opt.ADD, Opt.SUBTRACT))
        return self._first_defined([Calculate(SUM, variable(SUM), o, variable(key)) for o in both])

    def _branch(self, depth: int) -> If:
        opt, other = self._deal(self._comparisons)
        a = self._operand("variable" if other == _SAME else self._deal(self._kinds))
        if isinstance(other, int):
            b = self._near(a, other)
        else:
            b = a if other == _SAME else self._operand(other)
        holds = compared(opt, self._state.value(a), self._state.value(b))
        then = self._branch_block(depth, executed=holds)
        has_else = self._random.random() < _WITH_ELSE
        return If(
            a, opt, b, then, self._branch_block(depth, executed=not holds) if has_else else None
        )

    def _branch_block(self, depth: int, *, executed: bool) -> Block:
        state = self._state
        if not executed:
            self._state = copy.deepcopy(state)
        added = Calculate(SUM, variable(SUM), Opt.ADD, number(self._random.randint(1, _SMALL)))
        kinds = self._random.sample(_KINDS[:-1], self._random.randint(0, _IN_BRANCH))
        kinds += ["branch"] * (self._random.random() < _NESTED)
        block = self._first_defined([added]) + self.block(kinds, depth)
        self._state = state
        return block

    def _operand(self, kind: str) -> Operand:
        match kind:
            case "variable":
                return variable(self._random.choice(KEYS))
            case "input":  # one that is on may count as 1 or as 100 (A-6.6a-5)
                return input_port(self._random.choice(self._off_inputs))
        return number(self._number())

    def _near(self, operand: Operand, by: int) -> Operand:
        """Return a number that differs from the operand by this."""
        value = self._state.value(operand) + by
        return number(min(max(value, -(2**31)), 2**31 - 1))

    def _number(self) -> int:
        high = self._random.choice((3, _SMALL, _WIDE, 0, 0))
        return self._random.randint(-high, high) if high else self._deal(LIMITS)
