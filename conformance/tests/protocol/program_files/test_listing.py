"""Listings: complete, safe to print, and deterministic."""

import dataclasses

import pytest
from hypothesis import given

from scaraspec.protocol.program_files import (
    Layout,
    Node,
    NodeData,
    NodeType,
    Operation,
    Point,
    PointMeaning,
    Program,
    SetOutput,
    Variable,
    WaitInput,
    WaitTimer,
    build,
    listing,
    parse,
)
from scaraspec.protocol.readings import READINGS


@given(...)
def test_any_program_can_be_listed(program: Program, layout: Layout) -> None:
    """Every program has a listing of printable lines, one per node, in any layout."""
    text = listing(program)
    assert all(line.isprintable() for line in text.split("\n"))
    assert text.count("\n") >= len(program.nodes) + len(program.variables)
    assert listing(parse(build(program, layout), layout)) == text


def test_points_are_shown_in_the_given_reading() -> None:
    """The four values are shown as joints or as a pose, with units."""
    program = Program(nodes=(Node(b"", NodeType.POINT, data=Point((200.0, 300.0, 324.0, 34.6))),))
    assert "to J1 200°, J2 300°, Z 324 mm, J4 34.6°\n" in listing(program)
    assert "to x 200 mm, y 300 mm, z 324 mm, thetaX 34.6°\n" in listing(program, PointMeaning.POSE)
    assert [*PointMeaning] == [option.name for option in READINGS["point_meaning"].options]


@pytest.mark.parametrize(
    ("data", "shown"),
    [
        (WaitInput(1, 250, 9), "wait until port 1 (port type 7) (condition 9) 2.50"),
        (
            SetOutput(7, 41, 3, 5),
            "set port 41 (no such port) to 3 (output type 7) with time base 5",
        ),
        (WaitTimer(-1, 0), "wait until second -1 and microsecond 0 since 1970"),
        (WaitTimer(1419258600, 1), "wait until 2014-12-22 14:30:00.000001 UTC"),
        (Operation(1, 5, 0, 9, 2, 77, 0), "nothing (opt 0) variable 77 (result 5)"),
        (Operation(9, 5, 8, 9, 1, 2, 10), "9 (value type 8) (opt 10) 2 (result_type 9, result 5)"),
        (Operation(4, 2, 3, 1), "set port 2 (not configured) to port 1 (port type 7)"),
    ],
)
def test_a_wrong_value_is_shown(data: NodeData, shown: str) -> None:
    """Numbers that are not in a table are shown as numbers."""
    kinds = {
        WaitInput: NodeType.WAIT_INPUT,
        SetOutput: NodeType.SET_OUTPUT,
        WaitTimer: NodeType.WAIT_TIMER,
        Operation: NodeType.COMPUTE,
    }
    program = Program(ports=(7, *[0] * 39), nodes=(Node(b"", kinds[type(data)], data=data),))
    assert listing(program).splitlines()[-1] == f"1  {shown}"


def test_a_name_replaces_a_key_only_if_unambiguous() -> None:
    """Variables with equal names, or with a name like an expression, are shown by key."""
    add = Node(b"", NodeType.COMPUTE, data=Operation(2, 1, 2, 2, 2, 3, 1))
    names = [b"a", b"b", b"c"], [b"a", b"b", b"b"], [b"a", b"1 + 1", b""]
    shown = [
        listing(Program(variables=tuple(map(Variable, (1, 2, 3), trio)), nodes=(add,)))
        for trio in names
    ]
    assert [text.splitlines()[-1] for text in shown] == [
        "1  a = b + c",
        "1  a = variable 2 + variable 3",
        "1  a = variable 2 + variable 3",
    ]


def test_hostile_names_are_escaped() -> None:
    """Control and direction characters are shown as escapes."""
    node = Node("\x1b[2J\u202e\n".encode(), NodeType.LOOP)
    line = listing(Program(nodes=(node,))).splitlines()[-1]
    assert line == '1  loop, counts 0  "\\x1b[2J\\x202e\\x0a"  (unmatched)'


def test_deep_nesting_does_not_fill_the_memory() -> None:
    """Indentation is limited to twenty levels."""
    nodes = tuple(Node(b"", NodeType.LOOP) for _ in range(30_000))
    assert len(listing(Program(nodes=nodes))) < 100 * len(nodes)


def test_the_number_of_a_node_is_right_aligned() -> None:
    """Nodes are numbered from 1, in one column."""
    nodes = tuple(Node(b"", NodeType.ENDIF) for _ in range(10))
    lines = listing(Program(nodes=nodes)).splitlines()
    assert (lines[-10], lines[-1]) == (" 1  end if  (unmatched)", "10  end if  (unmatched)")


def test_bytes_without_a_meaning_are_not_listed() -> None:
    """Bytes without a meaning do not change the listing."""
    program = parse(build(Program(nodes=(Node(b"", NodeType.LOOP),))))
    bare = tuple(dataclasses.replace(node, image=b"") for node in program.nodes)
    assert listing(program) == listing(dataclasses.replace(program, nodes=bare, image=b""))
