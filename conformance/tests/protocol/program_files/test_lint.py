"""The linter runs all rules, reports the place of each finding, and accepts any input."""

from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.program_files import (
    LAYOUTS,
    Layout,
    LintFinding,
    Node,
    NodeType,
    Program,
    Severity,
    Variable,
    WaitSeconds,
    build,
    lint,
    parse,
)
from scaraspec.protocol.program_files.lint import MAX_FINDINGS

WAIT = Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(1))
UNKNOWN = Node(b"", 77)
GOOD = Program(nodes=(WAIT,))


@given(...)
def test_lint_takes_any_program(program: Program, layout: Layout) -> None:
    """Any program can be checked; its bytes give the same findings, with offsets."""
    data = build(program, layout)
    from_bytes = [
        (finding.code, finding.node, finding.variable, finding.message)
        for finding in lint(data)
        if not finding.code.startswith("P-layout")
    ]
    # The bytes are checked in the most plausible layout, which need not be the one they were built
    # in.
    from_program = [
        (finding.code, finding.node, finding.variable, finding.message)
        for finding in lint(parse(data))
    ]
    assert from_bytes == from_program


@given(st.binary() | st.binary(max_size=60).map(lambda tail: build(GOOD) + tail))
def test_lint_takes_any_bytes(data: bytes) -> None:
    """Any bytes can be checked; bytes that are not a program give at least one finding."""
    assert lint(data) or data == build(GOOD)


def test_place_of_a_finding() -> None:
    """Numbers start at 1 as in the listing; the offset is that of the record."""
    variables = tuple(Variable(key, b"") for key in (1, 2, 2))
    program = Program(variables=variables, nodes=(WAIT, UNKNOWN))
    data = build(program, LAYOUTS["lp64"])
    twice, unknown = (f for f in lint(data) if f.severity is Severity.ERROR)
    assert (twice.variable, twice.node, twice.offset_bytes) == (3, None, 16 + 76 + 2 * 28)
    assert (unknown.variable, unknown.node) == (None, 2)
    assert unknown.offset_bytes == 16 + 76 + 3 * 28 + 72
    assert str(unknown) == (
        "error P-node-type (6.5/2) node 2, byte 248: the node type is 77; it must be 1 to 13"
    )
    assert [f.offset_bytes for f in lint(program) if f.severity is Severity.ERROR] == [None, None]


def test_bytes_after_a_program_do_not_hide_its_faults() -> None:
    """Bytes after the footer are reported, and the program before them is checked."""
    found = lint(build(Program(nodes=(UNKNOWN,))) + b"\r\n")
    assert [finding.code for finding in found] == ["P-surplus", "P-node-type"]
    assert found[0].severity is Severity.WARNING


def test_a_hostile_program_gives_a_bounded_list() -> None:
    """If the list is cut, errors are kept and a last finding reports the cut."""
    zeros = [Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(0))] * MAX_FINDINGS
    nodes = (*zeros, *[UNKNOWN] * 10)
    found = lint(Program(nodes=nodes))
    assert len(found) == MAX_FINDINGS + 1
    assert found[-1] == LintFinding("P-more", Severity.INFO, (), "only 1000 findings are listed")
    assert sum(finding.severity is Severity.ERROR for finding in found) == 10


def test_time_is_linear_for_a_huge_hostile_program() -> None:
    """The time is linear for overlapping counts, deeply nested markers and many variables."""
    chain = tuple(Node(b"", NodeType.CURVE_MOVE, 50, 255) for _ in range(10_000))
    variables = tuple(Variable(key % 7, b"x") for key in range(10_000))
    assert len(lint(Program(nodes=chain, variables=variables))) == MAX_FINDINGS + 1
