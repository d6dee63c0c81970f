"""Audit: what a judge found in a recording, as results.

A requirement that was judged has at least one case. Equal findings of one requirement become one
case with a count and the evidence of the first occurrences, so that a frequent fault is listed
once. This module makes no verdicts.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Final

from scaraspec.judge.judge import Judge, Tally
from scaraspec.judge.requirements import REQUIREMENTS, Method
from scaraspec.judge.verdicts import Finding, Reason, Verdict, conclude
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.readings import READINGS
from scaraspec.report.evidence import EvidenceCollector, step_of
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
from scaraspec.report.root_causes import root_causes
from scaraspec.report.session import SessionStats
from scaraspec.user_message import UserMessage

_MAX_SHOWN_RANGES: Final = 12
_BY_SEVERITY: Final = list(Verdict)
_SIDES: Final = {"client": A2C, "controller": C2A}


def from_audit(  # noqa: PLR0913 - what the results are made of
    judge: Judge,
    stats: SessionStats,
    *,
    subject: Subject,
    claims: Mapping[str, str] | None = None,
    replay: str = "",
    wrong_claims: Sequence[Case] = (),
    excluded: frozenset[str] = frozenset(),
) -> Results:
    """Return the results of a recording that was judged completely.

    Args:
        judge: The judge, closed.
        stats: The statistics, with all items that the judge yielded.
        subject: The system under test.
        claims: The readings that the ICS claims, by key: those of the client if only the client is
            judged, else those of the controller.
        replay: The command that repeats the audit.
        wrong_claims: A failure for each other claim that the recording refutes.
        excluded: The requirements of commands that the subject does not support.
    """
    scope = judge.scope
    tallies = {i: judge.tallies[i] for i in REQUIREMENTS if i in judge.tallies}
    cases = {
        i: tuple(_cases(i, tallies[i], stats.evidence, replay))
        if i in tallies
        else (_undecidable(i, replay),)
        for i in REQUIREMENTS
        if i in tallies or (i in scope.undecidable and scope.binds(i))
    }
    requirements = tuple(
        RequirementResult(
            r.id,
            tallies[r.id].verdict if r.id in tallies else Verdict.NONE,
            tuple(case.id for case in cases.get(r.id, ())),
        )
        for r in REQUIREMENTS.values()
        if r.id in tallies
        or (Method.PASSIVE in r.testable and scope.binds(r.id) and r.id not in excluded)
    )
    made = (*(case for group in cases.values() for case in group), *wrong_claims)
    claiming = A2C if scope.side is A2C else C2A
    return Results(
        tool=Tool.own(),
        subject=subject,
        role=Role.CAPTURE,
        verdict=conclude(
            Counter(each.verdict for each in made),
            complete=all(each.decided for each in requirements),
        ),
        counts=dict.fromkeys(Verdict, 0) | Counter(each.verdict for each in made),
        readings={
            name: readings_of(judge, side, (claims or {}) if side is claiming else {})
            for name, side in _SIDES.items()
            if scope.side in (None, side)
        },
        requirements=requirements,
        cases=made,
        session=stats.session(),
        causes=root_causes(made, Role.CAPTURE),
    )


def _undecidable(requirement: str, replay: str) -> Case:
    return Case(
        requirement,
        (requirement,),
        Verdict.NONE,
        message="the claims of the ICS, or masked passwords, make it undecidable in a capture",
        replay=replay,
        reason=Reason.UNDECIDED,
        lines=document_lines((requirement,)),
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
            title=REQUIREMENTS[requirement].sentence,
            step=step_of(wire, first.observed) if first.verdict is Verdict.FAIL else None,
            side=first.side,
            moment=collector.evidence(first.evidence[-1]) if first.evidence else None,
        )


def _with_count(message: str, count: int, *, incomplete: bool) -> str:
    """Return a message with its count; a lower bound if not all findings were stored."""
    if incomplete:
        return UserMessage.joined(message, " (at least {times})", times=_times(count))
    return UserMessage.joined(message, " ({times})", times=_times(count)) if count > 1 else message


def _times(count: int) -> str:
    return UserMessage("once") if count == 1 else UserMessage("{count} times", count=count)


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
