"""A user program as values: what clause 6 says a file holds, and nothing of how bytes hold it.

Whatever fits a field of the file can be held, in its documented range or not: files in the field
are wrong, and `lint` says so. What fits no field cannot be constructed, so every program can be
written. The `image` of a record is the bytes it was read from; `build` writes only what differs,
so that padding, unused bytes and the rest of a name survive. It takes no part in comparisons.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

from scaraspec.protocol.program_files.tables import NodeType, PortType, ValueType

ALIAS_BYTES = 30  # L880
VARIABLE_NAME_BYTES = 20  # L863
PORTS = 40  # L839
SECOND_US = 1_000_000


def _check_integer(what: str, value: int, bits: int, *, signed: bool) -> None:
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if not low <= value <= high:
        raise ValueError(f"{what} is {value}, but its field holds {low} to {high}")


def _check_integers(record: "NodeData", bits: int, *, signed: bool) -> None:
    for item in fields(record):
        what = f"{type(record).__name__}.{item.name}"
        _check_integer(what, getattr(record, item.name), bits, signed=signed)


def _check_singles(what: str, values: tuple[float, ...], count: int) -> None:
    if len(values) != count:
        raise ValueError(f"{what} has {len(values)} values, but its field holds {count}")
    try:
        struct.pack(f"<{count}f", *values)
    except OverflowError:
        raise ValueError(f"{what} is {values}: too large for single precision") from None


def _check_name(what: str, name: bytes, size: int) -> None:
    if len(name) > size:
        raise ValueError(f"{what} has {len(name)} bytes, but its field holds {size}")
    if b"\0" in name:
        raise ValueError(f"{what} contains a NUL, which ends a name in its field")


@dataclass(frozen=True, slots=True)
class Point:
    """A taught position (type 1, L926).

    Attributes:
        values: Four single-precision numbers: the joints 1, 2, 4 in degrees with the vertical
            axis third, or x, y, z in mm and thetaX in degrees (A-6.5-2).

    Raises:
        ValueError: Not four values, or one too large for single precision.
    """

    values: tuple[float, float, float, float]

    def __post_init__(self) -> None:
        _check_singles("point", self.values, 4)


@dataclass(frozen=True, slots=True)
class WaitInput:
    """Holds the program until an input meets a condition (type 2, L930-934).

    Attributes:
        port: Port number.
        value_hundredths: What the input is compared with, times 100.
        condition: A `Condition`, where valid.

    Raises:
        ValueError: A value that is no uint32.
    """

    port: int
    value_hundredths: int
    condition: int

    def __post_init__(self) -> None:
        _check_integers(self, 32, signed=False)


@dataclass(frozen=True, slots=True)
class WaitSeconds:
    """Delays the program (type 3, L928).

    Attributes:
        duration_s: Whole seconds, 0 to 255.

    Raises:
        ValueError: A value that is no uint8.
    """

    duration_s: int

    def __post_init__(self) -> None:
        _check_integers(self, 8, signed=False)


@dataclass(frozen=True, slots=True)
class SetOutput:
    """Sets an output (type 4, L936).

    Attributes:
        type: `PortType.PWM_OUTPUT` or `PortType.DIGITAL_OUTPUT` (TTL), where valid.
        port: Port number.
        value: 0 or 1 for TTL, the duty for PWM (its unit is open, A-6.5-12).
        time_base: PWM time base (its unit is open, A-6.5-12).

    Raises:
        ValueError: A value that is no uint32.
    """

    type: int
    port: int
    value: int
    time_base: int = 0

    def __post_init__(self) -> None:
        _check_integers(self, 32, signed=False)


@dataclass(frozen=True, slots=True)
class WaitTimer:
    """Holds the program until an instant (type 9, L938).

    Attributes:
        seconds: Seconds since 1970-01-01; beyond 32 bits only where long has 8 bytes.
        microseconds: The rest of the instant.

    Raises:
        ValueError: A value that is no int64.
    """

    seconds: int
    microseconds: int = 0

    def __post_init__(self) -> None:
        _check_integers(self, 64, signed=True)


@dataclass(frozen=True, slots=True)
class Operation:
    """A comparison, a calculation, an assignment or a port setting (types 10 and 13, 6.6a).

    Attributes:
        result_type: A `ResultType`, where valid.
        result: 0 for a comparison, else the key of a variable or the number of an output port.
        value_a_type: A `ValueType`, where valid.
        value_a: The number, the key of a variable or the number of an input port.
        value_b_type: As `value_a_type`.
        value_b: As `value_a`.
        opt: An `Opt`, or 0 where nothing is computed (A-6.6a-2).

    Raises:
        ValueError: A value that is no int32.
    """

    result_type: int
    result: int
    value_a_type: int
    value_a: int
    value_b_type: int = ValueType.NONE
    value_b: int = 0
    opt: int = 0

    def __post_init__(self) -> None:
        _check_integers(self, 32, signed=True)


NodeData = Point | WaitInput | WaitSeconds | SetOutput | WaitTimer | Operation

DATA_OF_TYPE: Mapping[int, type[NodeData]] = MappingProxyType(
    {
        NodeType.POINT: Point,
        NodeType.WAIT_INPUT: WaitInput,
        NodeType.WAIT_SECONDS: WaitSeconds,
        NodeType.SET_OUTPUT: SetOutput,
        NodeType.WAIT_TIMER: WaitTimer,
        NodeType.IF: Operation,
        NodeType.COMPUTE: Operation,
    }
)
"""The class of `Node.data` by node type; a type that is not here has no data (A-6.5-14)."""


@dataclass(frozen=True, slots=True)
class Node:
    """One step of a program (6.5, L879-897).

    Attributes:
        alias: The user's name for it, at most 30 bytes, no NUL.
        type: A `NodeType`, where valid.
        speed_rate: Percent of the maximum speed, for moves (A-6.5-3).
        counts: How many following nodes belong to it, for moves and loops (A-6.5-4).
        data: What its type needs, by `DATA_OF_TYPE`; None for a type that needs nothing.
        image: The record it was read from, empty if it was not read.

    Raises:
        ValueError: A value that fits no field, or data of another type.
    """

    alias: bytes
    type: int
    speed_rate: int = 0
    counts: int = 0
    data: NodeData | None = None
    image: bytes = field(default=b"", compare=False, repr=False)

    def __post_init__(self) -> None:
        _check_name("alias", self.alias, ALIAS_BYTES)
        _check_integer("nodeType", self.type, 8, signed=False)
        _check_integer("speedRate", self.speed_rate, 8, signed=True)
        _check_integer("counts", self.counts, 8, signed=False)
        wanted = DATA_OF_TYPE.get(self.type)
        if (None if self.data is None else type(self.data)) is not wanted:
            needed = "no data" if wanted is None else wanted.__name__
            raise ValueError(f"a node of type {self.type} needs {needed}, not {self.data}")


@dataclass(frozen=True, slots=True)
class Variable:
    """A user variable (6.4, L861-872).

    Attributes:
        key: What nodes refer to; unique in a valid file.
        name: The user's name for it, at most 20 bytes, no NUL.
        value: Its value when the program starts (A-6.4-3).
        image: The record it was read from, empty if it was not read.

    Raises:
        ValueError: A value that fits no field.
    """

    key: int
    name: bytes
    value: int = 0
    image: bytes = field(default=b"", compare=False, repr=False)

    def __post_init__(self) -> None:
        _check_integer("key", self.key, 32, signed=True)
        _check_name("variable name", self.name, VARIABLE_NAME_BYTES)
        _check_integer("value", self.value, 32, signed=True)


@dataclass(frozen=True, slots=True)
class Program:
    """A user program (clause 6). The header's counts are the lengths of `nodes` and `variables`.

    Attributes:
        tool_position: x, y, z in mm and thetaX, thetaY, thetaZ in degrees (L846).
        tool_center: x, y, z in mm of the tool's working end (L848).
        ports: The 40 port types, each a `PortType` where valid; port n is ``ports[n - 1]``
            (A-6.3-2).
        variables: The user variables, in file order.
        nodes: Every node record, in file order (A-6.2-2).
        image: The header and configuration it was read from, empty if it was not read.

    Raises:
        ValueError: A value that fits no field.
    """

    tool_position: tuple[float, float, float, float, float, float] = (0.0,) * 6
    tool_center: tuple[float, float, float] = (0.0,) * 3
    ports: tuple[int, ...] = (PortType.UNUSED,) * PORTS
    variables: tuple[Variable, ...] = ()
    nodes: tuple[Node, ...] = ()
    image: bytes = field(default=b"", compare=False, repr=False)

    def __post_init__(self) -> None:
        _check_singles("toolPos", self.tool_position, 6)
        _check_singles("tcpPos", self.tool_center, 3)
        if len(self.ports) != PORTS:
            raise ValueError(f"ports has {len(self.ports)} values, but its field holds {PORTS}")
        for number, port_type in enumerate(self.ports, start=1):
            _check_integer(f"the type of port {number}", port_type, 8, signed=False)
