"""Case runner: runs each case between positive controls and records its outcome.

pytest collects and calls the cases, hypothesis draws the values. The verdict of a case depends on
the exception that it raised, on the readings that it tolerated, and on whether the subject was
alive before and after it. `run` joins the findings of the judge to the outcomes.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import pytest
from _pytest.runner import runtestprotocol

from scaraspec.judge.verdicts import Cause, Reason, Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role
from scaraspec.report.operator_request import operator_s
from scaraspec.suite.engine.attempts import Attempt, needs_another, settle
from scaraspec.suite.engine.case import Case, case_of, is_case
from scaraspec.suite.engine.case_collector import CaseCollector
from scaraspec.suite.engine.examples import count_examples
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    HookMissing,
    NoReply,
    Unreadable,
    observed_by,
    preparation,
)
from scaraspec.suite.engine.journal import JournalError
from scaraspec.suite.engine.outcome import (
    Outcome,
    failed_outcome,
    is_about,
    message_of,
    prevented,
    root_cause,
    unless_dependent,
    unless_disturbed,
)
from scaraspec.suite.engine.plan import Options, Skip, asks_operator, skip_reason
from scaraspec.suite.engine.stall_detector import Stall
from scaraspec.suite.engine.system_under_test import SystemUnderTest
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.report.failed_step import Stage

_NS: Final = 1e9
_SENTENCE: Final = 500
_WATCH_S: Final = 2.0
_WATCH_MOST_S: Final = 10.0
_WATCH_AGAIN_MOST_S: Final = 30.0
"""For how long a subject is watched after a failure: minimum, maximum, maximum of a second time."""
_TIMES: Final = 2.0
_LONGER: Final = 1.5
"""Multiples of the duration of the case for which it is watched: the first and the second time."""
_REPEATS: Final = 2
"""How often a failed case must pass when it is repeated: a fault may depend on the time of day."""
_STOP_WORKS: Final = ("4.17/6", "4.17/7")
"""Requirements whose failure means that the emergency stop was refused, or had no effect."""


@dataclass(frozen=True, slots=True)
class Callbacks:
    """The functions that a case runner calls during a run.

    Attributes:
        report: Called with each outcome and the number of cases.
        announce: Called with each case before it runs.
        before_last: Called before the first case after which the subject may be switched off.
        before_motion: Called before the first case that may move the subject, and again after the
            subject was restarted.
        watch: Called after a failure with a minimum duration in seconds. It checks whether another
            client has caused the failure.
        stalls: Returns the stalls of this machine since the last call.
    """

    report: Callable[[Outcome, int], None] = lambda _outcome, _count: None
    announce: Callable[[Case], None] = lambda _case: None
    before_last: Callable[[], None] = lambda: None
    before_motion: Callable[[], None] = lambda: None
    watch: Callable[[float], None] = lambda _for_s: None
    stalls: Callable[[], Sequence[Stall]] = tuple


class CaseRunner(CaseCollector):
    """The pytest plugin object of one run against one subject.

    Args:
        subject: The subject.
        role: The role of the subject.
        options: The options of the user.
        folder: Where the cases are.
        callbacks: The functions that are called during the run.
        completed: The ids of cases that an earlier session has completed. They do not run again.

    Attributes:
        subject: The subject.
        outcomes: The outcomes so far, in the order of the run.
        reports: The reports of pytest about the last attempt of the last case.
    """

    def __init__(  # noqa: PLR0913 - the collaborators of a run
        self,
        subject: SystemUnderTest,
        role: Role,
        options: Options,
        folder: Path,
        callbacks: Callbacks,
        *,
        completed: frozenset[str] = frozenset(),
    ) -> None:
        super().__init__(role, options, folder)
        self.subject = subject
        self.outcomes: list[Outcome] = []
        self._callbacks, self._completed = callbacks, completed
        self._dead = self._unmoved = ""
        self._survived, self._died = True, False
        self._at_last = self._ready = self._stop_reported = False
        self._failed: set[str] = set()
        self._sighted: set[str] = set()
        self._raised: BaseException | None = None
        self.reports: list[pytest.TestReport] = []
        self._dependencies: dict[tuple[str, str, Stage], str] = {}

    # ------------------------------------------------------------------ pytest's hooks

    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> bool | None:
        """Run one case, or record the reason why it does not run."""
        if not is_case(item):
            return None
        self._end_if_requested()
        case = case_of(item)
        outcome = self._known(case)
        if outcome is None:
            with self._profile:
                outcome = self._run(case, item, nextitem)
        else:  # pytest has to tear down what it had set up for this one
            item.add_marker(pytest.mark.skip(reason=outcome.message))
            self.reports = runtestprotocol(item, log=False, nextitem=nextitem)
        if outcome.requirement:
            self._failed.add(outcome.requirement)
        self.outcomes.append(outcome)
        self._callbacks.report(outcome, len(self.cases))
        return True

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Give a case the subject and a line, a connection that is logged in.

        They are no fixtures: the fixtures of other tests in the session may have these names.
        """
        if not (is_case(item) and isinstance(item, pytest.Function)):
            return
        item.funcargs["subject"] = self.subject
        if "line" in item.fixturenames:
            with preparation():
                item.funcargs["line"] = self.subject.open()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Keep the first exception of a case."""
        report = yield
        if is_case(item) and call.excinfo is not None and self._raised is None:
            self._raised = call.excinfo.value
        return report

    # ------------------------------------------------------------------ one case

    def _asks(self, case: Case) -> bool:
        """Whether the case asks an operator."""
        return asks_operator(case, self.options, self.subject.ics)

    def _turn(self, case: Case) -> tuple[int, tuple[str, ...]]:
        """The order of execution; the cases that ask an operator for the same are together."""
        return case.turn, case.needs if self._asks(case) else ()

    def _known(self, case: Case) -> Outcome | None:
        """The outcome of a case that need not run; None if it must run."""
        if case.id in self._completed:
            message = "an earlier session has completed this case"
            return Outcome(case, Verdict.NONE, message=message, reason=Reason.ENDED_BEFORE)
        skip = skip_reason(case, self.options, self.subject.ics)
        if not skip and self._failed.issuperset(case.requirements) and not self.options.exhaustive:
            message = UserMessage(
                "{requirements} failed already: repeat with --exhaustive to run its other cases",
                requirements=", ".join(case.requirements),
            )
            skip = Skip(Reason.FAILED_BEFORE, message)
        elif not skip and self._failed and self.options.fail_fast:
            skip = Skip(Reason.FAIL_FAST, "a case has failed, and --fail-fast ends the run")
        if skip:
            return Outcome(
                case,
                Verdict.NONE,
                cause=Cause.SET_UP,
                message=skip.message,
                reason=skip.reason,
                missing_hooks=skip.missing_hooks,
            )
        moves = Hazard.MOTION in case.hazards
        failure = self.subject.stop_failure
        obstacle = None
        if self._dead:
            obstacle = Skip(Reason.UNREACHABLE, self._dead)
        elif moves and self._unmoved:
            obstacle = Skip(Reason.DEPENDENCY, self._unmoved)
        elif failure and (moves or case.undefined):
            message = UserMessage(
                "the emergency stop does not work: {message}", message=failure.message
            )
            obstacle = Skip(Reason.WITHHELD, message)
        if obstacle:
            return Outcome(
                case,
                Verdict.INCONCLUSIVE,
                cause=Cause.DEPENDENCY,
                message=obstacle.message,
                reason=obstacle.reason,
            )
        return None

    def _run(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Outcome:
        """Run a case, and repeat it as `attempts` requires.

        The first failure is checked at once for another client that may have caused it.
        """
        self._callbacks.announce(case)
        self._survived = True
        observer, begun_ns = self.subject.observer, self.subject.now_ns
        observer.budget.begin_case()
        outcome = self._run_attempts(case, item, nextitem)
        for_s = (self.subject.now_ns - begun_ns) / _NS - operator_s(outcome.operator)
        observer.budget.end_case(outcome, for_s, late=bool(observer.attempt.late))
        return outcome

    def _run_attempts(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Outcome:
        attempts: list[Attempt] = []
        again = partial(self._attempt, case, item, nextitem)
        checked = False
        while True:
            restore_knowledge = self.subject.checkpoint()
            attempts.append(again())
            last = attempts[-1]
            repeatable = self._is_repeatable(case, (last.outcome.requirement,))
            self.subject.observer.attempt.repeatable = repeatable
            if last.valid and (last.failed or last.violated) and not checked:
                checked = True
                if reason := self._disturbance(last, again):
                    return unless_disturbed(settle(attempts, repeatable=False), reason)
            if not (repeatable and needs_another(attempts)):
                return self._unless_dependency(settle(attempts, repeatable=repeatable))
            restore_knowledge()

    def _is_repeatable(self, case: Case, failed: Sequence[str]) -> bool:
        """Whether a case may be repeated after a failure of these requirements.

        A case is not repeated after a failure of the emergency stop, if it is destructive, or if it
        needs an operator.
        """
        return not (
            self._dead
            or case.last
            or Hazard.DESTRUCTIVE in case.hazards
            or self._asks(case)
            or self.subject.stop_failure
            or any(requirement.startswith("4.17/") for requirement in failed)
        )

    def _disturbance(self, attempt: Attempt, again: Callable[[], Attempt]) -> str:
        """Return why a failure does not count because of another client; empty if it counts.

        Args:
            attempt: The attempt that failed, or in which the judge found a violation.
            again: Repeats the case.
        """
        case, others = attempt.outcome.case, self.subject.others
        if self._dead or case.last:
            return ""
        once = Hazard.DESTRUCTIVE in case.hazards or self._asks(case)
        for_s = max(_WATCH_S, _TIMES * attempt.outcome.duration_s)
        for_s = _WATCH_MOST_S if once else min(for_s, _WATCH_MOST_S)
        self._callbacks.watch(for_s)
        if others.suspected and not others.reason(case.id) and not once:
            self._repeat(again, for_s)
        reason = others.reason(case.id)
        if not reason:
            self._sighted |= attempt.violated
        return reason

    def _repeat(self, again: Callable[[], Attempt], watched_s: float) -> None:
        """Repeat a failed case: if it passes now, another client may have caused the failure.

        If it fails again, a client that acts periodically may have acted before and after the time
        for which the subject was watched. The subject is then watched for a longer time.
        """
        lasted_s = watched_s
        for _ in range(_REPEATS):
            attempt = again()
            lasted_s += attempt.outcome.duration_s
            passed = attempt.outcome.verdict in (Verdict.PASS, Verdict.TOLERATED)
            if not passed or attempt.violated:
                break
        else:
            self.subject.others.passed_again()
            return
        if not self._dead:
            self._callbacks.watch(min(_LONGER * lasted_s, _WATCH_AGAIN_MOST_S))

    def _found(self, since: int) -> set[str]:
        """The requirements that the judge found violated since then for the first time."""
        sightings = self.subject.observer.findings[since:]
        found = {s.finding.requirement for s in sightings if s.finding.verdict is Verdict.FAIL}
        return found - self._failed - self._sighted

    def _attempt(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Attempt:
        """Try a case once; findings that span a stall of this machine are dropped."""
        observer = self.subject.observer
        repeatable = self._is_repeatable(case, case.requirements[:1])
        observer.begin(case.id, repeatable=repeatable, attended=case.attended)
        self._callbacks.stalls()
        since = len(observer.findings)
        with observed_by(lambda: observer.moment):
            outcome = self._try(case, item, nextitem)
        stalls = self._callbacks.stalls()
        observer.drop_stalled(since, stalls)
        return Attempt(
            outcome,
            frozenset(self._found(since)),
            bool(observer.attempt.late),
            observer.attempt.delayed,
            max((stall.duration_s for stall in stalls), default=0.0),
            self._died,
        )

    def _try(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Outcome:
        subject = self.subject
        subject.others.begin()
        if case.last and not self._at_last:
            self._at_last = True
            self._callbacks.before_last()
        if Hazard.MOTION in case.hazards and not self._ready:
            self._ready = True
            self._callbacks.before_motion()
            self._report_stop(case)
        begun_ns = subject.now_ns
        subject.begin_case()
        self._raised = None
        with count_examples(subject) as tally:
            self.reports = runtestprotocol(item, log=False, nextitem=nextitem)
        self._end_if_requested()
        outcome = unless_dependent(self._outcome(case), root_cause(self._raised))
        outcome = self._unless_withheld(outcome)
        if outcome.requirement in _STOP_WORKS:
            subject.report_stop_failure(outcome.requirement, outcome.message)
        self._report_stop(case, outcome)
        frames = subject.observer.evidence
        if case.last:
            subject.close_lines()
        else:
            outcome = self._afterwards(case, outcome)
        self._report_stop(case, outcome)
        requests = tuple(subject.observer.attempt.requests)
        duration_s = (subject.now_ns - begun_ns) / _NS - operator_s(requests)
        return replace(
            outcome,
            begin_ns=begun_ns,
            duration_s=duration_s,
            examples=tally.examples,
            frames=outcome.frames or frames,
            operator=requests,
        )

    def _end_if_requested(self) -> None:
        """End the run if the user has interrupted it.

        The exception of a signal can be lost during garbage collection.

        Raises:
            KeyboardInterrupt: The user has interrupted the run.
        """
        if self.subject.observer.interruption.requested:
            raise KeyboardInterrupt

    def _outcome(self, case: Case) -> Outcome:
        """The outcome that follows from the exception that the case raised."""
        raised = root_cause(self._raised)
        if isinstance(raised, HookMissing) and isinstance(raised.__context__, CaseFailed):
            raised = raised.__context__  # the operator skipped what follows the failure
        if raised is None and self.subject.no_verdict_reason:
            raised = CaseSkipped(self.subject.no_verdict_reason)
        match raised:
            case None:
                pass
            case CaseSkipped():
                return Outcome(
                    case,
                    Verdict.NONE,
                    cause=Cause.SET_UP,
                    message=message_of(raised),
                    reason=raised.reason,
                    missing_hooks=raised.hooks if isinstance(raised, HookMissing) else (),
                )
            case CaseInconclusive():
                if isinstance(raised, JournalError):
                    self.give_up(str(raised))
                return Outcome(
                    case,
                    Verdict.INCONCLUSIVE,
                    cause=Cause.SET_UP,
                    message=message_of(raised),
                    reason=raised.reason,
                )
            case CaseFailed():
                return self._failure(case, raised)
            case _:
                message = f"the case itself has a defect: {type(raised).__name__}: {raised}"[
                    :_SENTENCE
                ]
                return Outcome(case, Verdict.ERROR, cause=Cause.SUITE, message=message)
        if self.subject.tolerated:
            first = self.subject.tolerated[0]
            readings = tuple((each.key, each.option) for each in self.subject.tolerated)
            message, observed = first.message, f"{first.key} = {first.option}"
            return Outcome(
                case, Verdict.TOLERATED, message=message, observed=observed, readings=readings
            )
        return Outcome(case, Verdict.PASS, message=case.sentence)

    def _failure(self, case: Case, error: CaseFailed) -> Outcome:
        """The outcome of a failure; a dependency that failed has its own requirement."""
        requirement, command = error.requirement, error.due[0] if error.due else ""
        if error.preparation and not is_about(case, requirement, command):
            reply_requirement = error.reply_requirement if isinstance(error, NoReply) else ""
            requirement = requirement or reply_requirement or self.subject.survival_requirement
            error.preparation = bool(requirement)
        else:
            error.preparation = False
        return failed_outcome(case, error, requirement or case.requirements[0])

    def _unless_dependency(self, outcome: Outcome) -> Outcome:
        """The outcome of a case; inconclusive if a known failure prevents its preparation.

        So each dependency fails once. The case itself may be the cause if the subject has not
        survived it.
        """
        step = outcome.step
        failed = outcome.verdict is Verdict.FAIL and self._survived
        if not failed or step is None or not step.dependency:
            return outcome
        dependency = (step.dependency, step.command, step.stage)
        first = self._dependencies.setdefault(dependency, outcome.case.id)
        return outcome if first == outcome.case.id else prevented(outcome, first)

    def _report_stop(self, case: Case, outcome: Outcome | None = None) -> None:
        """Report once, and at once, that the emergency stop does not work.

        This is a failure of its own, unless the running case has failed because of it.

        Args:
            case: The running case, or the next one.
            outcome: The outcome of the case; None before it runs.
        """
        failure = self.subject.stop_failure
        if failure is None or self._stop_reported:
            return
        self._stop_reported = True
        self.subject.notify(
            UserMessage(
                "THE EMERGENCY STOP DOES NOT WORK: {message}. scaraspec sends no further request "
                "that can start a motion. The robot may still be moving: stop it with its own "
                "emergency stop. The cases that need a motion are inconclusive",
                message=failure.message,
            )
        )
        if outcome and outcome.requirement.startswith("4.17/"):
            return
        when = UserMessage("in" if outcome else "before")
        own = Outcome(
            Case("run.emergency-stop", (failure.requirement,), case.hazards),
            Verdict.FAIL,
            failure.requirement,
            Cause.SUBJECT,
            UserMessage(
                "the emergency stop does not work: {message}; found {when} case {id}",
                message=failure.message,
                when=when,
                id=case.id,
            ),
            failure.expected,
            failure.observed,
            frames=self.subject.observer.evidence,
        )
        self.outcomes.append(own)
        self._callbacks.report(own, len(self.cases))

    def _unless_withheld(self, outcome: Outcome) -> Outcome:
        """The outcome of a case; inconclusive if one of its requests was withheld.

        A failure of the emergency stop itself was found before that and is kept.
        """
        withheld = self.subject.withheld
        if not withheld or outcome.requirement.startswith("4.17/"):
            return outcome
        return Outcome(
            outcome.case,
            Verdict.INCONCLUSIVE,
            cause=Cause.DEPENDENCY,
            message=withheld,
            reason=Reason.WITHHELD,
        )

    def _afterwards(self, case: Case, outcome: Outcome) -> Outcome:
        """The positive control after a case: the subject is alive and idle again."""
        subject = self.subject
        try:
            subject.settle()
        except (NoReply, CaseFailed) as error:
            self._survived = False
            self._revive(case)
            if outcome.verdict is Verdict.FAIL:
                return outcome
            message = UserMessage("the subject did not survive the case: {error}", error=error)
            error.preparation = False
            error.expected = "a connection, a login and get_status work after the case"
            requirement = subject.survival_requirement or case.requirements[0]
            return failed_outcome(case, error, requirement, message)
        except CaseInconclusive as error:
            if isinstance(error, Unreadable):
                self._unmoved = UserMessage(
                    "the robot cannot be moved since case {id}: {error}", id=case.id, error=error
                )
            else:
                self._revive(case)
            if outcome.verdict in (Verdict.FAIL, Verdict.ERROR):
                return outcome
            return Outcome(
                case,
                Verdict.INCONCLUSIVE,
                cause=Cause.SET_UP,
                message=message_of(error),
                reason=Reason.UNDECIDED,
            )
        return outcome

    def give_up(self, why: str) -> None:
        """Run no further case, because the subject cannot be tested any more.

        Args:
            why: The reason; it becomes the message of the cases that do not run.
        """
        self._dead = why

    def _revive(self, case: Case) -> None:
        """Restart the subject, if there is a hook for it."""
        subject = self.subject
        try:
            subject.revive()
            self._ready = False
            subject.settle()
        except CaseFailed as error:
            self._died = True
            self.give_up(
                UserMessage(
                    "the subject does not answer since the earlier case {id}: {error}",
                    id=case.id,
                    error=error,
                )
            )
        except CaseInconclusive as error:
            self.give_up(
                UserMessage(
                    "the subject cannot be tested since case {id}: {error}", id=case.id, error=error
                )
            )
