"""Model of a user program: the values of clause 6, independent of the binary layout.

An object accepts every value that fits into its field, even out of the documented range: files in
the field contain errors, which `lint` reports. A value that does not fit raises an error, so every
program can be written. The `image` of a record contains the parsed bytes. `build` overwrites only
values that differ, so that padding, unused bytes and the rest of a name are preserved. Comparisons
ignore the `image`.
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
        raise ValueError(f"{what} is {value}; its field has the range {low} to {high}")


def _check_integers(record: "NodeData", bits: int, *, signed: bool) -> None:
    for item in fields(record):
        what = f"{type(record).__name__}.{item.name}"
        _check_integer(what, getattr(record, item.name), bits, signed=signed)


def _check_singles(what: str, values: tuple[float, ...], count: int) -> None:
    if len(values) != count:
        raise ValueError(f"{what} has {len(values)} values; its field has {count}")
    try:
        struct.pack(f"<{count}f", *values)
    except OverflowError:
        raise ValueError(f"{what} is {values}: too large for single precision") from None


def _check_name(what: str, name: bytes, size: int) -> None:
    if len(name) > size:
        raise ValueError(f"{what} has {len(name)} bytes; its field has {size}")
    if b"\0" in name:
        raise ValueError(f"{what} contains a NUL, which would end the name")


@dataclass(frozen=True, slots=True)
class Point:
    """A taught position (type 1, L926).

    Attributes:
        values: Four single-precision numbers: the joints 1, 2, 4 in degrees with the vertical
            axis third, or x, y, z in mm and thetaX in degrees (A-6.5-2).

    Raises:
        ValueError: There are not four values, or one is too large for single precision.
    """

    values: tuple[float, float, float, float]

    def __post_init__(self) -> None:
        _check_singles("point", self.values, 4)


@dataclass(frozen=True, slots=True)
class WaitInput:
    """Waits until an input meets a condition (type 2, L930-934).

    Attributes:
        port: Port number.
        value_hundredths: The value to compare the input with, times 100.
        condition: A `Condition` if valid.

    Raises:
        ValueError: A value is out of the range of uint32.
    """

    port: int
    value_hundredths: int
    condition: int

    def __post_init__(self) -> None:
        _check_integers(self, 32, signed=False)


@dataclass(frozen=True, slots=True)
class WaitSeconds:
    """Waits for a number of seconds (type 3, L928).

    Attributes:
        duration_s: Whole seconds, 0 to 255.

    Raises:
        ValueError: A value is out of the range of uint8.
    """

    duration_s: int

    def __post_init__(self) -> None:
        _check_integers(self, 8, signed=False)


@dataclass(frozen=True, slots=True)
class SetOutput:
    """Sets an output (type 4, L936).

    Attributes:
        type: `PortType.PWM_OUTPUT` or `PortType.DIGITAL_OUTPUT` (TTL) if valid.
        port: Port number.
        value: 0 or 1 for TTL, the duty cycle for PWM (its unit is open, A-6.5-12).
        time_base: PWM time base (its unit is open, A-6.5-12).

    Raises:
        ValueError: A value is out of the range of uint32.
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
        seconds: Seconds since 1970-01-01; more than 32 bits only if a long has 8 bytes.
        microseconds: The microseconds of the instant.

    Raises:
        ValueError: A value is out of the range of int64.
    """

    seconds: int
    microseconds: int = 0

    def __post_init__(self) -> None:
        _check_integers(self, 64, signed=True)


@dataclass(frozen=True, slots=True)
class Operation:
    """A comparison, a calculation, an assignment or a port setting (types 10 and 13, 6.6a).

    Attributes:
        result_type: A `ResultType` if valid.
        result: 0 for a comparison, else the key of a variable or the number of an output port.
        value_a_type: A `ValueType` if valid.
        value_a: The number, the key of a variable or the number of an input port.
        value_b_type: Like `value_a_type`.
        value_b: Like `value_a`.
        opt: An `Opt`, or 0 without an operation (A-6.6a-2).

    Raises:
        ValueError: A value is out of the range of int32.
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
"""The class of `Node.data` by node type; other types have no data (A-6.5-14)."""


@dataclass(frozen=True, slots=True)
class Node:
    """One step of a program (6.5, L879-897).

    Attributes:
        alias: The name given by the user, at most 30 bytes, without NUL.
        type: A `NodeType` if valid.
        speed_rate: Percent of the maximum speed, for moves (A-6.5-3).
        counts: For moves and loops, how many of the next nodes belong to it (A-6.5-4).
        data: The data of its type according to `DATA_OF_TYPE`; None for a type without data.
        image: The parsed record; empty if it was not parsed.

    Raises:
        ValueError: A value does not fit into its field, or the data has the wrong type.
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
        expected = DATA_OF_TYPE.get(self.type)
        if (None if self.data is None else type(self.data)) is not expected:
            needed = "no data" if expected is None else expected.__name__
            raise ValueError(f"a node of type {self.type} needs {needed}, not {self.data}")


@dataclass(frozen=True, slots=True)
class Variable:
    """A user variable (6.4, L861-872).

    Attributes:
        key: The number by which nodes refer to the variable; unique in a valid file.
        name: The name given by the user, at most 20 bytes, without NUL.
        value: The value at program start (A-6.4-3).
        image: The parsed record; empty if it was not parsed.

    Raises:
        ValueError: A value does not fit into its field.
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
        tool_center: x, y, z of the working end of the tool, in mm (L848).
        ports: The 40 port types, each a `PortType` if valid; port n is ``ports[n - 1]``
            (A-6.3-2).
        variables: The user variables, in file order.
        nodes: Every node record, in file order (A-6.2-2).
        image: The parsed header and configuration; empty if the program was not parsed.

    Raises:
        ValueError: A value does not fit into its field.
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
            raise ValueError(f"ports has {len(self.ports)} values; its field has {PORTS}")
        for number, port_type in enumerate(self.ports, start=1):
            _check_integer(f"the type of port {number}", port_type, 8, signed=False)
