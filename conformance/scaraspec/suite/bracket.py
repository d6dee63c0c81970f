"""Bracket: runs each case between positive controls, and keeps what came of it.

pytest collects and calls, hypothesis draws; verdicts are made here from what a case raised, what it
tolerated, and whether its subject was alive before and after. What the judge saw meanwhile is
joined to it in `run`.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Final

import pytest
from _pytest.runner import runtestprotocol
from hypothesis.errors import Flaky

from scaraspec.judgement.happenings import FrameSeen, Undecodable
from scaraspec.judgement.verdicts import Cause, Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role
from scaraspec.suite.case import Case, case_of, declare_mark, is_case
from scaraspec.suite.drawing import Drawing
from scaraspec.suite.engine.journal import JournalError
from scaraspec.suite.examples import counted
from scaraspec.suite.expect import NoAnswer, NotRun, Undecided, Unmet, Unreadable
from scaraspec.suite.party import Party
from scaraspec.suite.plan import Options, wanted, why_not
from scaraspec.suite.wire import Wire

_NS: Final = 1e9
_SENTENCE: Final = 500
_ATTEMPTS: Final = 3


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
    frames: tuple[FrameSeen | Undecodable, ...] = ()
    readings: tuple[tuple[str, str], ...] = ()


class Bracket:
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
        stood_still_s: For how long nothing happened on this machine since it was asked last.
    """

    def __init__(
        self,
        subject: Party | None,
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
        self.stood_still_s: Callable[[], float] = lambda: 0.0
        self._dead = self._unmoved = ""
        self._drawing = Drawing(options.examples)
        self._at_last = self._ready = False
        self._failed: set[str] = set()
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
            if isinstance(_innermost(self._raised), Undecided):
                report.outcome = "skipped"
                report.longrepr = (str(item.path), 0, f"Skipped: {self._raised}")
        return report

    # ------------------------------------------------------------------ fixtures

    @property
    def subject(self) -> Party:
        """Whoever is under test."""
        assert self._subject is not None, "nothing runs without a subject"
        return self._subject

    @pytest.fixture(name="subject")
    def _the_subject(self) -> Party:
        """Whoever is under test."""
        return self.subject

    @pytest.fixture(name="line")
    def _a_line(self) -> Wire:
        """A connection that has logged in."""
        return self.subject.open()

    # ------------------------------------------------------------------ one case

    def _known(self, case: Case) -> Outcome | None:
        """What comes of a case without running it; None if it has to run."""
        if case.id in self.over:
            return Outcome(case, Verdict.NONE, message="it is over since an earlier sitting")
        why = why_not(case, self.options, self.subject.statement)
        if not why and self._failed.issuperset(case.requirements) and not self.options.exhaustive:
            why = f"{', '.join(case.requirements)} failed already: --exhaustive goes on"
        if why:
            return Outcome(case, Verdict.NONE, cause=Cause.SET_UP, message=why)
        why = self._dead or (self._unmoved if Hazard.MOTION in case.hazards else "")
        if why:
            return Outcome(case, Verdict.INCONCLUSIVE, cause=Cause.DEPENDENCY, message=why)
        return None

    def _run(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Outcome:
        """Try a case, and anew where it went wrong while this machine stood still."""
        self.announce(case)
        for _ in range(1 if case.last else _ATTEMPTS):
            self.subject.observer.begin(case.id)
            self.stood_still_s()
            outcome = self._attempt(case, item, nextitem)
            still_s = self.stood_still_s()
            if not still_s or outcome.verdict not in (Verdict.FAIL, Verdict.INCONCLUSIVE):
                return outcome
            if self._dead:
                break
        message = f"this machine stood still for {still_s:.1f} s: {outcome.message}"
        return replace(
            outcome,
            verdict=Verdict.INCONCLUSIVE,
            requirement="",
            cause=Cause.SET_UP,
            message=message,
        )

    def _attempt(self, case: Case, item: pytest.Item, nextitem: pytest.Item | None) -> Outcome:
        subject = self.subject
        if case.last and not self._at_last:
            self._at_last = True
            self.before_last()
        if Hazard.MOTION in case.hazards and not self._ready:
            self._ready = True
            self.before_motion()
        begun_ns = subject.now_ns
        subject.tolerated.clear()
        self._raised = None
        with counted() as tally:
            runtestprotocol(item, log=self._loud, nextitem=nextitem)
        self._end_if_asked()
        outcome = self._outcome(case)
        frames = subject.observer.evidence
        if case.last:
            subject.close_lines()
        else:
            outcome = self._afterwards(case, outcome)
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
            raised = NotRun(self.subject.untried)
        match raised:
            case None:
                pass
            case NotRun():
                return Outcome(case, Verdict.NONE, cause=Cause.SET_UP, message=f"{raised}")
            case Undecided():
                if isinstance(raised, JournalError):
                    self.give_up(f"{raised}")
                return Outcome(case, Verdict.INCONCLUSIVE, cause=Cause.SET_UP, message=f"{raised}")
            case Unmet():
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

    def _afterwards(self, case: Case, outcome: Outcome) -> Outcome:
        """The positive control behind a case: the subject is alive and at rest again."""
        subject = self.subject
        try:
            subject.settle()
        except (NoAnswer, Unmet) as error:
            self._revive(case)
            if outcome.verdict is Verdict.FAIL:
                return outcome
            message = f"the subject did not survive the case: {error}"
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
        except Undecided as error:
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
        except Unmet as error:
            self.give_up(f"the subject served nobody before this case, since {case.id}: {error}")
        except Undecided as error:
            self.give_up(f"before this case, since case {case.id}: {error}")


def _was_ended(raised: BaseException | None) -> bool:
    """Whether whoever runs pytest ended it, as hypothesis tells among the failures of a case."""
    return isinstance(raised, BaseExceptionGroup) and bool(raised.subgroup(KeyboardInterrupt))


def _innermost(raised: BaseException | None) -> BaseException | None:
    """What a case raised, out of what hypothesis wraps it in where it does not recur."""
    if isinstance(raised, BaseExceptionGroup):
        inner = [_innermost(each) for each in raised.exceptions]
        return next((each for each in inner if isinstance(each, Unmet | Undecided)), inner[0])
    if isinstance(raised, Flaky) and raised.__cause__:
        return _innermost(raised.__cause__)
    return raised
