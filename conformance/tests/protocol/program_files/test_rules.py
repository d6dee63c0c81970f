"""Every static rule finds its violations, and nothing else."""

import re
from typing import Any

import pytest

from scaraspec.protocol.program_files import (
    INVALID_PROGRAM_CODES,
    LAYOUTS,
    RULES,
    LintRule,
    Node,
    NodeData,
    NodeType,
    Operation,
    Point,
    PortType,
    Program,
    ProgramDefect,
    SetOutput,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
    build,
    lint,
)
from scaraspec.protocol.program_files.model import DATA_OF_TYPE

# Port 1 is a digital input, 2 an analog one, 9 a digital output and 10 a PWM output.
PORTS = (PortType.DIGITAL_INPUT, PortType.ANALOG_INPUT, 0, 0, 0, 0, 0, 0, 4, 3, *[0] * 30)
VARIABLES = (Variable(1, b"a", 0), Variable(2, b"b", 1))
# Uses both variables, so that none is reported as unused.
USE = Operation(2, 1, 2, 1, 2, 2, 1)


def of(*items: Node | NodeData, **configuration: Any) -> Program:
    """Return a program of these nodes; node data is wrapped in a node of its type."""
    nodes = tuple(item if isinstance(item, Node) else node(item) for item in (*items, USE))
    return Program(**{"ports": PORTS, "variables": VARIABLES, "nodes": nodes, **configuration})


def node(data: NodeData) -> Node:
    types = {kind: node_type for node_type, kind in DATA_OF_TYPE.items()}  # COMPUTE, not IF
    return Node(b"", types[type(data)], data=data)


def move(counts: int, speed: int = 50) -> Node:
    return Node(b"", NodeType.STRAIGHT_MOVE, speed, counts)


def curve(counts: int) -> Node:
    return Node(b"", NodeType.CURVE_MOVE, 50, counts)


def loop(counts: int) -> Node:
    return Node(b"", NodeType.LOOP, counts=counts)


def when(operation: Operation) -> Node:
    return Node(b"", NodeType.IF, data=operation)


P = Point((10.0, 20.0, 300.0, 0.0))
WAIT = WaitSeconds(1)
END_LOOP, ELSE, ENDIF = (
    Node(b"", kind) for kind in (NodeType.END_LOOP, NodeType.ELSE, NodeType.ENDIF)
)
IF = when(Operation(1, 0, 2, 1, 1, 0, 5))
GOOD = of(move(1), P, WAIT)
NAN, INFINITY = float("nan"), float("inf")

