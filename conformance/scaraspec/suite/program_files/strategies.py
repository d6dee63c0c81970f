"""Program strategies: random programs that mean the same in all readings.

They have variables, calculations, comparisons, nested branches, outputs, short waits and loops, but
no moves. A sum collects the results, so that no later statement hides a wrong one.
"""

import copy
from random import Random
from typing import Final, NamedTuple

from hypothesis import strategies as st

from scaraspec.protocol.program_files import Opt
from scaraspec.suite.program_files.model import (
    CALCULATIONS,
    COMPARISONS,
    Assign,
    Block,
    Calculate,
    Flip,
    If,
    Put,
    Statement,
    UndefinedResultError,
    Wait,
    compared,
    is_defined,
    new_state,
)
from scaraspec.suite.program_files.writing import OUTPUTS, Operand, number, variable

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

_SMALL: Final = 100
_NEAR: Final = (0, 0, 1, -1, 256, 65536)
"""Differences of two compared numbers."""
_STATEMENTS, _BEFORE_LOOP, _IN_LOOP, _IN_BRANCH = 16, 5, 7, 2  # numbers of statements
_DEPTH: Final = 3
_WITH_ELSE: Final = 0.7  # the share of branches
_TRIES: Final = 20
_LONG_WAITS: Final = 0.06  # the share of waits that last a second; the others last none


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


class _Writer:
    """Writes random statements, and executes them to know the values that they meet."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self.variables = {key: self._number() for key in (*KEYS, SUM)}
        self._state = new_state(self.variables)

    def block(self, size: int, depth: int = _DEPTH) -> list[Statement]:
        """Return a block of about this many statements, and execute it."""
        return [each for _ in range(size) for each in self._statements(depth)]

    def _statements(self, depth: int) -> list[Statement]:
        """Return a statement, with another one that adds its result to the sum."""
        pick = self._random.choice
        match self._random.randrange(9 if depth else 6):
            case 0:
                port = pick(OUTPUTS[1:-1])
                return self._first_defined([Flip(port), Put(port, number(pick((0, 1))))])
            case 1:
                ports = [Put(pick(OUTPUTS[1:-1]), variable(key)) for key in KEYS]
                return self._first_defined([*ports, Wait(int(self._random.random() < _LONG_WAITS))])
            case 2:
                key = pick(KEYS)
                return self._first_defined([Assign(key, self._operand())]) + self._collect(key)
            case 3 | 4 | 5:
                return self._calculation()
        return [self._branch(depth - 1)]

    def _first_defined(self, statements: list[Statement]) -> list[Statement]:
        """Execute the first of these statements whose result the document defines."""
        self._random.shuffle(statements)
        for statement in statements:
            try:
                self._state.execute([statement])
            except UndefinedResultError:
                continue
            return [statement]
        return []

    def _calculation(self) -> list[Statement]:
        key, opt = self._random.choice(KEYS), self._random.choice(CALCULATIONS)
        tries: list[Statement] = []
        for _ in range(_TRIES):
            b = self._operand()
            if opt is Opt.DIVIDE and self._random.randrange(2):
                b = number(self._random.randint(2, 9))
            tries.append(Calculate(key, self._operand(), opt, b))
        return self._first_defined(tries) + self._collect(key)

    def _collect(self, key: int) -> list[Statement]:
        """Add a variable to the sum, or subtract it if the sum would overflow."""
        both = (Opt.ADD, Opt.SUBTRACT)
        return self._first_defined([Calculate(SUM, variable(SUM), o, variable(key)) for o in both])

    def _branch(self, depth: int) -> If:
        opt, a = self._random.choice(COMPARISONS), self._operand()
        b = self._random.choice((self._operand(), self._near(a), self._near(a), a))
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
        block = self._first_defined([added]) + self.block(
            self._random.randint(0, _IN_BRANCH), depth
        )
        self._state = state
        return block

    def _operand(self) -> Operand:
        choices = (variable(self._random.choice(KEYS)), number(self._number()))
        return self._random.choice(choices)

    def _near(self, operand: Operand) -> Operand:
        """Return a number that equals the operand or is similar."""
        value = self._state.value(operand) + self._random.choice(_NEAR)
        return number(min(max(value, -(2**31)), 2**31 - 1))

    def _number(self) -> int:
        near, far = self._random.randint(-3, 3), self._random.randint(-_SMALL, _SMALL)
        return self._random.choice((near, far, self._random.choice(LIMITS)))


def _drawn(seed: int) -> DrawnProgram:
    writer = _Writer(Random(seed))  # noqa: S311 - it must be reproducible
    return DrawnProgram(writer.variables, writer.block(_STATEMENTS), ())


def _drawn_with_loop(seed: int) -> DrawnProgram:
    writer = _Writer(Random(seed))  # noqa: S311 - it must be reproducible
    return DrawnProgram(
        writer.variables, writer.block(_BEFORE_LOOP), writer.block(_IN_LOOP, depth=2)
    )


def _is_defined(program: DrawnProgram) -> bool:
    return is_defined([*program.block, *[*program.body] * LOOPS], program.variables)


_seeds = st.integers(0, 2**64)  # hypothesis itself would draw mostly small and equal values

programs: st.SearchStrategy[DrawnProgram] = _seeds.map(_drawn)
"""Programs without a loop."""

loops: st.SearchStrategy[DrawnProgram] = _seeds.map(_drawn_with_loop).filter(_is_defined)
"""Programs whose last part is a loop that is executed `LOOPS` times."""
