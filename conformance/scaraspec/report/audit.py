"""Audit: what a judge found in a recording, as results.

A requirement that was judged has at least one case. Equal findings of one requirement become one
case with a count and the evidence of the first occurrences, so that a frequent fault is listed
once. This module makes no verdicts.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Final

from scaraspec.judge.judge import Judge, Tally
from scaraspec.judge.requirements import REQUIREMENTS, Method
from scaraspec.judge.verdicts import Conclusion, Finding, Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.readings import READINGS
from scaraspec.report.evidence import EvidenceCollector
from scaraspec.report.fingerprint import document_lines, fingerprint
from scaraspec.report.model import (
    Case,
    ReadingSeen,
    RequirementResult,
    Results,
    Role,
    Subject,
    Tool,
)
from scaraspec.report.session import SessionStats
from scaraspec.user_message import UserMessage

_MAX_SHOWN_RANGES: Final = 12
_BY_SEVERITY: Final = list(Verdict)


def from_audit(
    judge: Judge,
    stats: SessionStats,
    *,
    subject: Subject,
    claims: Mapping[str, str] | None = None,
    replay: str = "",
) -> Results:
    """Return the results of a recording that was judged completely.

    Args:
        judge: The judge, closed.
        stats: The statistics, with all items that the judge yielded.
        subject: The system under test.
        claims: The readings that the ICS of the controller claims, by key.
        replay: The command that repeats the audit.
    """
    tallies = {i: judge.tallies[i] for i in REQUIREMENTS if i in judge.tallies}
    cases = {i: tuple(_cases(i, t, stats.evidence, replay)) for i, t in tallies.items()}
    requirements = tuple(
        RequirementResult(
            r.id,
            tallies[r.id].verdict if r.id in tallies else Verdict.NONE,
            tuple(case.id for case in cases.get(r.id, ())),
        )
        for r in REQUIREMENTS.values()
        if Method.PASSIVE in r.testable or r.id in tallies
    )
    return Results(
        tool=Tool.own(),
        subject=subject,
        role=Role.CAPTURE,
        verdict=(
            Conclusion.NO_VIOLATION
            if judge.conclusion is Conclusion.CONFORMANT
            and not all(each.decided for each in requirements)
            else judge.conclusion
        ),
        counts=dict.fromkeys(Verdict, 0) | Counter(c.verdict for cs in cases.values() for c in cs),
        readings={
            "client": readings_of(judge, A2C, {}),
            "controller": readings_of(judge, C2A, claims or {}),
        },
        requirements=requirements,
        cases=tuple(case for group in cases.values() for case in group),
        session=stats.session(),
    )


def _cases(
    requirement: str, tally: Tally, collector: EvidenceCollector, replay: str
) -> Iterator[Case]:
    """Yield the cases of one requirement: its grouped findings, or one case for its passes."""
    groups: defaultdict[tuple[Verdict, object], list[Finding]] = defaultdict(list)
    for finding in tally.findings:
        groups[finding.verdict, finding.reading or finding.message].append(finding)
    if not groups:
        message = UserMessage("met {times}", times=_times(tally.counts[Verdict.PASS]))
        yield Case(requirement, (requirement,), Verdict.PASS, message=message, replay=replay)
    stored = Counter(finding.verdict for finding in tally.findings)
    worst_first = sorted(groups.values(), key=lambda g: -_BY_SEVERITY.index(g[0].verdict))
    for number, findings in enumerate(worst_first, 1):
        first = findings[0]
        incomplete = tally.counts[first.verdict] > stored[first.verdict]
        ranges = dict.fromkeys(each for finding in findings for each in finding.evidence)
        wire = tuple(collector.evidence(each) for each in islice(ranges, _MAX_SHOWN_RANGES))
        yield Case(
            id=requirement if number == 1 else f"{requirement}.{number}",
            requirements=(requirement,),
            verdict=first.verdict,
            cause=first.cause,
            message=_with_count(first.message, len(findings), incomplete=incomplete),
            expected=first.expected,
            observed=first.observed or " = ".join(first.reading or ()),
            replay=replay,
            wire=wire,
            passing=collector.passing(wire) if first.verdict is Verdict.FAIL else (),
            lines=document_lines((requirement,)),
            fingerprint=fingerprint(requirement, requirement, first.message),
        )


def _with_count(message: str, count: int, *, incomplete: bool) -> str:
    """Return a message with its count; a lower bound if not all findings were stored."""
    if incomplete:
        return UserMessage.joined(message, " (at least {times})", times=_times(count))
    return UserMessage.joined(message, " ({times})", times=_times(count)) if count > 1 else message


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def readings_of(
    judge: Judge, sender: Direction, claims: Mapping[str, str]
) -> Mapping[str, ReadingSeen]:
    """Return the observed readings of one side by key; `claims` are those of its ICS."""
    seen, mixed = judge.dialect_seen.of(sender), judge.dialect_seen.mixed(sender)
    return {
        key: ReadingSeen(
            options=seen.get(key, ()),
            default=seen.get(key) == (READINGS[key].default,),
            mixed=key in mixed,
            claimed=claims.get(key),
        )
        for key in READINGS
        if key in seen or key in claims
    }
