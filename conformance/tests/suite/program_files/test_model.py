"""The suite's own model of programs follows the tables of 6.5 and 6.6, computed by hand."""

import pytest

from scaraspec.protocol.program_files import NodeType, Opt
from scaraspec.suite.program_files.model import (
    Assign,
    Block,
    Calculate,
    Flip,
    If,
    Put,
    State,
    UndefinedResultError,
    Wait,
    calculated,
    compared,
    is_defined,
    nodes_of,
    variables_of,
)
from scaraspec.suite.program_files.writing import input_port, number, variable

OFF = (False,) * 16


def outputs_on(block: Block, inputs: tuple[bool, ...] = (), **variables: int) -> set[int]:
    """The outputs that are on after a program, which starts with all of them off."""
    state = State(OFF, inputs, {int(key[1:]): value for key, value in variables.items()})
    state.execute(block)
    return {port for port, on in enumerate(state.outputs, 1) if on}


@pytest.mark.parametrize(
    ("opt", "a", "b", "due"),
    [
        (Opt.ADD, 2, -5, -3),
        (Opt.SUBTRACT, 2, 5, -3),
        (Opt.MULTIPLY, -2, 5, -10),
        (Opt.DIVIDE, 7, 2, 3),
        (Opt.DIVIDE, -8, 2, -4),
        (Opt.DIVIDE, 1, 2, 0),
    ],
)
def test_calculations(opt: Opt, a: int, b: int, due: int) -> None:
    """The operators 1 to 4 calculate as in C (L978-981)."""
    assert calculated(opt, a, b) == due


@pytest.mark.parametrize(
    ("opt", "a", "b"),
    [(Opt.DIVIDE, 1, 0), (Opt.DIVIDE, -7, 2), (Opt.DIVIDE, 7, -2), (Opt.ADD, 2**31 - 1, 1)],
)
def test_undefined_results(opt: Opt, a: int, b: int) -> None:
    """Division by zero, a negative remainder and an overflow have no defined result (A-6.6a-4)."""
    with pytest.raises(UndefinedResultError):
        calculated(opt, a, b)
    assert not is_defined([Calculate(1, number(a), opt, number(b))], {1: 0})
    assert is_defined([Assign(1, number(a))], {1: 0})


def test_comparisons() -> None:
    """The operators 5 to 9 are tried for less, equal and greater (L982-986)."""
    pairs = ((1, 2), (2, 2), (3, 2))
    held = {opt: [compared(opt, a, b) for a, b in pairs] for opt in Opt if opt >= Opt.GREATER}
    assert held == {
        Opt.GREATER: [False, False, True],
        Opt.LESS: [True, False, False],
        Opt.EQUAL: [False, True, False],
        Opt.GREATER_OR_EQUAL: [False, True, True],
        Opt.LESS_OR_EQUAL: [True, True, False],
    }


def test_one_branch_is_executed() -> None:
    """One of two branches is executed, no branch without an ELSE, and then the rest."""
    block: Block = [
        If(variable(1), Opt.LESS, number(5), [Flip(1)], [Flip(2)]),
        If(variable(1), Opt.LESS, number(3), [Flip(3)], [Flip(4)]),
        If(variable(1), Opt.LESS, number(3), [Flip(5)]),
        Flip(6),
    ]
    assert outputs_on(block, v1=4) == {1, 4, 6}


def test_operands_and_results() -> None:
    """Values are numbers, variables and inputs; results go to variables and ports."""
    block: Block = [
        Assign(1, input_port(2)),
        Calculate(2, variable(1), Opt.ADD, number(1)),
        Put(7, variable(1)),
        Put(8, input_port(1)),
        If(variable(2), Opt.EQUAL, number(2), [Flip(9)]),
    ]
    assert outputs_on(block, (False, True), v1=0, v2=0) == {7, 9}


def test_statements_become_nodes() -> None:
    """Statements become nodes in order; a flip depends on the output before it."""
    block: Block = [Flip(1), If(number(1), Opt.EQUAL, number(1), [Wait(2)], [Flip(2)])]
    nodes = nodes_of(block, (True, *OFF[1:]))
    assert [node.type for node in nodes] == [
        NodeType.SET_OUTPUT,
        NodeType.IF,
        NodeType.WAIT_SECONDS,
        NodeType.ELSE,
        NodeType.SET_OUTPUT,
        NodeType.ENDIF,
    ]
    assert [getattr(nodes[index].data, "value", None) for index in (0, 4)] == [0, 1]
    assert [(each.key, each.value) for each in variables_of({4: 5})] == [(4, 5)]
