"""Parse the bytes of a program file, and build them from a program (clause 6).

Bytes without a value, such as padding, are preserved if a program is built in the layout in which
it was parsed. This module does not check or interpret the values; see `lint`.
"""

import struct
from collections.abc import Iterator
from dataclasses import fields

from scaraspec.protocol.program_files.defects import check_envelope, layout_error
from scaraspec.protocol.program_files.layout import (
    CONFIGURATION_BYTES,
    DEFAULT_LAYOUT,
    FOOTER,
    LAYOUTS,
    MAGIC,
    NODE_TYPE_OFFSET,
    VARIABLE_BYTES,
    Layout,
    detect,
)
from scaraspec.protocol.program_files.model import (
    ALIAS_BYTES,
    DATA_OF_TYPE,
    PORTS,
    VARIABLE_NAME_BYTES,
    Node,
    NodeData,
    Operation,
    Point,
    Program,
    SetOutput,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)


def parse(data: bytes, layout: Layout | None = None) -> Program:
    """Parse a program file.

    Args:
        data: The content of the file.
        layout: The layout; the most plausible result of `detect` by default.

    Raises:
        ProgramError: The bytes are not a program, or not in the given layout.
    """
    check_envelope(data)
    possible = detect(data)
    if not possible or (layout and layout not in possible):
        raise layout_error(data, (layout,) if layout else tuple(LAYOUTS.values()))
    layout = layout or possible[0]
    order = layout.byte_order.prefix
    _, variables = layout.counts(data)
    config = struct.unpack_from(f"{order}9f{PORTS}B", data, layout.header_bytes)
    tool_x, tool_y, tool_z, theta_x, theta_y, theta_z, x, y, z, *ports = config
    start, end = layout.nodes_offset(variables), len(data) - len(FOOTER)
    return Program(
        tool_position=(tool_x, tool_y, tool_z, theta_x, theta_y, theta_z),
        tool_center=(x, y, z),
        ports=tuple(ports),
        variables=tuple(
            _read_variable(data[offset : offset + VARIABLE_BYTES], layout)
            for offset in range(layout.variables_offset, start, VARIABLE_BYTES)
        ),
        nodes=tuple(
            _read_node(data[offset : offset + layout.node_bytes], layout)
            for offset in range(start, end, layout.node_bytes)
        ),
        image=data[: layout.variables_offset],
    )


def build(program: Program, layout: Layout = DEFAULT_LAYOUT) -> bytes:
    """Build the file of a program.

    If the program was parsed in the same layout, the result equals the parsed file. Bytes without
    a value are zero in records that were not parsed or had another size.

    Raises:
        ValueError: A timer does not fit into a long of this layout.
    """
    return b"".join(_records(program, layout))


def _records(program: Program, layout: Layout) -> Iterator[bytes]:
    order = layout.byte_order.prefix
    image = _record_buffer(program.image, layout.header_bytes + CONFIGURATION_BYTES)
    image[: len(MAGIC)] = MAGIC
    counts = len(program.nodes), len(program.variables)
    _write(image, f"{order}2I", layout.points_offset, *counts)
    _write(image, f"{order}6f", layout.header_bytes, *program.tool_position)
    _write(image, f"{order}3f", layout.header_bytes + 24, *program.tool_center)
    _write(image, f"{PORTS}B", layout.header_bytes + 36, *program.ports)
    yield bytes(image)
    for variable in program.variables:
        yield _write_variable(variable, layout)
    for number, node in enumerate(program.nodes, start=1):
        try:
            yield _write_node(node, layout)
        except struct.error:
            raise ValueError(
                f"node {number} waits for {node.data}, which does not fit into a long of "
                f"{layout.long_bytes} bytes: choose an lp64 layout"
            ) from None
    yield FOOTER


def _read_variable(image: bytes, layout: Layout) -> Variable:
    key, name, value = struct.unpack(f"{layout.byte_order.prefix}i{VARIABLE_NAME_BYTES}si", image)
    return Variable(key=key, name=_name(name), value=value, image=image)


def _write_variable(variable: Variable, layout: Layout) -> bytes:
    order = layout.byte_order.prefix
    image = _record_buffer(variable.image, VARIABLE_BYTES)
    _write(image, f"{order}i", 0, variable.key)
    _write_name(image, 4, VARIABLE_NAME_BYTES, variable.name)
    _write(image, f"{order}i", 4 + VARIABLE_NAME_BYTES, variable.value)
    return bytes(image)


def _read_node(image: bytes, layout: Layout) -> Node:
    alias, node_type, speed_rate, counts = struct.unpack_from(f"{ALIAS_BYTES}sBbB", image)
    return Node(
        alias=_name(alias),
        type=node_type,
        speed_rate=speed_rate,
        counts=counts,
        data=_read_data(image, DATA_OF_TYPE.get(node_type), layout),
        image=image,
    )


def _write_node(node: Node, layout: Layout) -> bytes:
    image = _record_buffer(node.image, layout.node_bytes)
    if image[NODE_TYPE_OFFSET] != node.type:
        # The union data of another node type has no meaning for this one.
        image[layout.data_offset :] = bytes(layout.node_bytes - layout.data_offset)
    _write_name(image, 0, ALIAS_BYTES, node.alias)
    _write(image, "BbB", NODE_TYPE_OFFSET, node.type, node.speed_rate, node.counts)
    if node.data is not None:
        form = _data_format(type(node.data), layout)
        _write(image, form, layout.data_offset, *_values(node.data))
    return bytes(image)


def _read_data(image: bytes, kind: type[NodeData] | None, layout: Layout) -> NodeData | None:
    if kind is None:
        return None
    values = struct.unpack_from(_data_format(kind, layout), image, layout.data_offset)
    if kind is Point:
        return Point(values)
    return kind(*values)


def _values(data: NodeData) -> tuple[float, ...]:
    if isinstance(data, Point):
        return data.values
    return tuple(getattr(data, item.name) for item in fields(data))


DATA_FORMATS: dict[type[NodeData], str] = {
    Point: "4f",
    WaitInput: "3I",
    WaitSeconds: "B",
    SetOutput: "4I",
    Operation: "7i",
}
"""The `struct` formats of the data of a node, without byte order; a timer has longs."""


def _data_format(kind: type[NodeData], layout: Layout) -> str:
    if kind is WaitTimer:
        return layout.timer_format
    return layout.byte_order.prefix + DATA_FORMATS[kind]


def _record_buffer(image: bytes, size: int) -> bytearray:
    """Return the record as it was parsed; zeros if it was not parsed or had another size."""
    return bytearray(image if len(image) == size else size)


def _write(image: bytearray, form: str, offset: int, *values: float) -> None:
    """Write values that differ from the present ones; this preserves a signalling NaN."""
    packed = struct.pack(form, *values)
    if struct.pack(form, *struct.unpack_from(form, image, offset)) != packed:
        image[offset : offset + len(packed)] = packed


def _name(field: bytes) -> bytes:
    """Return the name: it ends at the first NUL or fills its field (A-6.4-1, A-6.5-1)."""
    return field.partition(b"\0")[0]


def _write_name(image: bytearray, offset: int, size: int, name: bytes) -> None:
    if _name(bytes(image[offset : offset + size])) != name:
        image[offset : offset + size] = name.ljust(size, b"\0")