# Code of the rule: programs that violate it, and similar programs that do not.
CASES: dict[str, tuple[list[Program | bytes], list[Program | bytes]]] = {
    "P-start": ([b"", b"SCARB" + build(GOOD)[5:]], [build(GOOD)]),
    "P-long": ([b"SCARA" + bytes(4 << 20)], [build(GOOD)]),
    "P-short": ([build(GOOD)[:90]], [build(Program(), LAYOUTS["packed"])]),
    "P-end": ([build(GOOD)[:-1], build(GOOD)[:-1] + b"T"], [build(GOOD)]),
    "P-nodes": ([build(GOOD)[:-69] + b"ARACS"], [build(GOOD)]),
    "P-variables": ([build(GOOD)[:92] + build(GOOD)[120:]], [build(GOOD)]),
    "P-size": ([build(GOOD)[:-10] + b"ARACS"], [build(GOOD)]),
    "P-surplus": ([build(GOOD) + b"\0"], [build(GOOD), build(GOOD) * 2]),
    "P-second-program": ([build(GOOD) * 2], [build(GOOD), build(GOOD) + b"SCAR"]),
    "P-byte-order": (
        [
            of(WaitInput(1, 0, 3 << 24)),
            of(SetOutput(4 << 24, 9, 1)),
            of(Operation(3 << 24, 1, 1, 5)),
        ],
        [of(WaitInput(1, 0, 3)), of(WaitInput(1, 0, 6 << 24)), of(Operation(-1, 1, 1, 5))],
    ),
    "P-layout-mixed": (
        [build(GOOD, LAYOUTS["ilp32-header13"]), build(GOOD, LAYOUTS["outer-packed"])],
        [build(GOOD, LAYOUTS["packed"])],
    ),
    "P-layout": (
        [build(GOOD, LAYOUTS["packed"]), build(GOOD, LAYOUTS["ilp32-big"])],
        [build(GOOD), GOOD],
    ),
    "P-not-finite": (
        [
            of(tool_position=(0, 0, 0, 0, 0, NAN)),
            of(tool_center=(INFINITY, 0, 0)),
            of(move(1), Point((0.0, 0.0, -INFINITY, 0.0))),
        ],
        [GOOD],
    ),
    "P-port-type": ([of(ports=(*PORTS[:39], 5))], [of(ports=(*PORTS[:39], 4))]),
    "P-tool-position": (
        [of(tool_position=(1e7, 0, 0, 0, 0, 0)), of(tool_position=(0, 0, 1e-40, 0, 0, 0))],
        [of(tool_position=(200, 300, 324, 34.6, 34.5, 0)), of(tool_position=(NAN,) * 6)],
    ),
    "P-tool-center": ([of(tool_center=(0, 0, -1e30))], [of(tool_center=(0, 12.5, -80))]),
    "P-key-twice": (
        [of(variables=(*VARIABLES, Variable(2, b"c")))],
        [of(variables=(*VARIABLES, Variable(-2, b"b")))],
    ),
    "P-variable-unused": (
        [of(variables=(*VARIABLES, Variable(3, b"c")))],
        [
            GOOD,
            *(
                of(operation, variables=(*VARIABLES, Variable(3, b"c")))
                for operation in (
                    Operation(3, 3, 1, 0),
                    Operation(3, 1, 2, 3),
                    Operation(2, 1, 1, 0, 2, 3, 1),
                )
            ),
        ],
    ),
    "P-name-full": (
        [of(variables=(Variable(1, b"x" * 20), Variable(2, b"")))],
        [of(variables=(Variable(1, b"x" * 19), Variable(2, b"")))],
    ),
    "P-alias-full": ([of(Node(b"x" * 30, 12))], [of(Node(b"x" * 29, 12))]),
    "P-node-type": ([of(Node(b"", 0)), of(Node(b"", 14))], [of(Node(b"", 12)), GOOD]),
    "P-wait-condition": (
        [of(WaitInput(1, 100, condition)) for condition in (0, 6, 9, 10)],
        [of(WaitInput(1, 100, condition)) for condition in (1, 2, 3, 4, 5)],
    ),
    "P-output-type": (
        [of(SetOutput(output, 9, 1)) for output in (0, 2, 5)],
        [of(SetOutput(4, 9, 1)), of(SetOutput(3, 10, 50, 20))],
    ),
    "P-timer-microseconds": (
        [of(WaitTimer(1419258600, -1)), of(WaitTimer(1419258600, 1_000_000))],
        [of(WaitTimer(1419258600, 0)), of(WaitTimer(1419258600, 999_999))],
    ),
    "P-wait-never": (
        [of(WaitInput(1, 100, 1)), of(WaitInput(1, 0, 2)), of(WaitInput(1, 250, 3))],
        [
            of(WaitInput(1, 0, 1)),
            of(WaitInput(1, 100, 2)),
            of(WaitInput(1, 1, 2)),
            of(WaitInput(1, 1, 3)),
            of(WaitInput(1, 100, 3)),
            of(WaitInput(1, 250, 4)),
            of(WaitInput(1, 100, 5)),
            of(WaitInput(2, 0, 2)),
            of(WaitInput(1, 250, 8)),
        ],
    ),
    "P-wait-value": (
        [of(WaitInput(1, 50, 5)), of(WaitInput(1, 10000, 3))],
        [*(of(WaitInput(1, value, 3)) for value in (0, 1, 100)), of(WaitInput(2, 50, 5))],
    ),
    "P-output-value": (
        [of(SetOutput(4, 9, 2))],
        [of(SetOutput(4, 9, 0)), of(SetOutput(4, 9, 1)), of(SetOutput(3, 10, 2, 20))],
    ),
    "P-timer-past": (
        [of(WaitTimer(10**9 - 1)), of(WaitTimer(-1))],
        [of(WaitTimer(10**9)), of(WaitTimer(1419258600))],
    ),
    "P-point-pose": (
        [of(move(1), Point((10.0, 361.0, 300.0, 0.0)))],
        [of(move(1), Point((-360.0, 360.0, 300.0, 0.0)))],
    ),
    "P-wait-zero": ([of(WaitSeconds(0))], [of(WaitSeconds(1))]),
    "P-wait-unscaled": (
        [of(WaitInput(1, 1, 3))],
        [of(WaitInput(1, 100, 3)), of(WaitInput(2, 1, 3))],
    ),
    "P-pwm-value": (
        [of(SetOutput(3, 10, 101, 20)), of(SetOutput(3, 10, 100, 0))],
        [of(SetOutput(3, 10, 100, 20)), of(SetOutput(4, 9, 1, 0))],
    ),
    "P-timer-2038": ([of(WaitTimer(2**31))], [of(WaitTimer(2**31 - 1))]),
    "P-speed": (
        [of(move(1, speed), P) for speed in (-1, 0, 101)],
        [of(move(1, 1), P), of(move(1, 100), P), of(loop(0), END_LOOP)],
    ),
    "P-counts-past-end": (
        [of(move(3), P), of(curve(5), P, P, P), of(loop(9), END_LOOP)],
        [of(move(2), P), of(loop(2), END_LOOP), of(Node(b"", 12, counts=9))],
    ),
    "P-curve-short": (
        [
            of(curve(0)),
            of(curve(2), P, P),
            Program(nodes=(node(WAIT), curve(3), node(P), node(P))),
        ],
        [of(curve(3), P, P, P), Program(nodes=(curve(3), *[node(P)] * 3)), of(move(2), P, P)],
    ),
    "P-curve-child": (
        [of(curve(4), P, P, P, WAIT), of(curve(3), P, move(1), P), of(curve(3), WAIT, P, P)],
        [of(curve(3), P, P, P, WAIT)],
    ),
    "P-loop": (
        [of(loop(1)), of(END_LOOP), of(loop(1), IF, END_LOOP, END_LOOP)],
        [of(loop(0), END_LOOP)],
    ),
    "P-if": ([of(IF), of(ENDIF), of(IF, ELSE)], [of(IF, ENDIF), of(IF, ELSE, ENDIF)]),
    "P-else": (
        [of(ELSE), of(IF, ELSE, ELSE, ENDIF), of(IF, loop(1), ELSE, END_LOOP, ENDIF)],
        [of(IF, ELSE, IF, ELSE, ENDIF, ENDIF)],
    ),
    "P-loop-counts": (
        [
            of(loop(3), WAIT, END_LOOP),
            # Each count is right in another reading.
            of(loop(1), WAIT, END_LOOP, loop(2), WAIT, END_LOOP),
        ],
        [
            of(loop(1), WAIT, END_LOOP),
            of(loop(2), WAIT, END_LOOP),
            of(loop(3), loop(1), WAIT, END_LOOP, END_LOOP),
            of(loop(1), loop(1), WAIT, END_LOOP, END_LOOP),
        ],
    ),
    "P-move-empty": ([of(move(0))], [of(move(1), P), of(curve(0))]),
    "P-move-child": ([of(move(2), P, WAIT)], [of(move(1), P, WAIT)]),
    "P-point-bare": ([of(P), of(move(1), P, P)], [of(move(2), P, P)]),
    "P-endless-loop": ([of(loop(0), END_LOOP)], [GOOD, of(loop(0))]),
    "P-loop-reading": (
        [
            of(loop(2), WAIT, END_LOOP),
            of(loop(1), loop(1), WAIT, END_LOOP, END_LOOP),
            of(loop(9), WAIT, END_LOOP, loop(2), WAIT, END_LOOP),
        ],
        [of(loop(1), WAIT, END_LOOP), of(loop(5), WAIT, END_LOOP), GOOD],
    ),
    "P-counts-ignored": (
        [of(Node(b"", 12, counts=1))],
        [of(move(1), P), of(loop(1), WAIT, Node(b"", 8, counts=1))],
    ),
    "P-port-number": (
        [
            of(WaitInput(41, 100, 3)),
            of(SetOutput(4, 41, 1)),
            of(Operation(4, -1, 1, 1)),
            of(Operation(3, 1, 3, 41)),
            of(Operation(2, 1, 1, 1, 3, 41, 1)),
        ],
        [of(WaitInput(40, 100, 3)), of(WaitInput(0, 100, 3)), of(Operation(3, 1, 1, 41))],
    ),
    "P-port-zero": (
        [of(WaitInput(0, 100, 3)), of(Operation(4, 0, 1, 1))],
        [of(WaitInput(1, 100, 3)), of(Operation(4, 9, 1, 0))],
    ),
    "P-port-config": (
        [
            of(WaitInput(9, 100, 3)),
            of(WaitInput(3, 100, 3)),
            of(SetOutput(4, 10, 1)),
            of(SetOutput(3, 9, 1, 20)),
            of(SetOutput(7, 1, 1)),
            of(Operation(4, 1, 1, 1)),
            of(Operation(3, 1, 3, 9)),
        ],
        [
            of(WaitInput(1, 100, 3)),
            of(WaitInput(2, 100, 3)),
            of(WaitInput(41, 100, 3)),
            of(SetOutput(4, 9, 1)),
            of(SetOutput(3, 10, 1, 20)),
            of(SetOutput(7, 9, 1)),
            of(Operation(4, 9, 3, 1)),
            of(Operation(4, 10, 3, 2)),
        ],
    ),
    "P-result-type": (
        [of(Operation(0, 1, 1, 1)), of(Operation(5, 1, 1, 1))],
        [of(Operation(3, 1, 1, 1)), of(Operation(4, 9, 1, 1))],
    ),
    "P-if-result": (
        [of(when(Operation(3, 1, 1, 1)), ENDIF)],
        [of(IF, ENDIF), of(when(Operation(9, 1, 1, 1)), ENDIF), of(Operation(3, 1, 1, 1))],
    ),
    "P-result-key": (
        [of(Operation(2, 3, 1, 1, 1, 1, 1)), of(Operation(3, 3, 1, 1))],
        [of(Operation(3, 2, 1, 1)), of(Operation(4, 9, 1, 1)), of(IF, ENDIF)],
    ),
    "P-value-type": (
        [of(Operation(3, 1, 4, 1)), of(Operation(2, 1, 1, 1, -1, 1, 1))],
        [of(Operation(3, 1, 3, 1)), of(Operation(3, 1, 0, 1))],
    ),
    "P-value-missing": (
        [
            of(Operation(3, 1, 0, 1)),
            of(Operation(2, 1, 1, 1, 0, 0, 1)),
            of(when(Operation(1, 0, 1, 1, 0, 0, 5))),
        ],
        [of(Operation(3, 1, 1, 1)), of(Operation(2, 1, 1, 1, 1, 0, 1))],
    ),
    "P-value-key": (
        [of(Operation(3, 1, 2, 3)), of(Operation(2, 1, 1, 1, 2, 0, 1))],
        [of(Operation(3, 1, 2, 2)), of(Operation(3, 1, 1, 3))],
    ),
    "P-opt": (
        [
            of(Operation(2, 1, 1, 1, 1, 1, 0)),
            of(Operation(2, 1, 1, 1, 1, 1, 10)),
            of(Operation(3, 1, 1, 1, 0, 0, -1)),
        ],
        [of(Operation(2, 1, 1, 1, 1, 1, 4)), of(Operation(3, 1, 1, 1)), of(Operation(9, 1, 1, 1))],
    ),
    "P-opt-result": (
        [of(when(Operation(1, 0, 1, 1, 1, 1, 4)), ENDIF), of(Operation(2, 1, 1, 1, 1, 1, 5))],
        [
            of(when(Operation(1, 0, 1, 1, 1, 1, 5)), ENDIF),
            of(Operation(2, 1, 1, 1, 1, 1, 4)),
            of(Operation(2, 1, 1, 1, 1, 1, 0)),
        ],
    ),
    "P-comparison-lost": (
        [of(Operation(1, 0, 1, 1, 1, 1, 5))],
        [of(IF, ENDIF), of(Operation(3, 1, 1, 1))],
    ),
    "P-comparison-result": (
        [of(when(Operation(1, 1, 1, 1, 1, 1, 5)), ENDIF)],
        [of(when(Operation(1, 0, 1, 1, 1, 1, 5)), ENDIF), of(Operation(3, 1, 1, 1))],
    ),
    "P-assign-value": (
        [of(Operation(3, 1, 1, 1, 1, 1, 1)), of(Operation(4, 9, 1, 1, 1, 1, 0))],
        [of(Operation(3, 1, 1, 1, 0, 0, 1)), of(Operation(2, 1, 1, 1, 1, 1, 1))],
    ),
    "P-division-by-zero": (
        [of(Operation(2, 1, 1, 1, 1, 0, 4))],
        [
            of(Operation(2, 1, 1, 0, 1, 1, 4)),
            of(Operation(2, 1, 1, 1, 1, 0, 3)),
            of(Operation(2, 1, 1, 1, 2, 2, 4)),
        ],
    ),
}

