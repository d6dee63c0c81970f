"""Random programs contain every kind of statement, and their results are defined."""

from collections.abc import Iterator

import pytest
from hypothesis import Phase, given, seed, settings

from scaraspec.protocol.program_files import ValueType
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
    Wait,
    is_defined,
    nodes_of,
)
from scaraspec.suite.program_files.strategies import (
    DONE,
    FAILED,
    LOOPS,
    SUM,
    DrawnProgram,
    loops,
    programs,
)

_MAX_NODES = 300
_EXAMPLES = 10


def _statements(block: Block, depth: int = 0) -> Iterator[tuple[int, Statement]]:
    """Yield the statements and how many branches contain each."""
    for statement in block:
        yield depth, statement
        if isinstance(statement, If):
            yield from _statements(statement.then, depth + 1)
            yield from _statements(statement.otherwise or (), depth + 1)


def _drawn_with(seed_of_run: int) -> list[DrawnProgram]:
    """Return the programs that a run with this seed draws."""
    drawn: list[DrawnProgram] = []

    @seed(seed_of_run)
    @settings(max_examples=_EXAMPLES, phases=(Phase.generate,), database=None)
    @given(programs)
    def note(program: DrawnProgram) -> None:
        drawn.append(program)

    note()
    return drawn


@pytest.mark.parametrize("seed_of_run", range(3))
def test_every_kind_occurs(seed_of_run: int) -> None:
    """The programs of one run have all statements, operators, operands and nested branches."""
    found = [each for program in _drawn_with(seed_of_run) for each in _statements(program.block)]
    assert {type(each) for _, each in found} == {Assign, Calculate, Flip, If, Put, Wait}
    assert {depth for depth, _ in found} == {0, 1, 2, 3}
    branches = [each for _, each in found if isinstance(each, If)]
    sums = [each for _, each in found if isinstance(each, Calculate) and each.key != SUM]
    assert {each.opt for each in branches} == set(COMPARISONS)
    assert {each.opt for each in sums} == set(CALCULATIONS)
    both = {ValueType.NUMBER, ValueType.VARIABLE}
    for statements in (branches, sums):
        kinds = {(each.a[0], each.b[0]) for each in statements}
        assert kinds == {(a, b) for a in both for b in both}
    assert {each.otherwise is None for each in branches} == {False, True}


@settings(max_examples=50)
@given(programs)
def test_programs_are_defined(program: DrawnProgram) -> None:
    """The result of a program is defined; it does not set the outputs that show the verdict."""
    assert is_defined(program.block, program.variables)
    assert len(nodes_of(program.block, (False,) * 16)) < _MAX_NODES
    ports = [each.port for _, each in _statements(program.block) if isinstance(each, Flip | Put)]
    assert not {DONE, FAILED} & set(ports)


@settings(max_examples=50)
@given(loops)
def test_loops_are_defined(program: DrawnProgram) -> None:
    """The result of a program with a loop is defined for all iterations."""
    assert is_defined([*program.block, *[*program.body] * LOOPS], program.variables)
