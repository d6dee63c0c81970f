"""Random programs contain every kind of statement, and their results are defined."""

from collections.abc import Iterator
from random import Random

import pytest

from scaraspec.protocol.program_files import ValueType
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
    Wait,
    is_defined,
    nodes_of,
)
from scaraspec.suite.program_files.strategies import (
    DONE,
    FAILED,
    LIMITS,
    LOOPS,
    SUM,
    DrawnProgram,
    ProgramDealer,
)

_MAX_NODES = 300
_EXAMPLES = 10
_SELDOM = 8  # a division by an input, and a statement whose result was not defined
_INPUTS = (False, True, *[False] * 6)


def _statements(block: Block, depth: int = 0) -> Iterator[tuple[int, Statement]]:
    """Yield the statements and how many branches contain each."""
    for statement in block:
        yield depth, statement
        if isinstance(statement, If):
            yield from _statements(statement.then, depth + 1)
            yield from _statements(statement.otherwise or (), depth + 1)


def _drawn_with(seed_of_run: int, count: int = _EXAMPLES) -> list[DrawnProgram]:
    """Return the programs that a run with this seed draws."""
    dealer, random = ProgramDealer(_INPUTS), Random(seed_of_run)
    return [dealer.program(random.getrandbits(64)) for _ in range(count)]


@pytest.mark.parametrize("seed_of_run", range(3))
def test_every_kind_occurs(seed_of_run: int) -> None:
    """The programs of one run have all statements, operators, operands and nested branches."""
    drawn = _drawn_with(seed_of_run)
    found = [each for program in drawn for each in _statements(program.block)]
    assert {type(each) for _, each in found} == {Assign, Calculate, Flip, If, Pass, Put, Wait}
    assert {depth for depth, _ in found} == {0, 1, 2, 3, 4, 5}
    branches = [each for _, each in found if isinstance(each, If)]
    sums = [each for _, each in found if isinstance(each, Calculate) and each.key != SUM]
    kinds = {ValueType.NUMBER, ValueType.VARIABLE, ValueType.INPUT_PORT}
    compared = {(each.opt, each.b[0]) for each in branches}
    assert compared == {(opt, kind) for opt in COMPARISONS for kind in kinds}
    assert {each.a[0] for each in branches} == kinds
    calculated = {(each.opt, each.a[0], each.b[0]) for each in sums}
    assert len(calculated) >= len(CALCULATIONS) * len(kinds) ** 2 - _SELDOM
    assert {each.otherwise is None for each in branches} == {False, True}
    numbers = {each.value[1] for _, each in found if isinstance(each, Assign)}
    assert len(numbers & set(LIMITS)) > len(LIMITS) // 2
    waits = [sum(w.seconds for w in program.block if isinstance(w, Wait)) for program in drawn]
    assert sum(waits) == _EXAMPLES // 6


def test_programs_are_defined() -> None:
    """The result of a program is defined; it does not set the outputs that show the verdict."""
    for program in _drawn_with(0, count=30):
        assert is_defined(program.block, program.variables, _INPUTS)
        assert len(nodes_of(program.block, (False,) * 16)) < _MAX_NODES
        found = [each for _, each in _statements(program.block)]
        ports = [each.port for each in found if isinstance(each, Flip | Put)]
        assert not {DONE, FAILED} & set(ports)
        read = [o for each in found if isinstance(each, Calculate | If) for o in (each.a, each.b)]
        assert (ValueType.INPUT_PORT, 2) not in read, "an input that is on is no operand (A-6.6a-5)"


def test_loops_are_defined() -> None:
    """The result of a program with a loop is defined for all iterations."""
    dealer = ProgramDealer(_INPUTS)
    for seed in range(30):
        program = dealer.loop(seed)
        assert is_defined([*program.block, *[*program.body] * LOOPS], program.variables, _INPUTS)
        assert dealer.loop(seed) is program