# Every requirement of the catalogue that is a static check of a program file (test method STATIC).
STATIC = {
    *("6.1/1", "6.1/2", "6.1/3", "6.1/4", "6.2/1", "6.2/2", "6.2/3"),
    *("6.3/1", "6.3/2", "6.3/3", "6.3/4", "6.4/1", "6.4/2", "6.4/3", "6.4/4"),
    *(f"6.5/{number}" for number in range(1, 19)),
    *(f"6.6a/{number}" for number in range(1, 11)),
    *("6.6b/1", "6.6b/2"),
}


def codes(subject: Program | bytes) -> set[str]:
    return {finding.code for finding in lint(subject)}


def _cases(which: int) -> list[object]:
    return [
        pytest.param(code, program, id=f"{code}-{number}")
        for code, examples in CASES.items()
        for number, program in enumerate(examples[which], start=1)
    ]


@pytest.mark.parametrize(("code", "program"), _cases(0))
def test_a_rule_finds_violations(code: str, program: Program | bytes) -> None:
    """Each violation of a rule is found."""
    assert code in codes(program)


@pytest.mark.parametrize(("code", "program"), _cases(1))
def test_a_rule_has_no_false_findings(code: str, program: Program | bytes) -> None:
    """Similar programs without the violation give no finding."""
    assert code not in codes(program)


