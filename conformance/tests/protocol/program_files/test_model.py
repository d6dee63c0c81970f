"""A program accepts every value that a file can contain, valid or not, and nothing else."""

import re
from collections.abc import Callable
from typing import Any, cast

import pytest

from scaraspec.protocol.program_files import (
    Condition,
    Node,
    NodeType,
    Opt,
    Point,
    Program,
    SetOutput,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Node(b"", 255),
        lambda: Node(b"x" * 30, NodeType.LOOP, speed_rate=-128, counts=255),
        lambda: Node(b"", NodeType.WAIT_INPUT, data=WaitInput(2**32 - 1, 2**32 - 1, 99)),
        lambda: Variable(-(2**31), b"x" * 20, 2**31 - 1),
        lambda: Program(ports=(255,) * 40, tool_center=(float("inf"), float("nan"), 3.4e38)),
    ],
)
def test_a_value_outside_its_documented_range_is_accepted(make: Callable[[], object]) -> None:
    """Every value that fits into its field is accepted, because real files contain errors."""
    make()


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: Node(b"x" * 31, NodeType.LOOP), "alias has 31 bytes; its field has 30"),
        (lambda: Node(b"a\0b", NodeType.LOOP), "alias contains a NUL"),
        (lambda: Node(b"", 256), "nodeType is 256; its field has the range 0 to 255"),
        (lambda: Node(b"", NodeType.LOOP, counts=-1), "counts is -1; its field has the range 0 to"),
        (lambda: Node(b"", NodeType.LOOP, speed_rate=128), "its field has the range -128 to 127"),
        (lambda: Node(b"", NodeType.POINT), "a node of type 1 needs Point, not None"),
        (lambda: Node(b"", 77, data=WaitSeconds(1)), "a node of type 77 needs no data"),
        (
            lambda: WaitSeconds(256),
            "WaitSeconds.duration_s is 256; its field has the range 0 to 255",
        ),
        (lambda: SetOutput(4, 9, -1), "SetOutput.value is -1"),
        (lambda: WaitTimer(2**63), "WaitTimer.seconds is 9223372036854775808"),
        (lambda: Point((1.0, 2.0, 3.0, 1e39)), "too large for single precision"),
        (lambda: Variable(1, b"x" * 21), "variable name has 21 bytes; its field has 20"),
        (lambda: Variable(2**31, b""), "key is 2147483648"),
        (lambda: Program(ports=(0,) * 39), "ports has 39 values; its field has 40"),
        (lambda: Program(ports=(0,) * 39 + (256,)), "the type of port 40 is 256"),
        (lambda: Program(tool_position=cast("Any", (0.0,) * 5)), "toolPos has 5 values"),
    ],
)
def test_values_out_of_range_are_rejected(make: Callable[[], object], why: str) -> None:
    """A value that does not fit raises an error with the value and the range."""
    with pytest.raises(ValueError, match=re.escape(why)):
        make()


def test_the_two_tables_of_comparisons_differ() -> None:
    """waitCond 4 is <= and 5 is >=, but opt 8 is >= and 9 is <= (A-6.5-11)."""
    assert Condition(4).holds(1, 2)
    assert not Condition(4).holds(2, 1)
    assert Condition(5).holds(2, 1)
    assert not Condition(5).holds(1, 2)
    assert Opt(8) is Opt.GREATER_OR_EQUAL
    assert Opt(9) is Opt.LESS_OR_EQUAL


@pytest.mark.parametrize(
    ("number", "below", "equal", "above"),
    [
        (1, False, False, True),
        (2, True, False, False),
        (3, False, True, False),
        (4, True, True, False),
        (5, False, True, True),
    ],
)
def test_a_condition_compares_the_input_with_the_value(
    number: int, *, below: bool, equal: bool, above: bool
) -> None:
    """Each of the five conditions matches L932."""
    holds = Condition(number).holds
    assert (holds(99, 100), holds(100, 100), holds(101, 100)) == (below, equal, above)
