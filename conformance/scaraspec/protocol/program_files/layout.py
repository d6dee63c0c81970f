"""Binary layouts of program files: packing, size of a long, byte order (A-6.1-2 to -4).

The document prints C structures and does not define their layout. This module derives all sizes
from the alignment rules of compilers, and detects the layout of a file from its bytes. It does not
interpret the fields, except to find the most plausible layout.
"""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from itertools import islice
from types import MappingProxyType

from scaraspec.protocol.program_files.model import (
    ALIAS_BYTES,
    PORTS,
    SECOND_US,
    VARIABLE_NAME_BYTES,
)
from scaraspec.protocol.program_files.tables import NodeType

MAGIC = b"SCARA"  # L822
FOOTER = b"ARACS"  # L998
CONFIGURATION_BYTES = 6 * 4 + 3 * 4 + PORTS  # L834-840, the same for every packing (A-6.3-1)
VARIABLE_BYTES = 4 + VARIABLE_NAME_BYTES + 4  # L861-865, likewise (A-6.4-1)
NODE_TYPE_OFFSET = ALIAS_BYTES  # nodeType, speedRate, counts: single bytes after the alias (L881)

_OPERATION_BYTES = 7 * 4  # the largest union member, without padding (L946-957)
_UNION_OFFSET = NODE_TYPE_OFFSET + 3
_NATURAL = 8  # the default alignment limit of a compiler
LEAST_COORDINATE, GREATEST_COORDINATE = 1e-4, 1e6  # mm or degrees, with a margin
SAMPLE_NODES = 1000  # enough to distinguish two layouts in bounded time


class ByteOrder(StrEnum):
    """Byte order of every number in the file: the options of reading `endian` (A-6.1-4)."""

    LITTLE = "little"
    BIG = "big"

    @property
    def prefix(self) -> str:
        """The prefix of a `struct` format without implicit padding."""
        return "<" if self is ByteOrder.LITTLE else ">"


@dataclass(frozen=True, slots=True)
class Layout:
    """The position of every field in a file. Offsets are in bytes from the start of the record.

    Attributes:
        name: The name on the command line, such as ``lp64-big``.
        reading: The option of the reading `prog_layout`.
        byte_order: The byte order of all numbers.
        points_offset: Offset of `points` in the header; `varNub` follows 4 bytes later.
        header_bytes: Size of the header.
        data_offset: Offset of the union in a node.
        node_bytes: Size of a node.
        long_bytes: Size of a C long, 4 or 8.
    """

    name: str
    reading: str
    byte_order: ByteOrder
    points_offset: int
    header_bytes: int
    data_offset: int
    node_bytes: int
    long_bytes: int

    @property
    def variables_offset(self) -> int:
        """Offset of the first variable in the file: the size of header and configuration."""
        return self.header_bytes + CONFIGURATION_BYTES

    def nodes_offset(self, variables: int) -> int:
        """Return the offset of the first node in a file with this number of variables."""
        return self.variables_offset + VARIABLE_BYTES * variables

    def file_bytes(self, nodes: int, variables: int) -> int:
        """Return the size of a file with these numbers of nodes and variables (section 10)."""
        return self.nodes_offset(variables) + self.node_bytes * nodes + len(FOOTER)

    @property
    def timer_format(self) -> str:
        """The `struct` format of the two longs of a timer (L892-893)."""
        return self.byte_order.prefix + {4: "2i", 8: "2q"}[self.long_bytes]

    def counts(self, data: bytes) -> tuple[int, int]:
        """Return `points` and `varNub` of a file that contains a whole header (L815-816)."""
        points, variables = struct.unpack_from(
            f"{self.byte_order.prefix}2I", data, self.points_offset
        )
        return points, variables


@dataclass(frozen=True, slots=True)
class _Packing:
    """Alignment options of a compiler for the node and its union."""

    name: str
    reading: str
    limit: int
    union_limit: int
    long_bytes: int


# The columns of section 10, then the packed layouts with a long of 8 bytes. The latter have the
# same sizes as those with 4 bytes and differ from them only in the timer node.
_PACKINGS = (
    _Packing("ilp32", "ilp32", _NATURAL, _NATURAL, 4),
    _Packing("packed", "packed", 1, 1, 4),
    _Packing("pack2", "pack2", 2, 2, 4),
    _Packing("lp64", "lp64", _NATURAL, _NATURAL, 8),
    _Packing("outer-packed", "mixed", 1, _NATURAL, 8),
    _Packing("packed-long8", "packed", 1, 1, 8),
    _Packing("pack2-long8", "pack2", 2, 2, 8),
)


