"""Clause 6.5: files that clause 6 does not allow never run with success (L822, L868, L942, L998).

How they are refused is open (A-4.15-2). If a robot runs them, the effect is small: they set an
output to its current value, or move to the current pose.
"""

from collections.abc import Iterator, Sequence
from typing import Final

from hypothesis import strategies as st

from scaraspec.protocol.program_files import Layout, Node, NodeType, Opt, Variable, detect
from scaraspec.protocol.program_files.layout import FOOTER, MAGIC
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.two_stage.arm import arm
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect
from scaraspec.suite.program_files.bench import PROGRAMS, Bench, bench
from scaraspec.suite.program_files.layout import CODE_20
from scaraspec.suite.program_files.writing import OUTPUTS, compare, curve, number, set_output, wait
from scaraspec.user_message import UserMessage

_OBSERVATION_S: Final = 1.0
"""How long an accepted damaged file may run without a final result."""

_MANY_NODES: Final = 60
"""Number of nodes that does not fit a buffer of 512 bytes."""

_LOOP, _END_LOOP = Node(b"", NodeType.LOOP, counts=1), Node(b"", NodeType.END_LOOP)
_IF = Node(b"", NodeType.IF, data=compare(number(1), Opt.EQUAL, number(1)))
_ELSE, _ENDIF = Node(b"", NodeType.ELSE), Node(b"", NodeType.ENDIF)


def _node_without_effect(robot: Bench) -> Node:
    """Return a node that changes nothing."""
    port = OUTPUTS[0]
    return set_output(port, on=robot.before[port - 1])


def _expect_not_run(
    subject: ControllerUnderTest, robot: Bench, content: bytes, description: str
) -> None:
    """Request the run of a damaged file, and expect that its result is not 11."""
    with subject.observer.ignoring(CODE_20):
        if not robot.accepts(content):
            return
    result = robot.ended(within_s=robot.ours_s(_OBSERVATION_S))
    expect(
        result is None or not result.done,
        UserMessage("{description} is reported as run", description=description),
        expected="a refusal or a failure",
        observed=f"{result}",
    )
    robot.stop()


def _run_valid_file(
    robot: Bench, nodes: Sequence[Node], variables: Sequence[Variable] = ()
) -> bytes:
    """Return a valid file, after a run: otherwise a refusal of other files would prove nothing."""
    robot.run(nodes, variables)
    return robot.file(nodes, variables)


