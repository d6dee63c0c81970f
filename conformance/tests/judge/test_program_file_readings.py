"""Which readings of a client are detected from an uploaded program."""

import pytest

from scaraspec.judge.program_file_readings import observed_file_readings
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.program_files import (
    LAYOUTS,
    Node,
    NodeType,
    Operation,
    Point,
    Program,
    WaitInput,
    WaitSeconds,
    build,
)
from scaraspec.protocol.readings import READINGS
from scaraspec.protocol.transfer import TransferState
from scaraspec.traffic.events import Transfer

LITTLE = {"endian": "little", "prog_layout": "ilp32"}


def uploaded(
    content: bytes, *, upload: bool = True, state: TransferState = TransferState.DONE
) -> Transfer:
    return Transfer(
        upload, b"a.rob", 0, state=state, content=bytearray(content), received_bytes=len(content)
    )


def seen(*nodes: Node) -> dict[str, str]:
    """The readings that a program of these nodes shows, except its layout."""
    found = {s.key: s.option for s in observed_file_readings(uploaded(build(Program(nodes=nodes))))}
    return {key: option for key, option in found.items() if LITTLE.get(key) != option}


def loop(counts: int) -> tuple[Node, ...]:
    wait = Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(1))
    return Node(b"", NodeType.LOOP, counts=counts), wait, Node(b"", NodeType.END_LOOP)


def compute(*numbers: int) -> Node:
    return Node(b"", NodeType.COMPUTE, data=Operation(*numbers))


def when(*numbers: int) -> tuple[Node, Node]:
    return Node(b"", NodeType.IF, data=Operation(*numbers)), Node(b"", NodeType.ENDIF)


@pytest.mark.parametrize("name", ["ilp32", "packed", "pack2", "lp64-big", "ilp32-header13"])
def test_the_layout_shows(name: str) -> None:
    """The size and the counts permit only one layout."""
    layout = LAYOUTS[name]
    content = build(Program(nodes=loop(1) * 3), layout)
    found = set(observed_file_readings(uploaded(content)))
    assert (A2C, "prog_layout", layout.reading) in found
    assert (A2C, "endian", str(layout.byte_order)) in found


def test_readings_of_nodes_show() -> None:
    """A reading is detected where the file decides it, and not where all readings fit."""
    far = Node(b"", NodeType.POINT, data=Point((400.0, 0.0, 300.0, 0.0)))
    near = Node(b"", NodeType.POINT, data=Point((40.0, 0.0, 300.0, 0.0)))
    assert seen(far) == {"point_meaning": "pose"}
    assert seen(near) == {}
    assert seen(*loop(2)) == {"counts_mode": "with-end"}
    assert seen(*loop(1)) == {}
    assert seen(compute(3, 1, 1, 5)) == {"assign_opt": "zero"}
    assert seen(compute(3, 1, 1, 5, 0, 0, 1)) == {"assign_opt": "any"}
    assert seen(compute(4, 9, 1, 5, 1, 1, 1)) == {"assign_opt": "expression"}
    assert seen(compute(2, 1, 1, 5, 1, 1, 1)) == {}
    assert seen(*when(1, 1, 1, 1, 1, 1, 5)) == {"cmp_result": "polarity"}
    assert seen(*when(1, 0, 1, 1, 1, 1, 5)) == {}


def test_an_unscaled_wait_shows() -> None:
    """A digital input that is compared with a stored 1."""
    wait = Node(b"", NodeType.WAIT_INPUT, data=WaitInput(1, 1, 3))
    content = build(Program(ports=(2, *[0] * 39), nodes=(wait,)))
    assert (A2C, "wait_scale", "analog") in set(observed_file_readings(uploaded(content)))


def test_only_whole_uploads_of_programs_show_anything() -> None:
    """A download contains what another client uploaded, and an incomplete file may be anything."""
    content = build(Program(nodes=loop(1)))
    assert list(observed_file_readings(uploaded(content)))
    assert not list(observed_file_readings(uploaded(content, upload=False)))
    assert not list(observed_file_readings(uploaded(content, state=TransferState.FAILED)))
    assert not list(observed_file_readings(uploaded(content[:-1])))
    assert not list(observed_file_readings(uploaded(b"text")))
    cut = uploaded(content)
    cut.received_bytes += 1
    assert not list(observed_file_readings(cut))


def test_all_are_readings() -> None:
    """Every key and option is in the table of readings."""
    nodes = (*loop(1), compute(3, 1, 1, 5), *when(1, 1, 1, 1, 1, 1, 5))
    for observation in observed_file_readings(uploaded(build(Program(nodes=nodes)))):
        assert observation.option in {o.name for o in READINGS[observation.key].options}
