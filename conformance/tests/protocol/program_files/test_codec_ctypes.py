"""The sample files compared with ctypes, which lays out the structures independently."""

import ctypes
import json
from pathlib import Path
from typing import Any

import pytest

from scaraspec.protocol.program_files import (
    LAYOUTS,
    ByteOrder,
    Layout,
    Operation,
    Point,
    SetOutput,
    WaitInput,
    WaitSeconds,
    WaitTimer,
    parse,
)

SAMPLES = Path(__file__).parents[4] / "fixtures" / "programs"
WHOLE = [
    row
    for row in json.loads((SAMPLES / "files.json").read_text())
    if not row["file"].startswith("damaged/")
]
PACKS = {"packed": (1, 1), "packed-long8": (1, 1), "pack2": (2, 2), "outer-packed": (1, 8)}
NATURAL = 8


def record(kind: type, pack: int, **fields: Any) -> Any:
    """Return a structure or union with `#pragma pack(pack)`."""
    body = {"_layout_": "ms", "_pack_": pack, "_fields_": list(fields.items())}
    return type(kind)(kind.__name__, (kind,), body)


def structures(layout: Layout, nodes: int, variables: int) -> Any:
    """Return the whole file as the structures of the document (L813-998)."""
    big = layout.byte_order is ByteOrder.BIG

    def order(kind: Any) -> Any:
        return kind.__ctype_be__ if big else kind.__ctype_le__

    outer, inner = PACKS.get(
        layout.name.partition("-header")[0].removesuffix("-big"), (NATURAL, NATURAL)
    )
    float32, int32, uint32 = map(order, (ctypes.c_float, ctypes.c_int32, ctypes.c_uint32))
    long = order({4: ctypes.c_int32, 8: ctypes.c_int64}[layout.long_bytes])
    header = record(
        ctypes.Structure,
        {13: 1, 14: 2, 16: NATURAL}[layout.header_bytes],
        robot=ctypes.c_char * 5,
        points=uint32,
        varNub=uint32,
    )
    configuration = record(
        ctypes.Structure,
        NATURAL,
        toolPos=float32 * 6,
        tcpPos=float32 * 3,
        ports=ctypes.c_uint8 * 40,
    )
    variable = record(
        ctypes.Structure, NATURAL, key=int32, variable=ctypes.c_char * 20, value=int32
    )
    operation = record(
        ctypes.Structure,
        inner,
        result_type=int32,
        result=int32,
        valueA_type=int32,
        valueA=int32,
        valueB_type=int32,
        valueB=int32,
        opt=int32,
    )
    node_data = record(
        ctypes.Union,
        inner,
        point=float32 * 4,
        waitTimes=ctypes.c_uint8,
        waitCond=uint32 * 3,
        gpioSet=uint32 * 4,
        waitTimer=record(ctypes.Structure, inner, waitTimerSecond=long, waitTimerUS=long),
        operation=operation,
    )
    node = record(
        ctypes.Structure,
        outer,
        AliasName=ctypes.c_char * 30,
        nodeType=ctypes.c_uint8,
        speedRate=ctypes.c_int8,
        counts=ctypes.c_uint8,
        nodeData=node_data,
    )
    return record(
        ctypes.Structure,
        1,
        header=header,
        configuration=configuration,
        variables=variable * variables,
        nodes=node * nodes,
        tobor=ctypes.c_char * 5,
    )


@pytest.mark.parametrize("row", WHOLE, ids=lambda row: row["file"])
def test_ctypes_reads_the_same_values(row: dict[str, Any]) -> None:
    """Every value of every file is at the position that ctypes gives its field."""
    data = (SAMPLES / row["file"]).read_bytes()
    program = parse(data)
    kind = structures(LAYOUTS[row["layout"]], len(program.nodes), len(program.variables))
    assert ctypes.sizeof(kind) == len(data)
    seen = kind.from_buffer_copy(data)
    assert (seen.header.robot, seen.tobor) == (b"SCARA", b"ARACS")
    assert seen.header.points == len(program.nodes)
    assert seen.header.varNub == len(program.variables)
    assert tuple(seen.configuration.toolPos) == program.tool_position
    assert tuple(seen.configuration.tcpPos) == program.tool_center
    assert tuple(seen.configuration.ports) == program.ports
    assert [(item.key, item.variable, item.value) for item in seen.variables] == [
        (item.key, item.name, item.value) for item in program.variables
    ]
    for item, node in zip(seen.nodes, program.nodes, strict=True):
        assert item.AliasName == node.alias
        assert (item.nodeType, item.speedRate) == (node.type, node.speed_rate)
        assert item.counts == node.counts
        assert held(item.nodeData, type(node.data)) == node.data


def held(union: Any, kind: type) -> object:
    """Return the union data of a node for this kind of data."""
    readers: dict[type, Any] = {
        Point: lambda: Point(tuple(union.point)),
        WaitInput: lambda: WaitInput(*union.waitCond),
        WaitSeconds: lambda: WaitSeconds(union.waitTimes),
        SetOutput: lambda: SetOutput(*union.gpioSet),
        WaitTimer: lambda: WaitTimer(union.waitTimer.waitTimerSecond, union.waitTimer.waitTimerUS),
        Operation: lambda: Operation(
            *(getattr(union.operation, name) for name, _ in union.operation._fields_)
        ),
    }
    return readers.get(kind, lambda: None)()
