"""Run: the suite against one subject, from the first byte to the results.

pytest runs the shipped cases in this process. The judge watches all traffic. Its findings are
joined to the outcomes of the cases, and a requirement gets the most severe verdict of both.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any, Final, Generic

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Cause, Reason, Verdict, conclude, worst
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import READINGS
from scaraspec.report import model
from scaraspec.report.audit import readings_of
from scaraspec.report.evidence import evidence_of, step_of
from scaraspec.report.fingerprint import document_lines, fingerprint
from scaraspec.report.model import Case, ReadingSeen, RequirementResult, Results, Role, Tool
from scaraspec.report.root_causes import root_causes
from scaraspec.report.session import SessionStats
from scaraspec.suite.engine import case as cases
from scaraspec.suite.engine.case_runner import Callbacks, CaseRunner
from scaraspec.suite.engine.collection import CASES, METHODS, cases_in
from scaraspec.suite.engine.coverage import hook_notices, shortfall, undecided_notices
from scaraspec.suite.engine.earlier_sitting import EarlierSitting
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.journal import JournalError
from scaraspec.suite.engine.observer import CaseFinding, Observer, Take, sending_direction
from scaraspec.suite.engine.outcome import Outcome, unless_disturbed
from scaraspec.suite.engine.passive_findings import grouped, is_confirmed, undecided
from scaraspec.suite.engine.plan import is_selected, item_of
from scaraspec.suite.engine.pytest_session import run_pytest
from scaraspec.suite.engine.repeated_cases import repeated_cases
from scaraspec.suite.engine.role_adapter import P, RoleAdapter
from scaraspec.suite.engine.stall_detector import Stall, StallDetector, threshold_s
from scaraspec.suite.engine.unsupported_claims import (
    excluded_requirements,
    unverified_notices,
    wrong_claims,
)
from scaraspec.user_message import UserMessage, sentence_of


class Run(Generic[P]):
    """One run of the suite.

    `results` does everything. A caller that runs pytest itself calls `begin` before and `end`
    after it.

    Args:
        adapter: The subject, and how it is tested.
        earlier: The results of an interrupted run with the same subject and settings (see
            `earlier_sitting.difference`). Its completed cases do not run again.
        take: Receives every wire event, for a recording.
        report: Called with each outcome and the number of cases.
        announce: Called with each case before it runs.
        begun: Called once with the measured round trip in seconds, before the first case.
        stalls: Returns the stalls of this machine since the last call; by default the run measures
            them, unless the subject uses a simulated clock.
        interruption: Ends the run early, when it is asked to; None for a new one.

    Attributes:
        case_runner: Runs the cases.
        interruption: Ends the run early.
        start_failure: Why the subject could not be used at the start; empty if it could.
    """

    def __init__(  # noqa: PLR0913 - the collaborators of a run
        self,
        adapter: RoleAdapter[P],
        *,
        earlier: Results | None = None,
        take: Take = lambda _: None,
        report: Callable[[Outcome, int], None] = lambda _outcome, _count: None,
        announce: Callable[[cases.Case], None] = lambda _case: None,
        begun: Callable[[float], None] = lambda _round_trip_s: None,
        stalls: Callable[[], Sequence[Stall]] | None = None,
        interruption: Interruption | None = None,
    ) -> None:
        self.adapter = adapter
        self._stats = SessionStats()
        self._observer = Observer(
            adapter.role,
            adapter.ics,
            needs_login=adapter.needs_login,
            take=take,
            handle=self._stats.add,
            interruption=interruption,
        )
        self.interruption = self._observer.interruption
        self._subject = adapter.subject(self._observer)
        self._earlier = EarlierSitting(earlier)
        self._resources = ExitStack()
        self._stall_detector: StallDetector | None = None
        if stalls is None and adapter.real_time:
            limit_s = threshold_s(adapter.ics.time_scale, adapter.ics.transfer_s)
            self._stall_detector = StallDetector(limit_s)
            stalls = self._stall_detector.stalls
        self.case_runner = CaseRunner(
            self._subject,
            adapter.role,
            adapter.options,
            CASES[adapter.role],
            Callbacks(
                report=report,
                announce=announce,
                before_last=self._put_back,
                before_motion=partial(adapter.make_ready, self._subject),
                watch=partial(adapter.watch, self._subject),
                stalls=stalls or tuple,
            ),
            completed=frozenset(self._earlier.cases),
        )
        self._state: Mapping[str, Any] = {}
        self._begun_ns, self._report_begun = self._subject.now_ns, begun
        self.start_failure = ""
        self._problems: list[str] = []

    def results(self) -> Results:
        """Run the shipped cases and return the results.

        Raises:
            SuiteError: The suite itself is defective.
            JournalError: The state of the subject cannot be written to the journal.
            RecoveryError: Changes of an interrupted run cannot be restored.
            KeyboardInterrupt: The user interrupted the run twice.
        """
        interrupted = False
        try:
            self.begin()
            self._try_cases()
        except KeyboardInterrupt:
            interrupted = True
        finally:
            self.end(interrupted=interrupted)
        return self.build_results()

    def _try_cases(self) -> None:
        role, options = self.adapter.role, self.adapter.options
        files = {file for case, file in cases_in(CASES[role], role) if is_selected(case, options)}
        if files:  # without any, pytest would look for tests elsewhere
            run_pytest(self.case_runner, role, options, *sorted(files))

    def begin(self) -> None:
        """Write the state of the subject to the journal and probe its open points.

        Raises:
            JournalError: The state cannot be written to the journal.
            RecoveryError: Changes of an interrupted run cannot be restored.
        """
        if self._stall_detector:
            self._resources.enter_context(self._stall_detector)
        try:
            self._state = self._begun()
            if round_trip_s := self._stats.round_trip_s:
                self._report_begun(round_trip_s)
            self.adapter.probe(self._subject)
        except JournalError:
            raise
        except (CaseFailed, CaseInconclusive) as error:
            self._subject.close_lines()
            self.start_failure = UserMessage(
                "the subject could not be used at the start of the run: {error}", error=error
            )
            self.case_runner.give_up(self.start_failure)

    def _begun(self) -> Mapping[str, Any]:
        """The state of the subject; a client that reports a wrong state has failed.

        A second attempt is made, for a controller only if a message was missing or late.
        """
        try:
            return self.adapter.begin(self._subject)
        except CaseFailed as error:
            if self.adapter.role is Role.CONTROLLER:
                if not self._observer.attempt.late:
                    raise
            elif error.requirement:
                self.case_runner.outcomes.append(_wrong_from_the_start(error))
            else:
                raise
            self._subject.close_lines()
            return self.adapter.begin(self._subject)

    def end(self, *, interrupted: bool = False) -> None:
        """Restore everything. A difference that remains is reported and stays in the journal.

        Args:
            interrupted: The user has interrupted the run. Otherwise one interruption does not end
                the restoration.

        Raises:
            KeyboardInterrupt: The user interrupted the run twice.
        """
        if interrupted:
            self.case_runner.outcomes.append(
                _set_up("interrupted", "the user interrupted the run", Reason.INTERRUPTED)
            )
        try:
            self._end()
        except KeyboardInterrupt:
            if interrupted:
                raise
            self._subject.close_lines()
            self._end()  # complete the restoration, unless the user interrupts it again

    def _end(self) -> None:
        if not self._subject.off:  # otherwise it was restored before it was switched off
            self._put_back()
        self._problems += self.adapter.finish(self._subject, self._state)
        self.case_runner.outcomes += [
            _set_up("restore", problem, Reason.NOT_RESTORED) for problem in self._problems
        ]
        self._observer.close()
        self._resources.close()

    def _put_back(self) -> None:
        attempt = self._observer.attempt
        self._observer.begin("")
        self._problems = self.adapter.put_back(self._subject, self._state)
        self._subject.close_lines()
        self._observer.attempt = attempt

    def build_results(self) -> Results:
        """Build the results from the outcomes and from the findings of the judge."""
        reason = self._subject.others.reason
        ran = (unless_disturbed(o, reason(o.case.id)) for o in self.case_runner.outcomes)
        outcomes = (*ran, *self._wrong_claims())
        earlier, ids = self._earlier.cases, {o.case.id for o in outcomes}
        tried = [earlier.get(o.case.id) or self._case(o) for o in outcomes]
        tried += wrong_claims(self._subject.served, self._replay())
        before = [case for key, case in earlier.items() if key not in ids]
        findings = self._observer.findings
        groups = grouped(findings, (case for case in before if model.SEEN in case.id))
        made = (*tried, *before, *(self._seen(n, same) for n, same in groups))
        unsettled = dict(Counter(self._earlier.undecided) + Counter(undecided(findings)))
        by_requirement: defaultdict[str, list[Case]] = defaultdict(list)
        for each in made:
            for requirement in each.requirements:
                by_requirement[requirement].append(each)
        adapter = self.adapter
        verdicts = {i: worst(c.verdict for c in cases) for i, cases in by_requirement.items()}
        scope = self._scope()
        requirements = tuple(
            RequirementResult(
                entry.id,
                verdicts.get(entry.id, Verdict.NONE),
                tuple(case.id for case in by_requirement[entry.id]),
            )
            for entry in REQUIREMENTS.values()
            if entry.id in scope or verdicts.get(entry.id) in _SHOWN_OUT_OF_SCOPE
        )
        if lacking := shortfall(requirements, adapter.options):
            made = (*made, self._case(_set_up("coverage", lacking, Reason.COVERAGE)))
        return Results(
            tool=Tool.own(),
            subject=model.Subject(
                adapter.role,
                adapter.ics.name,
                adapter.ics.version,
                adapter.link,
                adapter.capture,
                adapter.ics.summary,
                self._subject.complaints,
            ),
            role=adapter.role,
            verdict=conclude(
                Counter(each.verdict for each in made),
                complete=all(each.decided for each in requirements),
            ),
            counts=dict.fromkeys(Verdict, 0) | Counter(each.verdict for each in made),
            readings={adapter.role.value: self._dialect()},
            requirements=requirements,
            cases=made,
            session=self._stats.session(),
            notices=(
                *self._subject.notices,
                *unverified_notices(self._subject),
                *hook_notices(outcomes, requirements),
                *undecided_notices(unsettled),
            ),
            undecided=unsettled,
            causes=root_causes(made, adapter.role),
            run=model.RunInfo(
                self._begun_ns,
                self._subject.now_ns,
                adapter.options.seed,
                adapter.settings,
            ),
        )

    def _scope(self) -> frozenset[str]:
        """The requirements that this run is about: all of the role, or those of `only`.

        Requirements of commands that are verified to be unsupported are not in scope.
        """
        options, method = self.adapter.options, METHODS[self.adapter.role]
        if options.only is None:
            testable = frozenset(e.id for e in REQUIREMENTS.values() if method in e.testable)
            return testable - excluded_requirements(self._subject.served)
        chosen = [case for case in self.case_runner.cases if case.id in options.cases]
        return options.only.union(*(case.requirements for case in chosen))

    def _dialect(self) -> dict[str, ReadingSeen]:
        """Return the observed readings by key, or else those that a case tolerated."""
        readings = self._readings()
        seen_options = {*chain.from_iterable(o.readings for o in self.case_runner.outcomes)}
        seen_options |= {s.finding.reading for s in self._observer.findings if s.finding.reading}
        for key, reading in READINGS.items():
            seen = readings.get(key, ReadingSeen((), default=False, mixed=False))
            options = tuple(o.name for o in reading.options if (key, o.name) in seen_options)
            if options and not seen.options:
                readings[key] = replace(
                    seen, options=options, default=options == (reading.default,)
                )
        readings = self._earlier.with_readings(readings)
        return {key: readings[key] for key in READINGS if key in readings}

    def _readings(self) -> dict[str, ReadingSeen]:
        """Return the readings that the judge or a probe observed, with the claims of the ICS.

        A probe shows what the subject accepts. What the subject itself sends takes precedence.
        """
        ics = self.adapter.ics
        claims = {key: ics.dialect[key] for key in ics.claimed}
        readings = dict(
            readings_of(self._observer.judge, sending_direction(self.adapter.role), claims)
        )
        for key, option in self._subject.detected_readings.items():
            if key == "endian" and key in readings and readings[key].options:
                continue
            default = option == READINGS[key].default
            readings[key] = ReadingSeen((option,), default, mixed=False, claimed=claims.get(key))
        return readings

    def _wrong_claims(self) -> Iterator[Outcome]:
        """Yield a failure for each claimed reading that contradicts an observation."""
        seen_options = {outcome.observed for outcome in self.case_runner.outcomes}
        for key, seen in self._readings().items():
            if seen.claimed is None:
                continue
            named = (o for o in ("silence", seen.claimed) if f"{key} = {o}" in seen_options)
            options = (*seen.options, *named)  # a case need not wait until silence is sure
            if not options or seen.claimed in options:
                continue
            if key == "busy_reply" and seen.claimed == "queue" and {*options} == {"silence"}:
                continue  # a queued request has no reply until then
            if key == "op_get_default" and self._serves(seen):
                continue
            if key == "default_none" and self.adapter.ics.dialect["on_unknown"] == "0":
                continue  # the reply to the undefined one of 0x0D and 0x13 is the same
            if READINGS[key].unit is None:
                message = UserMessage(
                    "the ICS claims {key} = {claimed}, but the subject behaves differently",
                    key=key,
                    claimed=seen.claimed,
                )
                yield Outcome(
                    cases.Case(f"claim.{key}", (), frozenset({Hazard.READ_ONLY})),
                    Verdict.FAIL,
                    cause=Cause.SUBJECT,
                    message=message,
                    expected=seen.claimed,
                    observed=" and ".join(dict.fromkeys(options)),
                )

    def _serves(self, seen: ReadingSeen) -> bool:
        """Whether a claim about opcodes may be true although other opcodes were observed."""
        if seen.claimed == "both":  # each is observed separately, and perhaps only one was sent
            return "op_get_default" not in self._subject.detected_readings
        return seen.claimed == "0x0D" and "both" in seen.options

    def _case(self, outcome: Outcome) -> Case:
        """Convert an outcome to a case of the results."""
        case = outcome.case
        wire = tuple(evidence_of(seen) for seen in outcome.frames)
        bad = outcome.verdict is Verdict.FAIL
        failed = (outcome.requirement,) if outcome.requirement else case.requirements
        return Case(
            id=case.id,
            requirements=failed,
            verdict=outcome.verdict,
            cause=outcome.cause,
            hazard=case.hazard,
            message=outcome.message,
            expected=outcome.expected,
            observed=outcome.observed,
            begin_ns=outcome.begin_ns,
            duration_s=outcome.duration_s,
            examples=outcome.examples,
            replay=self._replay_of(outcome),
            wire=() if outcome.verdict in (Verdict.NONE, Verdict.PASS) else wire,
            passing=self._stats.evidence.passing(wire) if bad else (),
            attempts=outcome.attempts,
            operator=outcome.operator,
            reason=outcome.reason,
            lines=document_lines(failed),
            fingerprint=fingerprint(case.id, outcome.requirement, outcome.message),
            title=case.sentence,
            step=outcome.step,
        )

    def _seen(self, number: int, findings: list[CaseFinding]) -> Case:
        """Convert equal findings of the judge to a case of the results."""
        disturbance = self._subject.others.reason
        findings = [f for f in findings if not disturbance(f.case)] or findings
        first = findings[0]
        finding, reason = first.finding, None
        if finding.verdict is Verdict.FAIL and (doubt := disturbance(first.case)):
            reason = Reason.OTHER_CLIENT
            message = UserMessage(
                "{doubt}. The judge had found: {message}", doubt=doubt, message=finding.message
            )
        elif finding.verdict is Verdict.FAIL and not is_confirmed(findings):
            reason = Reason.INTERMITTENT
            message = UserMessage(
                "intermittent: found in one attempt only, in which a message was missing or late: "
                "{message}",
                message=finding.message,
            )
        if reason:
            finding = replace(
                finding, verdict=Verdict.INCONCLUSIVE, cause=Cause.SET_UP, message=message
            )
        wire = tuple(self._stats.evidence.evidence(p) for p in finding.evidence[:_SHOWN])
        failed = finding.verdict is Verdict.FAIL
        step = step_of(wire, finding.observed)
        return Case(
            id=f"{finding.requirement}{model.SEEN}{number}",
            requirements=(finding.requirement,),
            verdict=finding.verdict,
            cause=finding.cause,
            message=_with_place(finding.message, first.case, len(findings)),
            expected=finding.expected,
            observed=finding.observed or " = ".join(finding.reading or ()),
            replay=self._replay(*self._repeated(first.case, finding.requirement)),
            wire=wire,
            passing=self._stats.evidence.passing(wire) if failed else (),
            reason=reason,
            lines=document_lines((finding.requirement,)),
            fingerprint=fingerprint(
                finding.requirement, finding.requirement, first.finding.message
            ),
            title=REQUIREMENTS[finding.requirement].sentence,
            step=replace(step, time_ns=first.begin_ns) if failed else None,
        )

    def _replay_of(self, outcome: Outcome) -> str:
        """Return the command that repeats a case; the whole run if it is no case."""
        case = outcome.case
        if case.id.startswith(("run.", "claim.")):
            return self._replay()
        return self._replay(*self._repeated(case.id, outcome.requirement))

    def _repeated(self, case: str, requirement: str) -> tuple[str, ...]:
        if not case:
            return (requirement,)
        if not requirement:
            return (item_of(case),)
        repeated = repeated_cases(case, requirement, self.case_runner.outcomes)
        return tuple(map(item_of, repeated))

    def _replay(self, *selected: str) -> str:
        replay = self.adapter.replay
        only = f" --only {','.join(selected)}" if selected else ""
        return f"{replay}{only}" if replay else ""


_SHOWN: Final = 12
_SHOWN_OUT_OF_SCOPE: Final = (Verdict.INCONCLUSIVE, Verdict.FAIL, Verdict.ERROR)


def _with_place(message: str, case: str, count: int) -> str:
    """Return the message of a finding with the first case and the number of its occurrences."""
    if case:
        message = UserMessage.joined(message, "; first seen in case {first_case}", first_case=case)
    return UserMessage.joined(message, ", {count} times", count=count) if count > 1 else message


def _set_up(name: str, message: str, reason: Reason) -> Outcome:
    """The outcome of a problem of the run itself, which makes the run incomplete."""
    case = cases.Case(f"run.{name}", (), frozenset({Hazard.READ_ONLY}))
    return Outcome(case, Verdict.INCONCLUSIVE, cause=Cause.SET_UP, message=message, reason=reason)


def _wrong_from_the_start(error: CaseFailed) -> Outcome:
    """Return the outcome for a client that reports a wrong state, or none, of an idle robot."""
    case = cases.Case("run.begin", (), frozenset({Hazard.READ_ONLY}))
    wrong = (error.requirement, Cause.SUBJECT, sentence_of(error), error.expected, error.observed)
    return Outcome(case, Verdict.FAIL, *wrong)
