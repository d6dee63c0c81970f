"""Audit: what a judge found in a recording, as results.

A requirement that was judged has at least one case. Findings of one requirement that say the same
are one case with a count, so that a fault that occurs a thousand times is read once; its evidence
is that of its first occurrences. No verdict is made here.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Final

from scaraspec.judge.judge import Judge, Tally
from scaraspec.judge.requirements import REQUIREMENTS, Method
from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.readings import READINGS
from scaraspec.report.evidence import Exhibits
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

_SHOWN_PLACES: Final = 12
_GRAVITY: Final = list(Verdict)


def from_audit(
    judge: Judge,
    stats: SessionStats,
    *,
    subject: Subject,
    claims: Mapping[str, str] | None = None,
    replay: str = "",
) -> Results:
    """Make results of a recording that has been judged to its end.

    Args:
        judge: The judge, closed.
        stats: Fed with everything that the judge yielded.
        subject: What was judged.
        claims: Readings that the controller's statement of conformance claims, by key.
        replay: The command line that judges the recording again.
    """
    tallies = {i: judge.tallies[i] for i in REQUIREMENTS if i in judge.tallies}
    cases = {i: tuple(_cases(i, t, stats.exhibits, replay)) for i, t in tallies.items()}
    return Results(
        tool=Tool.own(),
        subject=subject,
        role=Role.CAPTURE,
        verdict=judge.conclusion,
        counts=dict.fromkeys(Verdict, 0) | Counter(c.verdict for cs in cases.values() for c in cs),
        readings={
            "client": readings_of(judge, A2C, {}),
            "controller": readings_of(judge, C2A, claims or {}),
        },
        requirements=tuple(
            RequirementResult(
                r.id,
                tallies[r.id].verdict if r.id in tallies else Verdict.NONE,
                tuple(case.id for case in cases.get(r.id, ())),
            )
            for r in REQUIREMENTS.values()
            if Method.PASSIVE in r.testable or r.id in tallies
        ),
        cases=tuple(case for of_one in cases.values() for case in of_one),
        session=stats.session(),
    )


def _cases(requirement: str, tally: Tally, exhibits: Exhibits, replay: str) -> Iterator[Case]:
    """The cases of one requirement: its findings by what they say, or that it was kept."""
    groups: defaultdict[tuple[Verdict, object], list[Finding]] = defaultdict(list)
    for finding in tally.findings:
        groups[finding.verdict, finding.reading or finding.message].append(finding)
    if not groups:
        message = UserMessage("kept {counts}", counts=_times(tally.counts[Verdict.PASS]))
        yield Case(requirement, (requirement,), Verdict.PASS, message=message, replay=replay)
    kept = Counter(finding.verdict for finding in tally.findings)
    gravest_first = sorted(groups.values(), key=lambda g: -_GRAVITY.index(g[0].verdict))
    for number, findings in enumerate(gravest_first, 1):
        first = findings[0]
        unkept = tally.counts[first.verdict] > kept[first.verdict]
        places = dict.fromkeys(place for finding in findings for place in finding.evidence)
        wire = tuple(exhibits.evidence(place) for place in islice(places, _SHOWN_PLACES))
        yield Case(
            id=requirement if number == 1 else f"{requirement}.{number}",
            requirements=(requirement,),
            verdict=first.verdict,
            cause=first.cause,
            message=first.message + _how_often(len(findings), unkept=unkept),
            expected=first.expected,
            observed=first.observed or " = ".join(first.reading or ()),
            replay=replay,
            wire=wire,
            passing=exhibits.passing(wire) if first.verdict is Verdict.FAIL else (),
        )


def _how_often(count: int, *, unkept: bool) -> str:
    """A count after the message; `unkept` findings of its verdict may be equal."""
    if unkept:
        return f" (at least {_times(count)})"
    return f" ({_times(count)})" if count > 1 else ""


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def readings_of(
    judge: Judge, party: Direction, claims: Mapping[str, str]
) -> Mapping[str, ReadingSeen]:
    """What a party does at the open points, by key; `claims` are its statement's."""
    seen, mixed = judge.dialect_seen.of(party), judge.dialect_seen.mixed(party)
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
