"""What is wrong with a program file, as findings with codes that stay.

The rules are elsewhere; here they are run, and what the parser rejects is added.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from scaraspec.protocol.program_files.codec import parse
from scaraspec.protocol.program_files.defects import ProgramDefect, ProgramError
from scaraspec.protocol.program_files.layout import VARIABLE_BYTES, Layout, detect
from scaraspec.protocol.program_files.model import Program
from scaraspec.protocol.program_files.rules import RULES, LintContext, Problem, Severity

MAX_FINDINGS = 1000
"""More are not listed: errors are found first, and a file so wrong needs no longer list."""

INVALID_PROGRAM_CODES = frozenset(
    {"P-key-twice", "P-curve-short", "P-curve-child", "P-loop", "P-if", "P-else"}
)
"""Codes of what makes a file that can be parsed no program all the same (6.5/28)."""

_WORST_FIRST = tuple(Severity)


@dataclass(frozen=True, slots=True)
class LintFinding:
    """One thing that is wrong or worth knowing.

    Attributes:
        code: What, for machines: ``P-curve-short``.
        severity: How much it matters.
        requirements: The requirements of the catalogue that it is about, the closest first.
        message: What, in one sentence.
        node: Number of the node, 1 for the first, as in the listing.
        variable: Number of the variable, 1 for the first.
        offset_bytes: Where in the file, if bytes were given.
    """

    code: str
    severity: Severity
    requirements: tuple[str, ...]
    message: str
    node: int | None = None
    variable: int | None = None
    offset_bytes: int | None = None

    def __str__(self) -> str:
        places = [
            f"{name} {place}"
            for name, place in (
                ("node", self.node),
                ("variable", self.variable),
                ("byte", self.offset_bytes),
            )
            if place is not None
        ]
        place = f" {', '.join(places)}:" if places else ""
        about = f" ({self.requirements[0]})" if self.requirements else ""
        return f"{self.severity.value} {self.code}{about}{place} {self.message}"


def lint(subject: Program | bytes) -> tuple[LintFinding, ...]:
    """Everything that the static rules of clause 6 have to say, by place in the file.

    Bytes are judged in the best layout that fits them. Where more bytes follow a program, that is
    a finding and the program is judged without them.
    """
    found = _lint_bytes(subject) if isinstance(subject, bytes) else _lint_program(subject, None)
    findings = list(islice(found, MAX_FINDINGS + 1))
    capped = len(findings) > MAX_FINDINGS
    findings = sorted(findings[:MAX_FINDINGS], key=_sort_key)
    if capped:
        findings.append(
            LintFinding("P-more", Severity.INFO, (), f"only {MAX_FINDINGS} findings are listed")
        )
    return tuple(findings)


def _sort_key(finding: LintFinding) -> tuple[int, int, int]:
    """By node, what is about no node first; by the order of variables; worst first."""
    return finding.node or 0, finding.variable or 0, _WORST_FIRST.index(finding.severity)


def _lint_bytes(data: bytes) -> Iterator[LintFinding]:
    try:
        program = parse(data)
    except ProgramError as error:
        defect, end = error.defect, error.offset_bytes
        severity = Severity.WARNING if defect is ProgramDefect.SURPLUS else Severity.ERROR
        yield LintFinding(
            defect.code, severity, defect.requirements, error.reason, offset_bytes=end
        )
        if defect in (ProgramDefect.SURPLUS, ProgramDefect.SECOND):
            yield from _lint_bytes(data[:end])
    else:
        yield from _lint_program(program, detect(data)[0])


def _lint_program(program: Program, layout: Layout | None) -> Iterator[LintFinding]:
    subject = LintContext(program, layout)
    for severity in _WORST_FIRST:
        for rule in RULES:
            if rule.severity is severity:
                for problem in rule.check(subject):
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
