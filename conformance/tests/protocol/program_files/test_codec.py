"""Parse and build: round trips without loss, and `ProgramError` as the only error."""

import dataclasses
import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from scaraspec.protocol.program_files import (
    DEFAULT_LAYOUT,
    LAYOUTS,
    MAX_FILE_BYTES,
    Layout,
    Node,
    NodeType,
    Point,
    Program,
    ProgramDefect,
    ProgramError,
    Variable,
    WaitSeconds,
    WaitTimer,
    build,
    detect,
    parse,
)

POINT = Node(b"here", NodeType.POINT, data=Point((1.0, 2.0, 300.0, 4.0)))
SMALL = Program(
    tool_position=(300.0, 0.0, 250.0, 0.0, 0.0, 0.0),
    variables=(Variable(1, b"twelve bytes"),),
    nodes=(POINT, POINT),
)
FILE = build(SMALL)
EMPTY = build(Program())


@given(...)
def test_program_round_trip(program: Program, layout: Layout) -> None:
    """parse(build(program)) equals the program, in every layout."""
    assert parse(build(program, layout), layout) == program


@given(...)
def test_file_round_trip(program: Program, layout: Layout) -> None:
    """build(parse(file)) equals the file, in every layout that fits."""
    data = build(program, layout)
    found = detect(data)
    assert layout in found
    for taken in found:
        assert build(parse(data, taken), taken) == data


@given(st.data(), st.binary(min_size=2, max_size=2))
def test_a_changed_file_is_a_program_or_a_program_error(data: st.DataObject, change: bytes) -> None:
    """A changed file still round-trips, or parsing raises `ProgramError`."""
    layout = data.draw(st.from_type(Layout))
    file = bytearray(build(SMALL, layout))
    position = data.draw(st.integers(0, len(file) - len(change)))
    file[position : position + len(change)] = change
    _survives_or_is_no_program(bytes(file))


@given(st.binary() | st.binary(max_size=120).map(lambda body: b"SCARA" + body + b"ARACS"))
@example(b"")
@example(b"SCARA" + bytes(84) + b"ARACS")
@example(b"SCARA" + b"\xff" * 200 + b"ARACS")
def test_any_bytes_are_a_program_or_a_program_error(data: bytes) -> None:
    """The parser raises no other exception for any input."""
    _survives_or_is_no_program(data)


def _survives_or_is_no_program(data: bytes) -> None:
    if layouts := detect(data):
        assert build(parse(data), layouts[0]) == data
    else:
        with pytest.raises(ProgramError) as caught:
            parse(data)
        assert 0 <= caught.value.offset_bytes <= len(data)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_bytes_without_a_meaning_are_preserved(layout: Layout) -> None:
    """Padding, unused union bytes, the rest of a name and a signalling NaN are preserved."""
    file = bytearray(build(SMALL, layout))
    start = layout.nodes_offset(1)
    file[5 : layout.points_offset] = b"\xcd" * (layout.points_offset - 5)
    file[layout.variables_offset + 17 : layout.variables_offset + 24] = b"\xcd" * 7
    file[start + 5 : start + 30] = b"\xcd" * 25
    file[start + 33 : start + layout.data_offset] = b"\xcd" * (layout.data_offset - 33)
    signalling_nan = struct.pack(f"{layout.byte_order.prefix}I", 0x7F800001)
    file[start + layout.data_offset : start + layout.data_offset + 4] = signalling_nan
    file[start + layout.data_offset + 16 : start + layout.node_bytes] = b"\xcd" * (
        layout.node_bytes - layout.data_offset - 16
    )
    program = parse(bytes(file), layout)
    assert program.variables == SMALL.variables
    assert program.nodes[0].alias == b"here"
    assert build(program, layout) == file


def test_a_change_affects_only_its_own_bytes() -> None:
    """Replacing a value of a parsed program changes only the bytes of this value."""
    file = bytearray(FILE)
    offset = DEFAULT_LAYOUT.nodes_offset(1) + 36
    file[offset + 20] = 0xCD
    program = parse(bytes(file))
    moved = dataclasses.replace(program.nodes[0], data=Point((1.0, 2.0, 301.0, 4.0)))
    file[offset + 8 : offset + 12] = struct.pack("<f", 301.0)
    changed = dataclasses.replace(program, nodes=(moved, program.nodes[1]))
    assert build(changed) == file


def test_new_node_type_clears_the_union() -> None:
    """The union data of the old node type is not kept for the new type."""
    read = parse(FILE).nodes[0]
    node = dataclasses.replace(read, type=NodeType.WAIT_SECONDS, data=WaitSeconds(3))
    fresh = Node(b"here", NodeType.WAIT_SECONDS, data=WaitSeconds(3))
    assert build(Program(nodes=(node,))) == build(Program(nodes=(fresh,)))


