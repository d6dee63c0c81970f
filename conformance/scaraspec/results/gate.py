"""Gate: whether results are as good as a baseline with its waivers. A pure function.

Failures that the baseline knows and failures that a waiver covers are accepted. Everything else
that is worse than the baseline is a problem.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from enum import Enum

from scaraspec.judge.verdicts import Conclusion, ExitStatus, Reason, Verdict
from scaraspec.report.model import SEEN, Case, Results
from scaraspec.results.baseline import Baseline, KnownFailure, settings_of
from scaraspec.results.findings import SKIPPED_AFTER_FAILURE, failures, place, stable_values
from scaraspec.results.waivers import Waiver
from scaraspec.user_message import UserMessage


class ProblemKind(Enum):
    """Why a gate fails; the values are a public interface."""

    NEW_FAILURE = "new-failure"
    CHANGED_FAILURE = "changed-failure"
    LOST_CASE = "lost-case"
    LOST_REQUIREMENT = "lost-requirement"
    STALE_WAIVER = "stale-waiver"
    EXPIRED_WAIVER = "expired-waiver"
    UNKNOWN_ID = "unknown-id"
    OTHER_SETTINGS = "other-settings"

    @property
    def title(self) -> str:
        """The kind in words."""
        return self.value.replace("-", " ")


@dataclass(frozen=True, slots=True)
class GateProblem:
    """One reason why a gate fails.

    Attributes:
        kind: What is wrong.
        id: The case, requirement, fingerprint or setting.
        message: One sentence.
        case: The failed case, if there is one.
    """

    kind: ProblemKind
    id: str
    message: str
    case: Case | None = None


@dataclass(frozen=True, slots=True)
class GateResult:
    """The result of a gate.

    Attributes:
        results: The results that were compared.
        problems: Why the gate fails; empty if it does not.
        accepted: Why a failed case is accepted, by case id.
        fixed: Known failures that no longer occur.
        undecided: The cases that are inconclusive, and errors of the suite. A case that an accepted
            failure prevents is not among them, unless the baseline has judged it.
        not_run: The number of cases that did not run because of ``--fail-fast``.
    """

    results: Results
    problems: tuple[GateProblem, ...]
    accepted: Mapping[str, str]
    fixed: tuple[KnownFailure, ...]
    undecided: tuple[Case, ...]
    not_run: int

    @property
    def exit_status(self) -> ExitStatus:
        """The exit status: 1 for a problem wins over 3 for an inconclusive or incomplete run."""
        if self.problems:
            return ExitStatus.NONCONFORMANT
        if self.undecided or self.not_run or self.results.verdict is Conclusion.INCONCLUSIVE:
            return ExitStatus.INCONCLUSIVE
        if self.results.verdict is Conclusion.NOTHING_TESTED:
            return ExitStatus.NOTHING_TESTED
        return ExitStatus.CONFORMANT


def gate(
    results: Results,
    *,
    baseline: Baseline | None = None,
    waivers: Sequence[Waiver] = (),
    today: date,
) -> GateResult:
    """Compare results with what is accepted.

    Args:
        results: The results of a run or an audit.
        baseline: What is accepted; None to accept no failure.
        waivers: Failures that are accepted until a date.
        today: The current date.

    Raises:
        OldResultsError: The results have no fingerprints.
    """
    failed = failures(results)
    waived = {case.id: waiver for case in failed for waiver in waivers if waiver.covers(case)}
    known = baseline.failures if baseline else ()
    problems, accepted = list[GateProblem](), dict[str, str]()
    if baseline:
        problems += _other_settings(results, baseline)
    for case in failed:
        if waiver := waived.get(case.id):
            accepted[case.id] = waiver.note
        elif problem := _problem_of(case, known, compare_values=_same_seed(results, baseline)):
            problems.append(problem)
        else:
            accepted[case.id] = "known failure of the baseline"
    if baseline:
        problems += _lost(results, baseline)
    for waiver in waivers:
        problems += _waiver_problems(waiver, results, baseline, today)
    fingerprints = {case.fingerprint for case in failed}
    places = {place(case) for case in failed}
    return GateResult(
        results,
        tuple(problems),
        accepted,
        tuple(f for f in known if f.fingerprint not in fingerprints and f.case not in places),
        tuple(_undecided(results, accepted, baseline, waivers)),
        sum(case.reason is Reason.FAIL_FAST for case in results.cases),
    )


def _undecided(
    results: Results,
    accepted: Mapping[str, str],
    baseline: Baseline | None,
    waivers: Sequence[Waiver],
) -> Iterator[Case]:
    """Yield the cases that leave the result open."""
    judged = baseline.cases if baseline else ()
    for case in results.cases:
        if case.verdict not in (Verdict.INCONCLUSIVE, Verdict.ERROR):
            continue
        prevented = accepted and case.reason is Reason.DEPENDENCY and case.id not in judged
        if not (prevented or any(_tolerates(waiver, case) for waiver in waivers)):
            yield case


def _same_seed(results: Results, baseline: Baseline | None) -> bool:
    """Whether both runs drew the same values."""
    return bool(baseline and results.run and results.run.seed == baseline.seed)


def _problem_of(
    case: Case, known: Sequence[KnownFailure], *, compare_values: bool
) -> GateProblem | None:
    """Return what is wrong about a failure that no waiver covers; None if it is known."""
    same = [failure for failure in known if failure.fingerprint == case.fingerprint]
    values = stable_values(case)
    if same and (not compare_values or any(failure.values == values for failure in same)):
        return None
    before = same or [failure for failure in known if failure.case == place(case)]
    if not before:
        return GateProblem(ProblemKind.NEW_FAILURE, case.id, case.message, case)
    message = UserMessage(
        "{message} (in the baseline: {before})", message=case.message, before=before[0].message
    )
    return GateProblem(ProblemKind.CHANGED_FAILURE, case.id, message, case)


def _other_settings(results: Results, baseline: Baseline) -> Iterator[GateProblem]:
    """Yield the settings that differ: other settings test something else."""
    before = {"role": baseline.role.value, "subject": baseline.subject, **baseline.settings}
    now = {"role": results.role.value, "subject": results.subject.name, **settings_of(results)}
    for name in sorted(before | now):
        if (old := before.get(name, "")) != (new := now.get(name, "")):
            message = UserMessage(
                "{name} is {new}, in the baseline {old}",
                name=name,
                new=new or "not given",
                old=old or "not given",
            )
            yield GateProblem(ProblemKind.OTHER_SETTINGS, name, message)


def _lost(results: Results, baseline: Baseline) -> Iterator[GateProblem]:
    """Yield what the baseline has judged and these results have not."""
    cases = {case.id: case for case in results.cases}
    message: str
    for case_id in baseline.cases:
        case = cases.get(case_id)
        if case is None:
            yield GateProblem(ProblemKind.LOST_CASE, case_id, "the case is not in the results")
        elif case.verdict is Verdict.NONE and case.reason not in SKIPPED_AFTER_FAILURE:
            message = UserMessage("the case did not run: {reason}", reason=case.message)
            yield GateProblem(ProblemKind.LOST_CASE, case_id, message)
    requirements = {each.id: each for each in results.requirements}
    for requirement in baseline.requirements:
        found = requirements.get(requirement)
        if found is None:
            message = "the requirement is not in the scope of the results"
        elif found.verdict is Verdict.NONE and not any(
            cases[each].reason in SKIPPED_AFTER_FAILURE for each in found.cases if each in cases
        ):
            message = "the requirement was not judged"
        else:
            continue
        yield GateProblem(ProblemKind.LOST_REQUIREMENT, requirement, message)


def _waiver_problems(
    waiver: Waiver, results: Results, baseline: Baseline | None, today: date
) -> Iterator[GateProblem]:
    message: str
    if waiver.expires < today:
        message = UserMessage(
            "the waiver expired on {expires}: {reason}",
            expires=waiver.expires.isoformat(),
            reason=waiver.reason,
        )
        yield GateProblem(ProblemKind.EXPIRED_WAIVER, waiver.name, message)
    covered = [case for case in results.cases if waiver.covers(case)]
    if any(case.verdict is Verdict.FAIL or _tolerates(waiver, case) for case in covered):
        return
    if waiver.case and not covered and waiver.case not in (baseline.cases if baseline else ()):
        if SEEN in waiver.case:
            message = "no finding has this id; name a finding of the judge by its fingerprint"
        else:
            message = "the results have no case with this id"
        yield GateProblem(ProblemKind.UNKNOWN_ID, waiver.case, message)
    elif not waiver.flaky and all(map(_passed, covered)):
        message = "the waived failure does not occur any more: remove the waiver"
        yield GateProblem(ProblemKind.STALE_WAIVER, waiver.name, message)


def _passed(case: Case) -> bool:
    return case.verdict in (Verdict.PASS, Verdict.TOLERATED)


def _tolerates(waiver: Waiver, case: Case) -> bool:
    """Whether the waiver of an intermittent failure covers a case that is inconclusive for it."""
    return waiver.flaky and waiver.covers(case) and case.reason is Reason.INTERMITTENT