def test_a_good_program_has_no_findings() -> None:
    """A correct program gives no findings."""
    assert lint(GOOD) == lint(build(GOOD)) == ()


def test_every_rule_has_its_cases() -> None:
    """Every code has examples of both kinds, and no code occurs twice."""
    every = [rule.code for rule in RULES] + [fault.code for fault in ProgramDefect]
    assert sorted(every) == sorted(CASES)
    assert all(broken and kept for broken, kept in CASES.values())
    assert set(every) >= INVALID_PROGRAM_CODES


def test_every_static_requirement_has_a_finding() -> None:
    """For each of the 45 requirements, an example gives a finding that cites it."""
    found = {
        requirement
        for broken, _ in CASES.values()
        for program in broken
        for finding in lint(program)
        for requirement in finding.requirements
    }
    assert len(STATIC) == 45
    assert found == STATIC


def test_every_rule_cites_its_source() -> None:
    """The docstring of a check states the rule and cites the document or the register."""
    for rule in RULES:
        assert re.search(r"[( ](L\d{3}|A-\d)", rule.check.__doc__ or ""), rule.code
        assert set(rule.requirements) <= STATIC


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.code)
def test_findings_match_their_rule(rule: LintRule) -> None:
    """A finding has the severity of its rule and some of its requirements."""
    for program in CASES[rule.code][0]:
        for finding in lint(program):
            if finding.code == rule.code:
                assert finding.severity is rule.severity
                assert finding.requirements
                assert set(finding.requirements) <= set(rule.requirements)