@given(...)
def test_a_program_can_move_to_another_layout(
    program: Program, layout: Layout, other: Layout
) -> None:
    """A program parsed in one layout can be built in any other."""
    read = parse(build(program, layout), layout)
    assert parse(build(read, other), other) == program


def test_a_late_instant_needs_a_long_of_8_bytes() -> None:
    """A timer after 2038 can be built only in a layout with a long of 8 bytes."""
    program = Program(nodes=(POINT, Node(b"", NodeType.WAIT_TIMER, data=WaitTimer(2**31))))
    assert parse(build(program, LAYOUTS["lp64"])) == program
    with pytest.raises(ValueError, match=r"node 2 waits .* does not fit into a long of 4 bytes"):
        build(program)


@pytest.mark.parametrize(
    ("data", "defect", "offset"),
    [
        (b"", ProgramDefect.START, 0),
        (b"SCARB" + FILE[5:], ProgramDefect.START, 0),
        (b"SCARA", ProgramDefect.SHORT, 5),
        (FILE[:93], ProgramDefect.SHORT, 93),
        (FILE + bytes(MAX_FILE_BYTES - len(FILE) + 1), ProgramDefect.LONG, MAX_FILE_BYTES),
        (FILE + bytes(MAX_FILE_BYTES - len(FILE)), ProgramDefect.SURPLUS, len(FILE)),
        (FILE[:-1], ProgramDefect.END, len(FILE) - 6),
        (FILE[:-5] + b"ARACT", ProgramDefect.END, len(FILE) - 5),
        (FILE[:-69] + b"ARACS", ProgramDefect.NODES, 8),
        (FILE[:8] + b"\x09" + FILE[9:], ProgramDefect.NODES, 8),
        (FILE[:12] + b"\x02" + FILE[13:], ProgramDefect.VARIABLES, 12),
        (FILE[:100] + FILE[110:], ProgramDefect.SIZE, 8),
        (FILE + b"\n", ProgramDefect.SURPLUS, len(FILE)),
        (FILE + FILE, ProgramDefect.SECOND, len(FILE)),
    ],
)
def test_defects_and_offsets(data: bytes, defect: ProgramDefect, offset: int) -> None:
    """Each kind of invalid file has its defect and its offset."""
    with pytest.raises(ProgramError, match=f"byte {offset}: ") as caught:
        parse(data)
    assert (caught.value.defect, caught.value.offset_bytes) == (defect, offset)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", 'it begins with nothing, not with "SCARA"'),
        (b"SCARB\0", 'it begins with 53 43 41 52 42, not with "SCARA"'),
        (
            FILE[:-69] + b"ARACS",
            (
                "the header's points = 2 and varNub = 1 make 253 bytes in layout ilp32, "
                "but the file has 189, room for points = 1"
            ),
        ),
        (
            EMPTY[:8] + b"\x07" + EMPTY[9:],
            (
                "the header's points = 7 and varNub = 0 make 545 bytes in layout ilp32, "
                "but the file has 97, room for points = 0"
            ),
        ),
        (
            EMPTY[:12] + b"\x10" + EMPTY[13:],  # 16 variables are as long as 7 nodes
            (
                "the header's points = 0 and varNub = 16 make 545 bytes in layout ilp32, "
                "but the file has 97, room for varNub = 0"
            ),
        ),
        (
            EMPTY[:8] + b"\x07" + EMPTY[9:-5] + bytes(420) + b"ARACS",
            (
                "the header's points = 7 and varNub = 0 make 545 bytes in layout ilp32, "
                "but the file has 517, and no other layout fits"
            ),
        ),
    ],
)
def test_reasons_contain_the_values(data: bytes, reason: str) -> None:
    """The message contains the observed bytes, or the counts of the header and of the file."""
    with pytest.raises(ProgramError) as caught:
        parse(data)
    assert caught.value.reason == reason


@pytest.mark.parametrize("name", ["packed", "pack2", "lp64", "ilp32-big", "packed-big"])
def test_missing_record_is_explained_in_the_layout_of_the_file(name: str) -> None:
    """A missing node or variable is explained in the layout of the other records."""
    layout = LAYOUTS[name]
    file = build(SMALL, layout)
    for first, size, defect in (
        (layout.nodes_offset(1), layout.node_bytes, ProgramDefect.NODES),
        (layout.variables_offset, 28, ProgramDefect.VARIABLES),
    ):
        with pytest.raises(ProgramError, match=f"in layout {name}, .* room for") as caught:
            parse(file[:first] + file[first + size :])
        assert caught.value.defect is defect


def test_another_layout_can_be_refused() -> None:
    """A file is parsed only in the requested layout."""
    with pytest.raises(ProgramError, match="in layout packed, but the file has"):
        parse(FILE, LAYOUTS["packed"])
