"""Passive findings: what the judge found in the traffic of a run, grouped for the results."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import Case
from scaraspec.suite.engine.observer import CaseFinding

_NUMBERED: Final = re.compile(r"\b[a-z][A-Za-z]*\d+\b")  # names of the suite's files


def grouped(
    findings: Iterable[CaseFinding], before: Iterable[Case]
) -> Iterator[tuple[int, list[CaseFinding]]]:
    """Group equal findings, and number the groups of each requirement.

    Inconclusive findings are omitted; `undecided` counts them. Names of the suite's files do not
    make a difference.

    Args:
        findings: The findings of this run.
        before: The groups of an earlier sitting; the numbers continue.
    """
    groups: defaultdict[tuple[str, Verdict, object], list[CaseFinding]] = defaultdict(list)
    for case_finding in findings:
        finding = case_finding.finding
        if finding.verdict is not Verdict.INCONCLUSIVE:
            what = finding.reading or _NUMBERED.sub("", finding.message)
            groups[finding.requirement, finding.verdict, what].append(case_finding)
    numbers = Counter(requirement for case in before for requirement in case.requirements)
    for (requirement, _, _), listed in groups.items():
        numbers[requirement] += 1
        yield numbers[requirement], listed


def undecided(findings: Iterable[CaseFinding]) -> dict[str, int]:
    """Count the inconclusive findings by requirement, in the order of the document.

    They do not count: the suite often sends on purpose what the judge cannot decide, and the case
    decides it. A requirement without other evidence is not judged.
    """
    found = (each.finding for each in findings)
    counts = Counter(f.requirement for f in found if f.verdict is Verdict.INCONCLUSIVE)
    return {key: counts[key] for key in REQUIREMENTS if key in counts}


def is_confirmed(findings: Iterable[CaseFinding]) -> bool:
    """Return whether equal findings rest on received bytes, or were found in two attempts."""
    for each in findings:
        if not each.late or not (each.attempt.repeatable or each.attempt.delayed):
            return True
    return len({id(each.attempt) for each in findings}) > 1