def _aligned(offset: int, alignment: int) -> int:
    return -(-offset // alignment) * alignment


def _layout(packing: _Packing, header_limit: int, byte_order: ByteOrder) -> Layout:
    points_offset = _aligned(len(MAGIC), min(header_limit, 4))
    union_alignment = min(packing.union_limit, packing.long_bytes)
    union_bytes = _aligned(_OPERATION_BYTES, union_alignment)
    node_alignment = min(packing.limit, union_alignment)
    data_offset = _aligned(_UNION_OFFSET, node_alignment)
    proper = header_limit == packing.limit
    header_bytes = _aligned(points_offset + 8, min(header_limit, 4))
    return Layout(
        name=packing.name
        + ("" if proper else f"-header{header_bytes}")
        + ("" if byte_order is ByteOrder.LITTLE else "-big"),
        reading=packing.reading if proper else "mixed",
        byte_order=byte_order,
        points_offset=points_offset,
        header_bytes=header_bytes,
        data_offset=data_offset,
        node_bytes=_aligned(data_offset + union_bytes, node_alignment),
        long_bytes=packing.long_bytes,
    )


def _layouts() -> Iterator[Layout]:
    for proper in (True, False):
        for byte_order in ByteOrder:
            for packing in _PACKINGS:
                for header_limit in (_NATURAL, 1, 2):
                    if (header_limit == packing.limit) is proper:
                        yield _layout(packing, header_limit, byte_order)


LAYOUTS: Mapping[str, Layout] = MappingProxyType({layout.name: layout for layout in _layouts()})
"""All layouts by name, the most likely first: uniform packings before mixed ones."""

DEFAULT_LAYOUT = LAYOUTS["ilp32"]
"""Natural alignment, a long of 4 bytes, little-endian: the default of `build`."""


@lru_cache(maxsize=4)
def detect(data: bytes) -> tuple[Layout, ...]:
    """Return the layouts in which these bytes are a complete program, the most plausible first.

    A layout must satisfy the size equation and both magics (6.1/3). The layouts are sorted by the
    number of implausible values, then by their order in `LAYOUTS`. The results for the last files
    are cached, because parser and linter ask for the same file in turn.
    """
    whole = [layout for layout, end in _ends(data) if end == len(data)]
    return tuple(sorted(whole, key=lambda layout: _count_implausible_values(data, layout)))


def program_bytes(data: bytes) -> int | None:
    """Return the size of the program at the beginning of these bytes; None if there is none.

    More bytes may follow (A-6.6b-1). If layouts disagree, the longest program is chosen.
    """
    return max((end for _, end in _ends(data)), default=None)


def _ends(data: bytes) -> Iterator[tuple[Layout, int]]:
    """Yield each layout in which the data begins with a program, and the end of the program."""
    if not data.startswith(MAGIC):
        return
    for layout in LAYOUTS.values():
        if len(data) >= layout.file_bytes(0, 0):
            end = layout.file_bytes(*layout.counts(data))
            if data[end - len(FOOTER) : end] == FOOTER:
                yield layout, end


def is_implausible_coordinate(value: float) -> bool:
    """Return whether a value is unlikely to be in mm or degrees.

    Values in the wrong byte order are usually implausible.
    """
    return not (value == 0 or LEAST_COORDINATE <= abs(value) <= GREATEST_COORDINATE)


def _count_implausible_values(data: bytes, layout: Layout) -> int:
    """Count implausible values of a layout, in the configuration and the first nodes."""
    order = layout.byte_order.prefix
    points, variables = layout.counts(data)
    configuration = struct.unpack_from(f"{order}9f", data, layout.header_bytes)
    implausible = sum(map(is_implausible_coordinate, configuration))
    implausible += any(data[len(MAGIC) : layout.points_offset])
    start = layout.nodes_offset(variables)
    offsets = range(start, start + points * layout.node_bytes, layout.node_bytes)
    timer = struct.Struct(layout.timer_format)
    for offset in islice(offsets, SAMPLE_NODES):
        node_type, content = data[offset + NODE_TYPE_OFFSET], offset + layout.data_offset
        match node_type:
            case NodeType.POINT:
                point = struct.unpack_from(f"{order}4f", data, content)
                implausible += sum(map(is_implausible_coordinate, point))
            case NodeType.WAIT_TIMER:
                seconds, microseconds = timer.unpack_from(data, content)
                unused = data[content + timer.size : offset + layout.node_bytes]
                implausible += not 0 <= microseconds < SECOND_US
                implausible += not 0 <= seconds < 1 << 32
                implausible += any(unused)
            case _:
                implausible += not NodeType.POINT <= node_type <= NodeType.COMPUTE
    return implausible
