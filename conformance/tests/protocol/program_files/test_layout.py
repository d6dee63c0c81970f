"""Offsets of fields, and detection of the layout of a file."""

import struct

import pytest

from scaraspec.protocol.program_files import (
    DEFAULT_LAYOUT,
    LAYOUTS,
    ByteOrder,
    Layout,
    Node,
    NodeType,
    Program,
    Variable,
    WaitTimer,
    build,
    detect,
    parse,
)
from scaraspec.protocol.readings import READINGS


@pytest.mark.parametrize(
    ("name", "header", "points_at", "node", "data_at"),
    [
        ("packed", 13, 5, 61, 33),
        ("pack2", 14, 6, 62, 34),
        ("ilp32", 16, 8, 64, 36),
        ("lp64", 16, 8, 72, 40),
        ("outer-packed", 13, 5, 65, 33),
        ("packed-long8", 13, 5, 61, 33),
        ("pack2-long8", 14, 6, 62, 34),
    ],
)
def test_sizes_are_those_of_a_compiler(
    name: str, header: int, points_at: int, node: int, data_at: int
) -> None:
    """The derived sizes are those of the register's section 10 (gcc), in both byte orders."""
    for layout in (LAYOUTS[name], LAYOUTS[f"{name}-big"]):
        sizes = layout.header_bytes, layout.points_offset, layout.node_bytes, layout.data_offset
        assert sizes == (header, points_at, node, data_at)
        assert layout.file_bytes(nodes=3, variables=2) == header + 76 + 2 * 28 + 3 * node + 5


def test_all_combinations_of_headers_and_nodes_exist() -> None:
    """All combinations exist: 3 headers, 5 nodes, and 2 longs for equal node sizes."""
    assert len(LAYOUTS) == 3 * 7 * 2
    assert len({layout[2:] for layout in map(_values, LAYOUTS.values())}) == len(LAYOUTS)


def _values(layout: Layout) -> tuple[object, ...]:
    return tuple(getattr(layout, name) for name in Layout.__slots__)


def test_layouts_have_the_names_of_the_readings() -> None:
    """A layout has the option names of the readings `prog_layout` and `endian`."""
    assert {layout.reading for layout in LAYOUTS.values()} == {
        option.name for option in READINGS["prog_layout"].options
    }
    assert [*ByteOrder] == [option.name for option in READINGS["endian"].options]
    assert READINGS["prog_layout"].default == DEFAULT_LAYOUT.reading
    assert READINGS["endian"].default == DEFAULT_LAYOUT.byte_order


PLAIN = Program(
    tool_position=(300.0, 0.0, 250.0, 0.0, 0.0, 0.0),
    variables=(Variable(1, b"a", 5),),
    nodes=(Node(b"", NodeType.WAIT_TIMER, data=WaitTimer(1419258600, 500000)),),
)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_the_layout_of_a_plain_file_is_detected(layout: Layout) -> None:
    """For a program with plausible values, the first detected layout is correct."""
    assert detect(build(PLAIN, layout))[0] == layout


@pytest.mark.parametrize("layout", [LAYOUTS["ilp32-header13"], LAYOUTS["packed-header16"]])
def test_counts_distinguish_layouts_of_equal_size(layout: Layout) -> None:
    """(16,61) and (13,64) have the same size for one node; the offset of `points` decides."""
    data = build(PLAIN, layout)
    assert len(data) == 13 + 76 + 28 + 64 + 5 == 16 + 76 + 28 + 61 + 5
    assert detect(data)[0] == layout


def test_a_natural_file_of_three_nodes_is_not_detected_as_packed() -> None:
    """Padding and a little-endian 3 read as a big-endian 3 at offset 5, and 16 + 3*64 is
    13 + 3*65: both layouts are consistent, and only the values tell them apart.
    """
    for tool_position in (PLAIN.tool_position, (0.0,) * 6):
        program = Program(tool_position=tool_position, nodes=PLAIN.nodes * 3)
        found = detect(build(program))
        assert found[0] == DEFAULT_LAYOUT
        assert LAYOUTS["outer-packed-big"] in found
        assert detect(build(program, LAYOUTS["outer-packed-big"]))[0].name == "outer-packed-big"


def test_without_records_coordinates_decide_the_byte_order() -> None:
    """Counts of zero are equal in both byte orders; plausible coordinates decide."""
    program = Program(tool_position=(300.0, 0.5, 250.0, 0.0, 0.0, 0.0))
    for order, layout in (("<", LAYOUTS["ilp32"]), (">", LAYOUTS["ilp32-big"])):
        data = build(program, layout)
        assert data[16:20] == struct.pack(f"{order}f", 300.0)
        assert detect(data)[0] == layout


def test_default_layout_without_other_evidence() -> None:
    """An empty program of zeros fits all layouts with its header; the default is chosen."""
    assert detect(build(Program()))[0] == DEFAULT_LAYOUT


def test_size_of_a_long_in_a_packed_timer() -> None:
    """Packed nodes have the same size for both longs; a plausible instant decides."""
    for name in ("packed", "packed-long8", "pack2-big", "pack2-long8-big"):
        data = build(PLAIN, LAYOUTS[name])
        assert detect(data)[0].name == name
        assert parse(data) == PLAIN
