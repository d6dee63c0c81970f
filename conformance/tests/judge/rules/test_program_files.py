"""Clause 6 in uploads: each requirement with a file that meets it and one that violates it."""

from collections.abc import Callable
from math import inf
from typing import Any

import pytest

from scaraspec.judge.requirements import REQUIREMENTS, Method
from scaraspec.protocol.program_files import (
    LAYOUTS,
    Node,
    NodeType,
    Operation,
    Point,
    Program,
    SetOutput,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
    build,
)
from scaraspec.protocol.transfer import FILE_DATA, TransferState, chunks_of

PORTS = (2, 1, 0, 0, 0, 0, 0, 0, 4, 3, *[0] * 30)  # two inputs, digital and analog, two outputs
COUNT = Node(b"", NodeType.COMPUTE, data=Operation(2, 1, 2, 1, 1, 1, 1))
POINT = Node(b"", NodeType.POINT, data=Point((10.0, 20.0, 300.0, 0.0)))


def of(*nodes: Node, ports: tuple[int, ...] = PORTS, **more: Any) -> bytes:
    """A file with these nodes and one that uses the only variable."""
    return build(
        Program(ports=ports, variables=(Variable(1, b"n"),), nodes=(*nodes, COUNT), **more)
    )


def node(kind: int, data: Any = None, *, speed: int = 0, counts: int = 0) -> Node:
    return Node(b"", kind, speed, counts, data)


def compute(*numbers: int) -> bytes:
    """A file with one more operation."""
    return of(node(NodeType.COMPUTE, Operation(*numbers)))


def wait(*numbers: int) -> bytes:
    """A file that waits for an input."""
    return of(node(NodeType.WAIT_INPUT, WaitInput(*numbers)))


def output(*numbers: int) -> bytes:
    """A file that sets an output."""
    return of(node(NodeType.SET_OUTPUT, SetOutput(*numbers)))


def timer(*numbers: int) -> bytes:
    """A file that waits for a time of day."""
    return of(node(NodeType.WAIT_TIMER, WaitTimer(*numbers)))


def move(kind: NodeType, *nodes: Node, speed: int = 50) -> bytes:
    """A file with a move through these nodes."""
    return of(node(kind, speed=speed, counts=len(nodes)), *nodes)


STRAIGHT, CURVE = NodeType.STRAIGHT_MOVE, NodeType.CURVE_MOVE
GOOD = move(STRAIGHT, POINT)
TWICE = build(Program(variables=(Variable(1, b"a"), Variable(1, b"b")), nodes=(COUNT,)))

