"""Structure of programs: markers, moves, and the counts of loops."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.program_files import (
    CountsMode,
    Node,
    NodeType,
    Operation,
    Point,
    Structure,
    Unbalanced,
    loop_readings,
)
from scaraspec.protocol.readings import READINGS

POINT = Node(b"", NodeType.POINT, data=Point((0.0, 0.0, 200.0, 0.0)))
IF = Node(b"", NodeType.IF, data=Operation(1, 0, 1, 1, 1, 1, 7))
ELSE, ENDIF = Node(b"", NodeType.ELSE), Node(b"", NodeType.ENDIF)
END_LOOP = Node(b"", NodeType.END_LOOP)


def loop(counts: int = 0) -> Node:
    return Node(b"", NodeType.LOOP, counts=counts)


def move(counts: int) -> Node:
    return Node(b"", NodeType.STRAIGHT_MOVE, speed_rate=50, counts=counts)


LOOP = loop()


def test_a_loop_and_its_end_are_partners() -> None:
    """Nested loops are paired from the inside."""
    assert Structure.of([LOOP, LOOP, POINT, END_LOOP, END_LOOP]).partners == (4, 3, None, 1, 0)


def test_partners_of_if_else_and_endif() -> None:
    """The partner of IF is ELSE or ENDIF, of ELSE is ENDIF, of ENDIF is ELSE or IF."""
    assert Structure.of([IF, POINT, ELSE, POINT, ENDIF]).partners == (2, None, 4, None, 2)
    assert Structure.of([IF, POINT, ENDIF]).partners == (2, None, 0)


@pytest.mark.parametrize(
    ("nodes", "unbalanced"),
    [
        ([LOOP], [(0, Unbalanced.OPEN_LOOP)]),
        ([END_LOOP], [(0, Unbalanced.STRAY_END_LOOP)]),
        ([IF], [(0, Unbalanced.OPEN_IF)]),
        ([IF, ELSE], [(0, Unbalanced.OPEN_IF)]),
        ([ELSE], [(0, Unbalanced.STRAY_ELSE)]),
        ([ENDIF], [(0, Unbalanced.STRAY_ENDIF)]),
        ([IF, ELSE, ELSE, ENDIF], [(2, Unbalanced.SECOND_ELSE)]),
        ([IF, LOOP, ELSE, END_LOOP, ENDIF], [(2, Unbalanced.STRAY_ELSE)]),
        ([IF, LOOP, ENDIF, END_LOOP], [(1, Unbalanced.OPEN_LOOP), (3, Unbalanced.STRAY_END_LOOP)]),
        ([LOOP, IF, END_LOOP, ENDIF], [(1, Unbalanced.OPEN_IF), (3, Unbalanced.STRAY_ENDIF)]),
        ([LOOP, IF, ELSE, END_LOOP], [(1, Unbalanced.OPEN_IF)]),
        ([LOOP, IF, ENDIF, END_LOOP, IF, ELSE, ENDIF], []),
    ],
)
def test_a_marker_without_partner_is_reported(
    nodes: list[Node], unbalanced: list[tuple[int, Unbalanced]]
) -> None:
    """Each kind of unbalanced or crossing marker is reported at its index."""
    assert list(Structure.of(nodes).unbalanced) == unbalanced


def test_the_next_nodes_belong_to_a_move() -> None:
    """A move owns as many nodes as it counts, up to the end; the innermost move wins."""
    nodes = [POINT, move(2), POINT, POINT, POINT, move(3), move(1), POINT, POINT, move(9), POINT]
    assert Structure.of(nodes).owners == (
        None,
        None,
        1,
        1,
        None,
        None,
        5,
        6,
        5,
        None,
        9,
    )


def test_depth_grows_in_loops_branches_and_moves() -> None:
    """Markers have the depth of the surrounding nodes, and ELSE has that of its IF."""
    nodes = [LOOP, IF, POINT, ELSE, move(1), POINT, ENDIF, END_LOOP]
    assert Structure.of(nodes).depths == (0, 1, 2, 1, 2, 3, 1, 0)


def readings(nodes: list[Node]) -> dict[int, set[CountsMode]]:
    return {index: set(modes) for index, modes in loop_readings(nodes, Structure.of(nodes)).items()}


@pytest.mark.parametrize(
    ("outer", "inner", "mode"),
    [
        (7, 2, CountsMode.RECORDS),
        (3, 1, CountsMode.CHILDREN),
        (8, 3, CountsMode.WITH_END),
    ],
)
def test_loop_counts_show_their_reading(outer: int, inner: int, mode: CountsMode) -> None:
    """A loop of a move with a point, a loop, and a node: 7 records, 3 children, 8 with the end.

    The inner loop has a move with its point: 2 records, 1 child, 3 with its end.
    """
    nodes = [loop(outer), move(1), POINT, loop(inner), move(1), POINT, END_LOOP, ELSE, END_LOOP]
    assert readings(nodes) == {0: {mode}, 3: {mode}}


def test_all_matching_readings_are_returned() -> None:
    """Without nesting, records and children are equal; a wrong count has no reading."""
    assert readings([loop(1), POINT, END_LOOP]) == {0: {CountsMode.RECORDS, CountsMode.CHILDREN}}
    assert readings([loop(3), POINT, END_LOOP]) == {0: set()}
    assert readings([loop(1), POINT]) == {}


def test_modes_have_the_names_of_the_reading() -> None:
    """`CountsMode(dialect["counts_mode"])` always works."""
    assert [*CountsMode] == [option.name for option in READINGS["counts_mode"].options]


_block = st.recursive(
    st.just([POINT]),
    lambda inner: (
        st.tuples(inner, inner).map(lambda parts: parts[0] + parts[1])
        | inner.map(lambda body: [LOOP, *body, END_LOOP])
        | inner.map(lambda body: [IF, *body, ENDIF])
        | st.tuples(inner, inner).map(lambda arms: [IF, *arms[0], ELSE, *arms[1], ENDIF])
    ),
    max_leaves=10,
)


@given(_block)
def test_a_properly_nested_program_is_balanced(nodes: list[Node]) -> None:
    """With any nesting, each marker has its partner, and the final depth is zero."""
    structure = Structure.of(nodes)
    assert structure.unbalanced == ()
    for index, node in enumerate(nodes):
        partner = structure.partners[index]
        assert (partner is None) == (node is POINT)
        if node.type in (NodeType.LOOP, NodeType.END_LOOP):
            assert partner is not None
            assert structure.partners[partner] == index
            assert structure.depths[partner] == structure.depths[index]
    assert structure.depths[0] == structure.depths[-1] == 0


@given(st.lists(st.sampled_from([LOOP, END_LOOP, IF, ELSE, ENDIF, POINT, move(2)]), max_size=30))
def test_any_nodes_have_a_structure(nodes: list[Node]) -> None:
    """Every marker has a partner or is reported; nothing is raised."""
    structure = Structure.of(nodes)
    reported = {index for index, _ in structure.unbalanced}
    for index, node in enumerate(nodes):
        if node.type in (NodeType.LOOP, NodeType.END_LOOP, NodeType.ENDIF):
            assert (structure.partners[index] is None) == (index in reported)


def test_time_is_linear_for_deep_nesting() -> None:
    """Thousands of wrong markers need neither recursion nor a search."""
    for nodes in ([LOOP] * 20_000, [IF] * 10_000 + [END_LOOP] * 10_000, [move(255)] * 20_000):
        assert len(Structure.of(nodes).depths) == 20_000
