"""Lint: check a program file against the static rules and return findings with stable codes.

The rules are in `rules`. This module runs them and adds the errors of the parser.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from scaraspec.protocol.program_files.codec import parse
from scaraspec.protocol.program_files.defects import ProgramDefect, ProgramError
from scaraspec.protocol.program_files.layout import VARIABLE_BYTES, Layout, detect
from scaraspec.protocol.program_files.model import Program
from scaraspec.protocol.program_files.rules import RULES, LintContext, Problem, Severity
from scaraspec.user_message import UserMessage

MAX_FINDINGS = 1000
"""The maximum number of findings; errors are reported first."""

INVALID_PROGRAM_CODES = frozenset(
    {"P-key-twice", "P-curve-short", "P-curve-child", "P-loop", "P-if", "P-else"}
)
"""Codes of errors for which a file is not a valid program although it can be parsed (6.5/28)."""

_WORST_FIRST = tuple(Severity)


@dataclass(frozen=True, slots=True)
class LintFinding:
    """One problem or note.

    Attributes:
        code: The code for machines, such as ``P-curve-short``.
        severity: The severity.
        requirements: The related requirements of the catalogue, the most specific first.
        message: The description, in one sentence.
        node: Number of the node, 1 for the first, as in the listing.
        variable: Number of the variable, 1 for the first.
        offset_bytes: Position in the file, if bytes were given.
    """

    code: str
    severity: Severity
    requirements: tuple[str, ...]
    message: str
    node: int | None = None
    variable: int | None = None
    offset_bytes: int | None = None

    @property
    def heading(self) -> str:
        """Severity, code, requirement and position."""
        positions = [
            f"{name} {number}"
            for name, number in (
                ("node", self.node),
                ("variable", self.variable),
                ("byte", self.offset_bytes),
            )
            if number is not None
        ]
        position = f" {', '.join(positions)}:" if positions else ""
        requirement = f" ({self.requirements[0]})" if self.requirements else ""
        return f"{self.severity.value} {self.code}{requirement}{position}"

    def __str__(self) -> str:
        """The finding in one line."""
        return f"{self.heading} {self.message}"


def lint(subject: Program | bytes) -> tuple[LintFinding, ...]:
    """Check a program against the static rules of clause 6; the findings are in file order.

    Bytes are parsed in their most plausible layout. If other bytes follow the program, this is a
    finding, and the program is checked without them.

    Args:
        subject: A program, or the content of a file; it need not be valid.
    """
    produced = _lint_bytes(subject) if isinstance(subject, bytes) else _lint_program(subject, None)
    findings = list(islice(produced, MAX_FINDINGS + 1))
    truncated = len(findings) > MAX_FINDINGS
    findings = sorted(findings[:MAX_FINDINGS], key=_sort_key)
    if truncated:
        findings.append(
            LintFinding(
                "P-more",
                Severity.INFO,
                (),
                UserMessage("only {finding_count} findings are listed", finding_count=MAX_FINDINGS),
            )
        )
    return tuple(findings)


def _sort_key(finding: LintFinding) -> tuple[int, int, int]:
    """Return the order: by node, findings without a node first; by variable; worst first."""
    return finding.node or 0, finding.variable or 0, _WORST_FIRST.index(finding.severity)


def _lint_bytes(data: bytes) -> Iterator[LintFinding]:
    try:
        program = parse(data)
    except ProgramError as error:
        defect, offset_bytes = error.defect, error.offset_bytes
        severity = Severity.WARNING if defect is ProgramDefect.SURPLUS else Severity.ERROR
        yield LintFinding(
            defect.code, severity, defect.requirements, error.reason, offset_bytes=offset_bytes
        )
        if defect in (ProgramDefect.SURPLUS, ProgramDefect.SECOND):
            yield from _lint_bytes(data[:offset_bytes])
    else:
        yield from _lint_program(program, detect(data)[0])


def _lint_program(program: Program, layout: Layout | None) -> Iterator[LintFinding]:
    context = LintContext(program, layout)
    for severity in _WORST_FIRST:
        for rule in RULES:
            if rule.severity is severity:
                for problem in rule.check(context):
                    yield LintFinding(
                        rule.code,
                        severity,
                        problem.requirements or rule.requirements,
                        problem.message,
                        node=_number(problem.node),
                        variable=_number(problem.variable),
                        offset_bytes=_offset(problem, program, layout),
                    )


def _number(index: int | None) -> int | None:
    return None if index is None else index + 1


def _offset(problem: Problem, program: Program, layout: Layout | None) -> int | None:
    if layout is None:
        return None
    if problem.node is not None:
        return layout.nodes_offset(len(program.variables)) + layout.node_bytes * problem.node
    if problem.variable is not None:
        return layout.variables_offset + VARIABLE_BYTES * problem.variable
    return None