BROKEN = (
    ("6.2/1 6.1/1", b"scara" + GOOD[5:]),
    ("6.1/2 6.1/1 6.3/1 6.3/2", GOOD[:90]),
    ("6.6b/1 6.1/1", GOOD[:-1]),
    ("6.2/2 6.1/3", GOOD[:-69] + b"ARACS"),
    ("6.2/3 6.4/1 6.1/3", GOOD[:92] + GOOD[120:]),
    ("6.1/2 6.6b/2", GOOD * 2),
    ("6.3/3", of(ports=(*PORTS[:39], 5))),
    ("6.3/4", of(tool_center=(inf, 0, 0))),
    ("6.4/2", TWICE),
    ("6.4/3 6.6a/3", compute(2, 7, 1, 1, 1, 1, 1)),
    ("6.4/3 6.6a/6", compute(2, 1, 2, 7, 1, 1, 1)),
    ("6.5/2", of(node(14))),
    ("6.5/3", move(STRAIGHT, POINT, speed=101)),
    ("6.5/5", of(node(STRAIGHT, speed=50, counts=3), POINT)),
    ("6.5/8", wait(1, 100, 6)),
    ("6.5/11", output(5, 9, 1)),
    ("6.5/12", timer(1419258600, -1)),
    ("6.5/13", of(node(NodeType.IF, Operation(3, 1, 1, 1)), node(NodeType.ENDIF))),
    ("6.5/14", move(CURVE, POINT, POINT)),
    ("6.5/15", of(node(NodeType.END_LOOP))),
    ("6.5/16", of(node(NodeType.ENDIF))),
    ("6.6a/1", compute(5, 1, 1, 1)),
    ("6.6a/4", compute(4, 41, 1, 1)),
    ("6.6a/5", compute(3, 1, 4, 1)),
    ("6.6a/7", compute(3, 1, 3, 41)),
    ("6.6a/8", compute(2, 1, 1, 1, 1, 1, 10)),
    ("6.6a/9", compute(2, 1, 1, 1, 1, 1, 5)),
)
TOLERATED = (
    ("6.1/4 A-6.1-2=P-layout", build(Program(), LAYOUTS["packed"])),
    ("6.3/1 A-6.3-3=P-tool-position", of(tool_position=(1e7, 0, 0, 0, 0, 0))),
    ("6.3/2 A-6.3-3=P-tool-center", of(tool_center=(1e30, 0, 0))),
    ("6.5/4 A-6.5-4=P-move-empty", move(STRAIGHT)),
    ("6.5/6 A-6.5-2=P-point-pose", move(STRAIGHT, node(1, Point((400.0, 0.0, 300.0, 0.0))))),
    ("6.5/10 A-6.5-10=P-wait-unscaled", wait(1, 1, 3)),
    ("6.5/17 A-6.3-2=P-port-config", output(4, 10, 1)),
    ("6.5/18 A-6.5-5=P-endless-loop", of(node(NodeType.LOOP), node(NodeType.END_LOOP))),
    ("6.6a/10 A-6.6a-4=P-division-by-zero", compute(2, 1, 1, 1, 1, 0, 4)),
    ("6.6b/2 A-6.6b-1=P-surplus", GOOD + b"\0"),
)


def upload(content: bytes) -> str:
    """A session in which a file is uploaded."""
    lines = ["login\n> upload_name a.rob\n< upload_name 1"]
    for chunk in chunks_of(content):
        data = "".join(f"\\x{octet:02x}" for octet in FILE_DATA.encode(chunk))
        lines.append(f"> upload_chunk {data}\n< upload_chunk 1")
    return "\n".join(lines)


def cases() -> list[tuple[str, str, str]]:
    """The tables above, converted to cases."""
    found = [
        (r.id, "pass", upload(GOOD))
        for r in REQUIREMENTS.values()
        if Method.STATIC in r.testable and Method.PASSIVE in r.testable
    ]
    for requirements, content in BROKEN:
        failing = requirements.split()
        for requirement in failing:
            others = " ".join(r for r in failing if r != requirement)
            found.append((requirement, f"fail {others}", upload(content)))
    for requirement_and_reading, content in TOLERATED:
        requirement, reading = requirement_and_reading.split()
        found.append((requirement, f"tolerated {reading}", upload(content)))
    return found


CASES = (
    *cases(),
    # A remark does not violate a firm requirement: a wait of 0 s.
    ("6.5/7", "pass", upload(of(node(NodeType.WAIT_SECONDS, WaitSeconds(0))))),
    # Any file may be uploaded.
    ("6.2/1", "none", upload(b"text")),
    # The nodes of a file that cannot be read are not judged.
    ("6.5/2", "none 6.6b/1 6.1/1", upload(GOOD[:-1])),
    ("6.2/1", "none", upload(GOOD).rpartition("\n> upload_chunk")[0]),
)


PASSES_ONLY = {
    "6.4/4": "a field of fixed width holds no longer name",
    "6.5/1": "a field of fixed width holds no longer alias",
    "6.5/7": "a field of fixed width holds no longer time",
}


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_program_files(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)


def test_downloaded_programs_are_not_judged(judged: Callable) -> None:
    """A downloaded program is not judged: the controller returns what a client uploaded."""
    lines = ["login\n> download_name a.rob\n< download_name 1"]
    for chunk in chunks_of(b"scara" + GOOD[5:]):
        data = "".join(f"\\x{octet:02x}" for octet in FILE_DATA.encode(chunk))
        lines.append(f"< download_chunk {data}\n> download_chunk 1")
    record = judged("\n".join(lines))
    (transfer,) = record.transfers
    assert transfer.state is TransferState.DONE
    assert not record.failed