@pytest.mark.parametrize(
    ("program", "message"),
    [
        (
            of(move(2), P, WAIT),
            "node 3 belongs to the straight move, but its type is 3, not 1 (a point)",
        ),
        (
            of(curve(3), P, P, WAIT),
            "node 4 belongs to the curve, but its type is 3, not 1 (a point)",
        ),
        (of(WAIT, move(4), P), "its counts = 4 reaches node 6, but the last node is 4"),
        (of(WAIT, curve(2), P, P), "a curve needs at least 3 points, but this one has 2"),
        (
            of(loop(1), WAIT, END_LOOP, loop(2), WAIT, END_LOOP),
            "the loop counts its nodes as with-end, unlike other loops of the program",
        ),
        (
            of(loop(9), WAIT, END_LOOP, loop(1), WAIT, END_LOOP),
            (
                "counts is 9, but there are 1 nodes up to the end of the loop; "
                "the end marker takes precedence"
            ),
        ),
        (of(variables=(*VARIABLES, Variable(2, b""))), "variable 2 already has the key 2"),
        (of(WaitInput(1, 250, 3)), "digital input 1 is never equal 2.5: the program waits forever"),
        (of(ports=(*PORTS[:39], 5)), "port 40 is configured as 5; port types are 0 to 4"),
    ],
)
def test_messages_contain_the_values(program: Program, message: str) -> None:
    """Messages contain the values; nodes, variables and ports are numbered from 1."""
    assert message in [finding.message for finding in lint(program)]
