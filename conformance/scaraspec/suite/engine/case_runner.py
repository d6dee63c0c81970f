"""Bracket: runs each case between positive controls, and keeps what came of it.

pytest collects and calls, hypothesis draws; verdicts are made here from what a case raised, what it
tolerated, and whether its subject was alive before and after. What the judge saw meanwhile is
joined to it in `run`.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import pytest
from _pytest.runner import runtestprotocol
from hypothesis.errors import Flaky

from scaraspec.judge.verdicts import Cause, Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role
from scaraspec.suite.engine.case import Case, case_of, declare_mark, is_case
from scaraspec.suite.engine.connection import Connection
from scaraspec.suite.engine.examples import counted
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    Unreadable,
)
from scaraspec.suite.engine.hypothesis_profile import Drawing
from scaraspec.suite.engine.journal import JournalError
from scaraspec.suite.engine.plan import Options, wanted, why_not
from scaraspec.suite.engine.system_under_test import SystemUnderTest
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.user_message import UserMessage

_NS: Final = 1e9
_SENTENCE: Final = 500
_ATTEMPTS: Final = 3
_WATCH_S: Final = 2.0
_WATCH_MOST_S: Final = 10.0
_WATCH_AGAIN_MOST_S: Final = 30.0
_TIMES: Final = 2.0
"""For how long a subject is watched after a failure: at least, at most, by the time of the case."""
_LONGER: Final = 1.5
_REPEATS: Final = 2
"""How often a case has to pass that failed: a fault may depend on the time of day."""
_STOP_WORKS: Final = ("4.17/6", "4.17/7")
"""Requirements whose failure means that the emergency stop was refused, or had no effect."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a case.

    Attributes:
        case: The case.
        verdict: ``none`` where it did not run.
        requirement: Which of its requirements was violated; empty where none was.
        cause: Who is responsible where it is no pass.
        message: One sentence.
        expected: What the document leads to expect.
        observed: What was there instead.
        duration_s: How long it took, on the subject's clock.
        examples: For how many values it was tried; 0 where it is about one thing.
        frames: What passed last.
        readings: What it tolerated, by key and option.
    """

    case: Case
    verdict: Verdict
    requirement: str = ""
    cause: Cause | None = None
    message: str = ""
    expected: str = ""
    observed: str = ""
    duration_s: float = 0.0
    examples: int = 0
    frames: tuple[FrameSeen | InvalidBytes, ...] = ()
    readings: tuple[tuple[str, str], ...] = ()


class CaseRunner:
    """A pytest plugin object for one run against one subject.

    Args:
        subject: The subject; None to collect only.
        role: Whom the cases are to try.
        options: What the tester asks for.
        tell: Called with each outcome as it comes, and how many cases there are.
        loud: Whether pytest reports by itself, too.

    Attributes:
        cases: Those that were collected and are wanted.
        items: The tests that they are.
        announce: Called with each case that begins.
        over: The ids of cases that are over since an earlier sitting.
        before_last: Called ahead of the first case behind which the subject may be gone.
        before_motion: Called ahead of the first case that may move it, also behind a new start.
        watch: Called after a failure, to find out whether another client has caused it: for how
            many seconds at least.
        stood_still_s: For how long nothing happened on this machine since it was asked last.
    """

    def __init__(
        self,
        subject: SystemUnderTest | None,
        role: Role,
        options: Options,
        tell: Callable[[Outcome, int], None] = lambda _outcome, _count: None,
        *,
        loud: bool = False,
    ) -> None:
        self.options = options
        self._subject, self._role = subject, role
        self.outcomes: list[Outcome] = []
        self.cases: list[Case] = []
        self.items: list[pytest.Item] = []
        self.mistakes: list[str] = []
        self._tell, self._loud = tell, loud
        self.announce: Callable[[Case], None] = lambda _case: None
        self.over: frozenset[str] = frozenset()
        self.before_last: Callable[[], None] = lambda: None
        self.before_motion: Callable[[], None] = lambda: None
        self.watch: Callable[[float], None] = lambda _for_s: None
        self.stood_still_s: Callable[[], float] = lambda: 0.0
        self._dead = self._unmoved = ""
        self._drawing = Drawing(options.examples)
        self._at_last = self._ready = self._stop_reported = False
        self._failed: set[str] = set()
        self._sighted: set[str] = set()
        self._raised: BaseException | None = None

    # ------------------------------------------------------------------ pytest's hooks

    def pytest_configure(self, config: pytest.Config) -> None:
        """Name the mark; where nobody reads what pytest tells of a failure, it is told shortly."""
        declare_mark(config)
        if not self._loud:
            config.option.tbstyle = "native"  # the long one reads the case's source each time

    def pytest_sessionstart(self) -> None:
        """Settle how hypothesis draws, as long as the session lasts."""
        self._drawing.begin()

    def pytest_sessionfinish(self) -> None:
        """Let hypothesis draw as before."""
        self._drawing.end()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep what is wanted, the gentle first; a team's own tests stay."""
        own = [item for item in items if not is_case(item)]
        cases = {item: case_of(item) for item in items if is_case(item)}
        ids = [case.id for case in cases.values()]
        if twice := {i for i in ids if ids.count(i) > 1}:
            self.mistakes.append(f"cases of the same name: {', '.join(sorted(twice))}")
        chosen = [item for item in cases if self._tries(cases[item])]
        chosen.sort(key=lambda item: cases[item].turn)
        self.cases = [cases[item] for item in chosen]
        self.items = chosen
        items[:] = own + chosen
        if self._subject is None:
            items.clear()

    def _tries(self, case: Case) -> bool:
        return case.role is self._role and wanted(case, self.options)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """A file of the suite that cannot be read is a mistake of the suite."""
        if report.failed:
            self.mistakes.append(str(report.longrepr))

    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> bool | None:
        """Run one case, or say why not."""
        if not is_case(item):
            return None
        self._end_if_asked()
        case = case_of(item)
        outcome = self._known(case)
        if outcome is None:
            outcome = self._run(case, item, nextitem)
        else:  # pytest has to tear down what it had set up for this one
            item.add_marker(pytest.mark.skip(reason=outcome.message))
            runtestprotocol(item, log=self._loud, nextitem=nextitem)
        if outcome.requirement:
            self._failed.add(outcome.requirement)
        self.outcomes.append(outcome)
        self._tell(outcome, len(self.cases))
        return True

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Keep what a case raised first, as it was raised; what did not run was skipped."""
        report = yield
        if call.excinfo is not None and self._raised is None:
            self._raised = call.excinfo.value
            if isinstance(_innermost(self._raised), CaseInconclusive):
                report.outcome = "skipped"
                report.longrepr = (str(item.path), 0, f"Skipped: {self._raised}")
        return report

    # ------------------------------------------------------------------ fixtures

    @property
    def subject(self) -> SystemUnderTest:
        """Whoever is under test."""
        assert self._subject is not None, "nothing runs without a subject"
        return self._subject

    @pytest.fixture(name="subject")
    def _the_subject(self) -> SystemUnderTest:
        """Whoever is under test."""
        return self.subject

    @pytest.fixture(name="line")
    def _a_line(self) -> Connection:
        """A connection that has logged in."""
        return self.subject.open()

    # ------------------------------------------------------------------ one case

    def _known(self, case: Case) -> Outcome | None:
        """What comes of a case without running it; None if it has to run."""
        if case.id in self.over:
            return Outcome(case, Verdict.NONE, message="it is over since an earlier sitting")
        why = why_not(case, self.options, self.subject.ics)
        if not why and self._failed.issuperset(case.requirements) and not self.options.exhaustive:
            why = UserMessage(
                "{requirements} failed already: --exhaustive goes on",
                requirements=", ".join(case.requirements),
            )
        if why:
            return Outcome(case, Verdict.NONE, cause=Cause.SET_UP, message=why)
        moves = Hazard.MOTION in case.hazards
        why = self._dead or (self._unmoved if moves else "")
        if (moves or case.undefined) and self.subject.stop_failure:
            why = why or f"the emergency stop does not work: {self.subject.stop_failure.message}"
        if why:
            return Outcome(case, Verdict.INCONCLUSIVE, cause=Cause.DEPENDENCY, message=why)
        return None

    def _run(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Outcome:
        """Try a case, and anew where it went wrong while this machine stood still."""
        self.announce(case)
        for _ in range(1 if case.last else _ATTEMPTS):
            self.subject.observer.begin(case.id)
            self.stood_still_s()
            since = len(self.subject.observer.sightings)
            outcome = self._attempt(case, item, nextitem)
            still_s = self.stood_still_s()
            if not still_s or outcome.verdict not in (Verdict.FAIL, Verdict.INCONCLUSIVE):
                again = partial(self._attempt, case, item, nextitem)
                return self._unless_disturbed(outcome, since, again)
            if self._dead:
                break
        message = UserMessage(
            "this machine stood still for {still_s:.1f} s: {message}",
            still_s=still_s,
            message=outcome.message,
        )
        return replace(
            outcome,
            verdict=Verdict.INCONCLUSIVE,
            requirement="",
            cause=Cause.SET_UP,
            message=message,
        )

    def _unless_disturbed(
        self, outcome: Outcome, since: int, again: Callable[[], Outcome]
    ) -> Outcome:
        """The outcome of a case, unless another client may have caused its failure.

        Args:
            outcome: The outcome.
            since: How many sightings of the judge there were before the case.
            again: Repeats the case.
        """
        case, others = outcome.case, self.subject.others
        found = self._found(since)
        if self._dead or case.last or not (outcome.verdict is Verdict.FAIL or found):
            return outcome
        once = Hazard.DESTRUCTIVE in case.hazards
        for_s = max(_WATCH_S, _TIMES * outcome.duration_s)
        for_s = _WATCH_MOST_S if once else min(for_s, _WATCH_MOST_S)
        self.watch(for_s)
        if others.suspected and not others.reason(case.id) and not once:
            self._repeat(again, for_s)
        reason = others.reason(case.id)
        if not reason:
            self._sighted |= found
        return unless_disturbed(outcome, reason)

    def _repeat(self, again: Callable[[], Outcome], watched_s: float) -> None:
        """Repeat a case that has failed: if it passes, another client may be the cause.

        If it fails again, a client that comes every so often has come before and after the time for
        which the subject was watched, so that it shows within a somewhat longer time.
        """
        lasted_s = watched_s
        for _ in range(_REPEATS):
            since = len(self.subject.observer.sightings)
            outcome = again()
            lasted_s += outcome.duration_s
            if outcome.verdict not in (Verdict.PASS, Verdict.TOLERATED) or self._found(since):
                break
        else:
            self.subject.others.passed_again()
            return
        if not self._dead:
            self.watch(min(_LONGER * lasted_s, _WATCH_AGAIN_MOST_S))

    def _found(self, since: int) -> set[str]:
        """Which requirements the judge has seen violated since then, and never before."""
        sightings = self.subject.observer.sightings[since:]
        found = {s.finding.requirement for s in sightings if s.finding.verdict is Verdict.FAIL}
        return found - self._failed - self._sighted

    def _attempt(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Outcome:
        subject = self.subject
        subject.others.begin()
        if case.last and not self._at_last:
            self._at_last = True
            self.before_last()
        if Hazard.MOTION in case.hazards and not self._ready:
            self._ready = True
            self.before_motion()
            self._report_stop(case)
        begun_ns = subject.now_ns
        subject.begin_case()
        self._raised = None
        with counted() as tally:
            runtestprotocol(item, log=self._loud, nextitem=nextitem)
        self._end_if_asked()
        outcome = self._unless_withheld(self._outcome(case))
        if outcome.requirement in _STOP_WORKS:
            subject.stop_has_failed(outcome.requirement, outcome.message)
        self._report_stop(case, outcome)
        frames = subject.observer.evidence
        if case.last:
            subject.close_lines()
        else:
            outcome = self._afterwards(case, outcome)
        self._report_stop(case, outcome)
        duration_s = (subject.now_ns - begun_ns) / _NS
        return replace(
            outcome,
            duration_s=duration_s,
            examples=tally.examples,
            frames=outcome.frames or frames,
        )

    def _end_if_asked(self) -> None:
        """End the run where nobody did, though it was asked for.

        What a signal raises is lost where garbage is collected, and hypothesis tells it among what
        else a case has raised.

        Raises:
            KeyboardInterrupt: The tester wants it to end.
        """
        if self.subject.observer.interruption.asked or _was_ended(self._raised):
            raise KeyboardInterrupt

    def _outcome(self, case: Case) -> Outcome:
        """The verdict of what the case raised."""
        raised = _innermost(self._raised)
        if raised is None and self.subject.untried:
            raised = CaseSkipped(self.subject.untried)
        match raised:
            case None:
                pass
            case CaseSkipped():
                return Outcome(case, Verdict.NONE, cause=Cause.SET_UP, message=f"{raised}")
            case CaseInconclusive():
                if isinstance(raised, JournalError):
                    self.give_up(str(raised))
                return Outcome(case, Verdict.INCONCLUSIVE, cause=Cause.SET_UP, message=f"{raised}")
            case CaseFailed():
                return Outcome(
                    case,
                    Verdict.FAIL,
                    raised.requirement or case.requirements[0],
                    Cause.SUBJECT,
                    f"{raised}",
                    raised.expected,
                    raised.observed,
                )
            case _:
                message = f"the case broke down: {type(raised).__name__}: {raised}"[:_SENTENCE]
                return Outcome(case, Verdict.ERROR, cause=Cause.SUITE, message=message)
        if self.subject.tolerated:
            readings = tuple((key, option) for _, key, option, _ in self.subject.tolerated)
            message, observed = self.subject.tolerated[0][3], " = ".join(readings[0])
            return Outcome(
                case, Verdict.TOLERATED, message=message, observed=observed, readings=readings
            )
        return Outcome(case, Verdict.PASS, message=case.sentence)

    def _report_stop(self, case: Case, outcome: Outcome | None = None) -> None:
        """Say first, and once, that the emergency stop does not work.

        It is a failure of its own, unless the running case has failed of it.

        Args:
            case: The running case, or the one that is about to run.
            outcome: What came of it.
        """
        failure = self.subject.stop_failure
        if failure is None or self._stop_reported:
            return
        self._stop_reported = True
        self.subject.notify(
            UserMessage(
                "THE EMERGENCY STOP DOES NOT WORK: {message}. No motion was requested after "
                "that; the cases concerned are inconclusive",
                message=failure.message,
            )
        )
        if outcome and outcome.requirement.startswith("4.17/"):
            return
        when = "in" if outcome else "before"
        own = Outcome(
            Case("run.emergency-stop", (failure.requirement,), case.hazards),
            Verdict.FAIL,
            failure.requirement,
            Cause.SUBJECT,
            f"the emergency stop does not work: {failure.message}; found {when} case {case.id}",
            failure.expected,
            failure.observed,
            frames=self.subject.observer.evidence,
        )
        self.outcomes.append(own)
        self._tell(own, len(self.cases))

    def _unless_withheld(self, outcome: Outcome) -> Outcome:
        """The outcome of a case, unless a request of it was not sent.

        What a case finds of the stop itself it has found before.
        """
        withheld = self.subject.withheld
        if not withheld or outcome.requirement.startswith("4.17/"):
            return outcome
        return Outcome(outcome.case, Verdict.INCONCLUSIVE, cause=Cause.DEPENDENCY, message=withheld)

    def _afterwards(self, case: Case, outcome: Outcome) -> Outcome:
        """The positive control behind a case: the subject is alive and at rest again."""
        subject = self.subject
        try:
            subject.settle()
        except (NoReply, CaseFailed) as error:
            self._revive(case)
            if outcome.verdict is Verdict.FAIL:
                return outcome
            message = UserMessage("the subject did not survive the case: {error}", error=error)
            observed = error.observed
            expected = "a connection, a login and get_status go through afterwards"
            frames = subject.observer.evidence
            return Outcome(
                case,
                Verdict.FAIL,
                subject.survival or case.requirements[0],
                Cause.SUBJECT,
                message,
                expected,
                observed,
                frames=frames,
            )
        except CaseInconclusive as error:
            if isinstance(error, Unreadable):
                self._unmoved = f"before this case, since case {case.id}: {error}"
            else:
                self._revive(case)
            if outcome.verdict in (Verdict.FAIL, Verdict.ERROR):
                return outcome
            return Outcome(case, Verdict.INCONCLUSIVE, cause=Cause.SET_UP, message=f"{error}")
        return outcome

    def give_up(self, why: str) -> None:
        """The subject is dead: no further case can find out anything."""
        self._dead = why

    def _revive(self, case: Case) -> None:
        """Start the subject anew, where a hook can."""
        subject = self.subject
        try:
            subject.revive()
            self._ready = False
            subject.settle()
        except CaseFailed as error:
            self.give_up(
                UserMessage(
                    "the subject served nobody before this case, since {id}: {error}",
                    id=case.id,
                    error=error,
                )
            )
        except CaseInconclusive as error:
            self.give_up(
                UserMessage("before this case, since case {id}: {error}", id=case.id, error=error)
            )


def unless_disturbed(outcome: Outcome, reason: str) -> Outcome:
    """An outcome, which is inconclusive if there is a reason why a failure does not count."""
    if outcome.verdict is not Verdict.FAIL or not reason:
        return outcome
    return replace(
        outcome,
        verdict=Verdict.INCONCLUSIVE,
        requirement="",
        cause=Cause.SET_UP,
        message=f"{reason}. The case had found: {outcome.message}",
    )


def _was_ended(raised: BaseException | None) -> bool:
    """Whether whoever runs pytest ended it, as hypothesis tells among the failures of a case."""
    return isinstance(raised, BaseExceptionGroup) and bool(raised.subgroup(KeyboardInterrupt))


def _innermost(raised: BaseException | None) -> BaseException | None:
    """What a case raised, out of what hypothesis wraps it in where it does not recur."""
    if isinstance(raised, BaseExceptionGroup):
        inner = [_innermost(each) for each in raised.exceptions]
        return next(
            (each for each in inner if isinstance(each, CaseFailed | CaseInconclusive)), inner[0]
        )
    if isinstance(raised, Flaky) and raised.__cause__:
        return _innermost(raised.__cause__)
    return raised
