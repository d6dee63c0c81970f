"""Merge: joins the sittings of one certification into one result. A pure function.

All sittings must test the same build with the same claims, options and version of scaraspec. Only
the selection of cases may differ, and for a controller the presence of an operator. If several
sittings ran a case, all are listed, and one counts:

1. A failure counts, whatever an earlier or later sitting found: the build is the same, so the fault
   is still there.
2. Without a failure, a verdict counts more than an inconclusive one. Tolerated counts more than
   passed.
3. Among equals the latest counts.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Verdict, conclude, worst
from scaraspec.report.failed_step import SittingResult
from scaraspec.report.model import (
    SEEN,
    Case,
    ReadingSeen,
    RequirementResult,
    Results,
    Role,
    RunInfo,
)
from scaraspec.report.root_causes import root_causes
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.earlier_sitting import conditions_of, date_of, first_difference
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.selection import parse_selection
from scaraspec.user_message import UserMessage

_BY_WEIGHT: Final = (
    Verdict.NONE,
    Verdict.INCONCLUSIVE,
    Verdict.ERROR,
    Verdict.PASS,
    Verdict.TOLERATED,
    Verdict.FAIL,
)
_GOOD: Final = (Verdict.PASS, Verdict.TOLERATED)
_UNDECIDED: Final = (Verdict.INCONCLUSIVE, Verdict.ERROR)
_MAY_DIFFER: Final = ("only", "fail_fast")
_COVERAGE, _INTERRUPTED = "run.coverage", "run.interrupted"


class MergeError(ValueError):
    """The results cannot be merged; the message is one sentence."""


def merge(sittings: Sequence[Results]) -> Results:
    """Return the results of several sittings as those of one run, each case with its date.

    Args:
        sittings: The results, in any order; also results of an earlier merge.

    Raises:
        MergeError: They are not sittings of one certification.
    """
    ordered = sorted(sittings, key=lambda each: each.run.begun_ns if each.run else 0)
    runs = _runs_of(ordered)
    last, role = ordered[-1], ordered[-1].role
    cases = [*_cases(ordered), *_findings(ordered)]
    requirements = tuple(_requirements(ordered, cases))
    settings = {**runs[-1].settings, "only": _selection(runs)}
    counts = Counter(case.verdict for case in cases)
    undecided = sum((Counter(each.undecided) for each in ordered), Counter[str]())
    return Results(
        tool=last.tool,
        subject=replace(last.subject, file=""),
        role=role,
        verdict=conclude(counts, complete=all(each.decided for each in requirements)),
        counts=dict.fromkeys(Verdict, 0) | counts,
        readings={role.value: _readings([each.readings.get(role.value, {}) for each in ordered])},
        requirements=requirements,
        cases=tuple(cases),
        notices=(
            UserMessage(
                "Merged from the sittings of {dates}", dates=", ".join(map(date_of, ordered))
            ),
            *_conflicts(cases),
            *dict.fromkeys(notice for each in ordered for notice in each.notices),
        ),
        run=replace(
            runs[-1],
            begun_ns=runs[0].begun_ns,
            ended_ns=max(run.ended_ns for run in runs),
            settings=settings,
        ),
        undecided=dict(undecided),
        causes=root_causes(cases, role),
    )


def _runs_of(ordered: Sequence[Results]) -> list[RunInfo]:
    """Return how the results were produced, if they belong to one certification.

    Raises:
        MergeError: They do not.
    """
    runs = [each.run for each in ordered if each.run]
    if len(runs) < len(ordered):
        raise MergeError("results of schema 1 state no settings, and cannot be merged")
    for each in ordered:
        if each.role is Role.CAPTURE:
            raise MergeError("results of an audit cannot be merged: audit the captures together")
    for before, now in pairwise(ordered):
        if differs := first_difference(_conditions(before), _conditions(now)):
            raise MergeError(
                UserMessage("the sittings have different conditions: {what}", what=differs)
            )
    for first, second in pairwise(runs):
        if first.begun_ns == second.begun_ns:
            raise MergeError("two of the results are of the same sitting")
    return runs


def _conditions(results: Results) -> dict[str, str]:
    """Return what must be equal; an unnamed subject is known by its link alone."""
    may_differ = {*_MAY_DIFFER, *(("attended",) if results.role is Role.CONTROLLER else ())}
    conditions = {k: v for k, v in conditions_of(results).items() if k not in may_differ}
    return conditions if results.subject.name else {**conditions, "link": results.subject.link}


def _selection(runs: Sequence[RunInfo]) -> str:
    """Return what the sittings select together; empty for everything."""
    lists = [run.settings.get("only", "") for run in runs]
    items = (item for each in lists for item in each.split(","))
    return ",".join(dict.fromkeys(items)) if all(lists) else ""


# ---------------------------------------------------------------------- cases


def _cases(ordered: Sequence[Results]) -> Iterator[Case]:
    """Yield each case once, with what all sittings found."""
    occurrences: defaultdict[str, list[Case]] = defaultdict(list)
    for results in ordered:
        for case in results.cases:
            if SEEN not in case.id and case.id != _COVERAGE:
                date = case.date or date_of(results)
                occurrences[case.id].append(replace(case, date=date))
    if _INTERRUPTED in occurrences and _planned(ordered) <= occurrences.keys():
        del occurrences[_INTERRUPTED]
    for found in occurrences.values():
        yield _joined(found)


def _planned(ordered: Sequence[Results]) -> set[str]:
    """Return the ids of all cases that the sittings were about."""
    planned = set[str]()
    for results in ordered:
        settings = results.run.settings if results.run else {}
        selection = parse_selection(settings.get("only") or None, results.role)
        options = Options(
            only=selection.requirements,
            cases=selection.cases,
            attended=settings.get("attended") == "true",
        )
        planned |= {case.id for case in collect(options, results.role)}
    return planned


def _joined(found: Sequence[Case]) -> Case:
    ran = [case for case in found if case.verdict is not Verdict.NONE]
    if not ran:
        return found[-1]
    counts = max(reversed(ran), key=lambda case: _BY_WEIGHT.index(case.verdict))
    results = [result for case in ran for result in _results_of(case)]
    return replace(counts, sittings=tuple(results) if len(results) > 1 else ())


def _results_of(case: Case) -> tuple[SittingResult, ...]:
    return case.sittings or (SittingResult(case.date, case.verdict, f"{case.message}"),)


def _findings(ordered: Iterable[Results]) -> Iterator[Case]:
    """Yield the different findings of the judge, numbered again."""
    known, numbers = set[tuple[str, Verdict]](), Counter[str]()
    for results in ordered:
        for case in results.cases:
            if SEEN not in case.id or (case.fingerprint, case.verdict) in known:
                continue
            known.add((case.fingerprint, case.verdict))
            requirement = case.id.partition(SEEN)[0]
            numbers[requirement] += 1
            date = case.date or date_of(results)
            yield replace(case, id=f"{requirement}{SEEN}{numbers[requirement]}", date=date)


def _conflicts(cases: Iterable[Case]) -> Iterator[str]:
    """Yield a sentence for each failure that another sitting did not find, and what was decided."""
    decided = 0
    for case in cases:
        failed = [each.date for each in case.sittings if each.verdict is Verdict.FAIL]
        passed = [each.date for each in case.sittings if each.verdict in _GOOD]
        if failed and passed:
            yield UserMessage(
                "{case} failed in the sitting of {failed} and passed in that of {passed}: the "
                "failure counts",
                case=case.id,
                failed=failed[-1],
                passed=passed[-1],
            )
        elif passed and any(each.verdict in _UNDECIDED for each in case.sittings):
            decided += 1
    if decided:
        yield UserMessage(
            "{count} cases that were inconclusive in one sitting were decided in another",
            count=decided,
        )


# ---------------------------------------------------------------------- requirements and readings


def _requirements(ordered: Iterable[Results], cases: Iterable[Case]) -> Iterator[RequirementResult]:
    scope = {requirement.id for each in ordered for requirement in each.requirements}
    by_requirement: defaultdict[str, list[Case]] = defaultdict(list)
    for case in cases:
        for requirement in case.requirements:
            by_requirement[requirement].append(case)
    for requirement in REQUIREMENTS:
        judging = by_requirement[requirement]
        if requirement in scope:
            yield RequirementResult(
                requirement,
                worst(case.verdict for case in judging),
                tuple(case.id for case in judging),
            )


def _readings(sides: Iterable[Mapping[str, ReadingSeen]]) -> dict[str, ReadingSeen]:
    """Return all observed options; different ones in different sittings are a contradiction."""
    merged: dict[str, ReadingSeen] = {}
    for side in sides:
        for key, seen in side.items():
            before = merged.get(key)
            if before is None or not before.options:
                merged[key] = seen
            elif seen.options:
                options = tuple(dict.fromkeys((*before.options, *seen.options)))
                differs = {*before.options} != {*seen.options}
                merged[key] = replace(
                    before,
                    options=options,
                    default=before.default and seen.default,
                    mixed=before.mixed or seen.mixed or differs,
                )
    return merged