@case("6.5/28", name="marks", hazards=PROGRAMS)
def test_wrong_marks(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file that does not begin with SCARA, or does not end with ARACS, is not run."""
    with bench(subject, line) as robot:
        valid = _run_valid_file(robot, [_node_without_effect(robot)])
        for marker in examples((b"scara", FOOTER, b"ACARS", b"SCAR\0", b"\0CARA")):
            content = marker + valid[len(MAGIC) :]
            description = UserMessage("a file that begins with {marker!r}", marker=marker.decode())
            _expect_not_run(subject, robot, content, description)
        for marker in examples((b"aracs", MAGIC, b"ACARS", b"ARAC\0", b"\0RACS")):
            content = valid[: -len(FOOTER)] + marker
            description = UserMessage("a file that ends with {marker!r}", marker=marker.decode())
            _expect_not_run(subject, robot, content, description)
        long_file = _run_valid_file(robot, [_node_without_effect(robot)] * _MANY_NODES)
        content = long_file[: -len(FOOTER)] + FOOTER.lower()
        _expect_not_run(subject, robot, content, "a long file that ends with another marker")


@case("6.5/28", name="letters", hazards=PROGRAMS)
def test_one_wrong_letter(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file with one wrong bit in a marker is not run."""
    with bench(subject, line) as robot:
        valid = _run_valid_file(robot, [_node_without_effect(robot)])
        positions = [*range(len(MAGIC)), *range(len(valid) - len(FOOTER), len(valid))]

        @given(st.sampled_from(positions), st.integers(0, 7))
        def flip_and_check(position: int, bit: int) -> None:
            wrong = bytearray(valid)
            wrong[position] ^= 1 << bit
            description = UserMessage(
                "a file with a wrong bit in byte {position} of a marker", position=position
            )
            _expect_not_run(subject, robot, bytes(wrong), description)

        flip_and_check()


@case("6.5/28", name="sizes", hazards=PROGRAMS)
def test_wrong_sizes(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file whose size does not match its counts in any layout is not run."""
    with bench(subject, line) as robot:
        nodes = [_node_without_effect(robot), *wait(0)]
        valid = _run_valid_file(robot, nodes, [Variable(1, b"a", 5)])
        for description, content in examples(_files_of_wrong_size(valid, robot.layout)):
            if not detect(content):
                _expect_not_run(subject, robot, content, description)


def _files_of_wrong_size(valid: bytes, layout: Layout) -> Iterator[tuple[str, bytes]]:
    """Yield files with both markers whose size does not match their counts."""
    end = len(valid) - len(FOOTER)
    for missing_bytes in (1, 2, 7):  # one of these sizes may be valid in another layout
        description = UserMessage("a file without its last {count} bytes", count=missing_bytes)
        yield description, valid[: end - missing_bytes] + FOOTER
    yield "a file with one byte too many", valid[:end] + b"\0" + FOOTER
    yield "a file without its last node", valid[: end - layout.node_bytes] + FOOTER
    yield (
        "a file with one node too many",
        valid[:end] + valid[end - layout.node_bytes : end] + FOOTER,
    )
    yield "a file with only its header", valid[: layout.header_bytes] + FOOTER
    yield "a file with only its markers", MAGIC + FOOTER
    yield "a file without nodes", valid[: layout.nodes_offset(1)] + FOOTER
    for name, offset, count in (("points", 0, 2), ("varNub", 4, 1)):
        position = layout.points_offset + offset
        for wrong in (count + 1, count - 1, 0xFFFFFFFF):
            number_bytes = wrong.to_bytes(4, layout.byte_order.value)
            content = valid[:position] + number_bytes + valid[position + 4 :]
            description = UserMessage(
                "a file whose {field} is {wrong} and not {count}",
                field=name,
                wrong=wrong,
                count=count,
            )
            yield description, content


@case("6.5/28", name="keys", hazards=PROGRAMS)
def test_key_twice(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file in which two variables have the same key is not run."""
    with bench(subject, line) as robot:
        nodes = [_node_without_effect(robot)]
        _run_valid_file(robot, nodes, _variables_with_keys(1, 2, 3, 4))
        for keys in examples(((1, 1), (0, 0), (7, 8, 9, 7), (1, -2, -2, 3))):
            content = robot.file(nodes, _variables_with_keys(*keys))
            description = UserMessage("a file with the keys {keys}", keys=keys)
            _expect_not_run(subject, robot, content, description)


def _variables_with_keys(*keys: int) -> list[Variable]:
    return [Variable(key, f"v{position}".encode(), position) for position, key in enumerate(keys)]


@case("6.5/28", name="markers", hazards=PROGRAMS)
def test_unbalanced_markers(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file with a loop or IF marker without its counterpart is not run."""
    with bench(subject, line) as robot:
        node = _node_without_effect(robot)
        _run_valid_file(robot, [_IF, node, _ELSE, node, _ENDIF, node])
        for description, nodes in examples(
            (
                ("a loop without an end", [_LOOP, node]),
                ("the end of a loop without its start", [node, _END_LOOP]),
                ("an IF without an ENDIF", [_IF, node]),
                ("an IF and ELSE without an ENDIF", [_IF, node, _ELSE, node]),
                ("an ENDIF without an IF", [node, _ENDIF]),
                ("an ELSE without an IF", [node, _ELSE, node]),
                ("an ELSE and ENDIF without an IF", [_ELSE, node, _ENDIF]),
                ("an IF with two ELSE", [_IF, node, _ELSE, node, _ELSE, node, _ENDIF]),
                ("two IF with one ENDIF", [_IF, node, _IF, node, _ENDIF]),
                ("an IF with two ENDIF", [_IF, node, _ENDIF, _ENDIF]),
                ("a loop ended by an ENDIF", [_LOOP, node, _ENDIF]),
                ("an IF ended by the end of a loop", [_IF, node, _END_LOOP]),
                ("an IF ended inside a loop", [_IF, _LOOP, _ENDIF, node, _END_LOOP]),
            )
        ):
            _expect_not_run(subject, robot, robot.file(nodes), description)


@case("6.5/28", name="curves", hazards=PROGRAMS)
def test_wrong_curves(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A curve of fewer than three points, or with other nodes, is not run."""
    with bench(subject, line) as robot, arm(subject, line, robot) as robot_arm:
        speed, home = robot_arm.speed_percent, robot_arm.home
        move, *points = curve(speed, [home] * 3)
        for description, nodes in examples(
            (
                ("a curve without points", curve(speed, [])),
                ("a curve of one point", curve(speed, [home])),
                ("a curve of two points", curve(speed, [home] * 2)),
                ("a curve with a count of one point too many", [move, *points[:2]]),
                (
                    "a curve of two points and an output",
                    [move, *points[:2], _node_without_effect(robot)],
                ),
                ("a curve that contains a wait", [move, points[0], *wait(0), points[1]]),
                ("a curve that begins with a wait", [move, *wait(0), *points[:2]]),
                (
                    "a curve of four points that ends with a wait",
                    [*curve(speed, [home] * 4)[:-1], *wait(0)],
                ),
                (
                    "a curve of six points that ends with a wait",
                    [*curve(speed, [home] * 6)[:-1], *wait(0)],
                ),
            )
        ):
            _expect_not_run(subject, robot, robot.file(nodes), description)
