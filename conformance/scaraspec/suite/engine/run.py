"""Run: the suite against one subject, from the first byte to the results.

pytest runs the shipped cases in this process; the findings of the judge that watched are joined to
their outcomes, so that a requirement's verdict is the gravest of both.
"""

import os
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Any, Final, Generic, Protocol, TypeVar

import pytest

from scaraspec.judge.requirements import REQUIREMENTS, Method
from scaraspec.judge.verdicts import Cause, Verdict, conclude, worst
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import READINGS
from scaraspec.report import model
from scaraspec.report.audit import readings_of
from scaraspec.report.evidence import exhibit
from scaraspec.report.model import Case, ReadingSeen, RequirementResult, Results, Role, Tool
from scaraspec.report.session import SessionStats
from scaraspec.suite.engine import case as cases
from scaraspec.suite.engine.case_runner import CaseRunner, Outcome, unless_disturbed
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import JournalError
from scaraspec.suite.engine.observer import Observer, Sighting, Take, speaks
from scaraspec.suite.engine.plan import Options, wanted
from scaraspec.suite.engine.system_under_test import SystemUnderTest
from scaraspec.user_message import UserMessage

CASES: Final = {
    role: Path(__file__).parents[1] / role.value / "cases"
    for role in (Role.CONTROLLER, Role.CLIENT)
}
"""Where the shipped cases are."""

METHODS: Final = {Role.CONTROLLER: Method.ACTIVE_CONTROLLER, Role.CLIENT: Method.ACTIVE_CLIENT}
"""How a subject is tested."""


def collect(options: Options, role: Role = Role.CONTROLLER) -> list[cases.Case]:
    """The cases for subjects of this role that `options` ask for, without any subject.

    Raises:
        SuiteError: The suite itself is broken.
    """
    return [case for case, _ in _cases_in(CASES[role], role) if wanted(case, options)]


class SuiteError(Exception):
    """The suite cannot be run; the text says what is broken."""


P = TypeVar("P", bound=SystemUnderTest)


class RoleAdapter(Protocol[P]):
    """What a run is about."""

    @property
    def role(self) -> Role:
        """What the subject is."""

    @property
    def ics(self) -> Ics:
        """What it claims."""

    @property
    def options(self) -> Options:
        """What the tester asks for."""

    @property
    def link(self) -> str:
        """How to call the way to it, in the results."""

    @property
    def capture(self) -> str:
        """The file in which it is recorded, beside the results; empty for none."""

    @property
    def replay(self) -> str:
        """The command line that runs the suite again, without ``--only``."""

    @property
    def needs_login(self) -> bool:
        """Whether a login comes first; a serial link needs none (L83)."""

    def subject(self, observer: Observer) -> P:
        """The subject."""

    def begin(self, subject: P) -> Mapping[str, Any]:
        """Find out what has to be put back: what this gives is given to `put_back`.

        Raises:
            CaseFailed: The subject is not there.
            CaseInconclusive: It cannot be dealt with.
            JournalError: What it is like cannot be written down.
        """

    def probe(self, subject: P) -> None:
        """Find out how it is to be spoken to.

        Raises:
            CaseFailed: It is gone.
            CaseInconclusive: It cannot be dealt with.
        """

    def make_ready(self, subject: P) -> None:
        """Make it ready to move."""

    def watch(self, subject: P, for_s: float) -> None:
        """Watch for so many seconds whether another client has caused the failure of a case."""

    def put_back(self, subject: P, state: Mapping[str, Any]) -> list[str]:
        """Leave all as it was found; what could not be is told."""

    def finish(self, subject: P, state: Mapping[str, Any]) -> list[str]:
        """End the run, after everything was put back; what is still to be done is told."""


class Run(Generic[P]):
    """One run of the suite; whoever runs pytest himself calls `begin` before and `end` after it.

    Args:
        setting: What it is about.
        earlier: What an interrupted run of the same found out, which is not tried again.
        take: Is given every wire event: a recording.
        tell: Is told each outcome as it comes, and of how many.
        loud: Whether pytest reports by itself, too.

    Attributes:
        bracket: Runs the cases.
        interruption: Ends it before its end.
    """

    def __init__(
        self,
        setting: RoleAdapter[P],
        *,
        earlier: Results | None = None,
        take: Take = lambda _: None,
        tell: Callable[[Outcome, int], None] = lambda _outcome, _count: None,
        loud: bool = False,
    ) -> None:
        self.setting = setting
        self._stats = SessionStats()
        self._observer = Observer(
            setting.role,
            setting.ics,
            needs_login=setting.needs_login,
            take=take,
            hear=self._stats.add,
        )
        self.interruption = self._observer.interruption
        self._subject = setting.subject(self._observer)
        self.bracket = CaseRunner(self._subject, setting.role, setting.options, tell, loud=loud)
        self.bracket.before_last = self._put_back
        self.bracket.before_motion = partial(setting.make_ready, self._subject)
        self.bracket.watch = partial(setting.watch, self._subject)
        cases_before = earlier.cases if earlier else ()
        self._earlier = {
            c.id: c for c in cases_before if c.verdict is not Verdict.NONE and c.requirements
        }
        self.bracket.over = frozenset(self._earlier)
        self._state: Mapping[str, Any] = {}
        self._problems: list[str] = []

    def results(self) -> Results:
        """Run the shipped cases, and tell what came of it.

        Raises:
            SuiteError: The suite itself is broken.
            JournalError: The subject's state cannot be written down.
            RecoveryError: What an interrupted run has left on it cannot be put back.
            KeyboardInterrupt: The tester ended it twice.
        """
        interrupted = False
        try:
            self.begin()
            self._try_cases()
        except KeyboardInterrupt:
            interrupted = True
            self.bracket.outcomes.append(
                _set_up("interrupted", "the tester ended the run before its end")
            )
        finally:
            try:
                self.end()
            except KeyboardInterrupt:
                if interrupted:
                    raise
                self._subject.close_lines()
                self.end()  # nothing is left half put back, unless he insists
        return self.build_results()

    def _try_cases(self) -> None:
        role, options = self.setting.role, self.setting.options
        files = {file for case, file in _cases_in(CASES[role], role) if wanted(case, options)}
        if files:  # without any, pytest would look for tests elsewhere
            _pytest(self.bracket, role, options, *sorted(files))

    def begin(self) -> None:
        """Write down what the subject is like, and find out how it is to be spoken to.

        Raises:
            JournalError: Its state cannot be written down.
            RecoveryError: What an interrupted run has left on it cannot be put back.
        """
        try:
            self._state = self._begun()
            self.setting.probe(self._subject)
        except JournalError:
            raise
        except (CaseFailed, CaseInconclusive) as error:
            self._subject.close_lines()
            self.bracket.give_up(
                UserMessage("the subject was not there to begin with: {error}", error=error)
            )

    def _begun(self) -> Mapping[str, Any]:
        """What the subject is like; a client that is there, and wrong about that, has failed."""
        try:
            return self.setting.begin(self._subject)
        except CaseFailed as error:
            if not error.requirement or self.setting.role is not Role.CLIENT:
                raise
            self.bracket.outcomes.append(_wrong_from_the_start(error))
            self._subject.close_lines()
            return self.setting.begin(self._subject)

    def end(self) -> None:
        """Put everything back; what could not be is told, and stays written down."""
        if not self._subject.off:  # else it was done before it was switched off
            self._put_back()
        self._problems += self.setting.finish(self._subject, self._state)
        self.bracket.outcomes += [_set_up("restore", problem) for problem in self._problems]
        self._observer.close()

    def _put_back(self) -> None:
        case, self._observer.case = self._observer.case, ""
        self._problems = self.setting.put_back(self._subject, self._state)
        self._subject.close_lines()
        self._observer.case = case

    def build_results(self) -> Results:
        """What came of it."""
        reason = self._subject.others.reason
        ran = (unless_disturbed(o, reason(o.case.id)) for o in self.bracket.outcomes)
        outcomes = (*ran, *self._wrong_claims())
        tried = [self._earlier.get(o.case.id) or self._case(o) for o in outcomes]
        seen_before = [case for key, case in self._earlier.items() if model.SEEN in key]
        groups = _grouped(self._observer.sightings, seen_before)
        made = (*tried, *seen_before, *(self._seen(n, same) for n, same in groups))
        by_requirement: defaultdict[str, list[Case]] = defaultdict(list)
        for each in made:
            for requirement in each.requirements:
                by_requirement[requirement].append(each)
        setting = self.setting
        scope = setting.options.only
        requirements = tuple(
            RequirementResult(
                entry.id,
                worst(c.verdict for c in by_requirement[entry.id]),
                tuple(c.id for c in by_requirement[entry.id]),
            )
            for entry in REQUIREMENTS.values()
            if entry.id in by_requirement
            or (METHODS[setting.role] in entry.testable and (scope is None or entry.id in scope))
        )
        return Results(
            tool=Tool.own(),
            subject=model.Subject(
                setting.role,
                setting.ics.name,
                setting.ics.version,
                setting.link,
                setting.capture,
                setting.ics.summary,
                self._subject.complaints,
            ),
            role=setting.role,
            verdict=conclude(Counter(each.verdict for each in made)),
            counts=dict.fromkeys(Verdict, 0) | Counter(each.verdict for each in made),
            readings={setting.role.value: self._dialect()},
            requirements=requirements,
            cases=made,
            session=self._stats.session(),
            notices=tuple(self._subject.notices),
        )

    def _dialect(self) -> dict[str, ReadingSeen]:
        """What was found out at the open points: what was seen, and else what a case tolerated."""
        readings = self._readings()
        told = {*chain.from_iterable(o.readings for o in self.bracket.outcomes)}
        told |= {s.finding.reading for s in self._observer.sightings if s.finding.reading}
        for key, reading in READINGS.items():
            seen = readings.get(key, ReadingSeen((), default=False, mixed=False))
            options = tuple(o.name for o in reading.options if (key, o.name) in told)
            if options and not seen.options:
                readings[key] = replace(
                    seen, options=options, default=options == (reading.default,)
                )
        return {key: readings[key] for key in READINGS if key in readings}

    def _readings(self) -> dict[str, ReadingSeen]:
        """What was seen at the open points, by the judge or by a probe, beside what is claimed.

        A probe may have found what the subject takes; what it sends by itself outweighs that.
        """
        ics = self.setting.ics
        claims = {key: ics.dialect[key] for key in ics.claimed}
        readings = dict(readings_of(self._observer.judge, speaks(self.setting.role), claims))
        for key, option in self._subject.found.items():
            if key == "endian" and key in readings and readings[key].options:
                continue
            default = option == READINGS[key].default
            readings[key] = ReadingSeen((option,), default, mixed=False, claimed=claims.get(key))
        return readings

    def _wrong_claims(self) -> Iterator[Outcome]:
        """A claim that is not what was seen, by the judge or by a case, is a failure of its own."""
        told = {outcome.observed for outcome in self.bracket.outcomes}
        for key, seen in self._readings().items():
            if seen.claimed is None:
                continue
            named = (o for o in ("silence", seen.claimed) if f"{key} = {o}" in told)
            options = (*seen.options, *named)  # a case need not wait until silence is sure
            if not options or seen.claimed in options:
                continue
            if key == "busy_reply" and seen.claimed == "queue" and {*options} == {"silence"}:
                continue  # who lets a request wait is silent until then
            if key == "op_get_default" and self._serves(seen):
                continue
            if key == "default_none" and self.setting.ics.dialect["on_unknown"] == "0":
                continue  # of 0x0D and 0x13 the one that it does not know is answered so, too
            if READINGS[key].unit is None:
                message = UserMessage(
                    "the statement of conformance claims {key} = {claimed}",
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
        """Whether a claim of opcodes may be true although others than those were seen."""
        if seen.claimed == "both":  # each is seen by itself, and perhaps only one was asked for
            return "op_get_default" not in self._subject.found
        return seen.claimed == "0x0D" and "both" in seen.options

    def _case(self, outcome: Outcome) -> Case:
        """An outcome in the words of the results."""
        case = outcome.case
        wire = tuple(exhibit(seen) for seen in outcome.frames)
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
            duration_s=outcome.duration_s,
            examples=outcome.examples,
            replay=self._replay(case.requirements[0] if case.requirements else ""),
            wire=() if outcome.verdict in (Verdict.NONE, Verdict.PASS) else wire,
            passing=self._stats.exhibits.passing(wire) if bad else (),
        )

    def _seen(self, number: int, sightings: list[Sighting]) -> Case:
        """What the judge saw, in the words of the results."""
        reason = self._subject.others.reason
        sightings = [s for s in sightings if not reason(s.case)] or sightings
        first = sightings[0]
        finding, doubt = first.finding, reason(first.case)
        if doubt and finding.verdict is Verdict.FAIL:
            message = UserMessage(
                "{doubt}. The judge had found: {message}", doubt=doubt, message=finding.message
            )
            finding = replace(
                finding, verdict=Verdict.INCONCLUSIVE, cause=Cause.SET_UP, message=message
            )
        times = "" if len(sightings) == 1 else f", {len(sightings)} times"
        wire = tuple(self._stats.exhibits.evidence(p) for p in finding.evidence[:_SHOWN])
        bad = finding.verdict is Verdict.FAIL
        where = f"; first seen in case {first.case}{times}" if first.case else times
        return Case(
            id=f"{finding.requirement}{model.SEEN}{number}",
            requirements=(finding.requirement,),
            verdict=finding.verdict,
            cause=finding.cause,
            message=f"{finding.message}{where}",
            expected=finding.expected,
            observed=finding.observed or " = ".join(finding.reading or ()),
            replay=self._replay(first.case.partition(".")[0] or finding.requirement),
            wire=wire,
            passing=self._stats.exhibits.passing(wire) if bad else (),
        )

    def _replay(self, requirement: str) -> str:
        replay = self.setting.replay
        only = f" --only {requirement}" if requirement else ""
        return f"{replay}{only}" if replay else ""


_SHOWN: Final = 12
_NUMBERED: Final = re.compile(r"\b[a-z]+\d+\b")  # as each of the suite's files is named


def _set_up(name: str, message: str) -> Outcome:
    """What kept a run from being whole."""
    case = cases.Case(f"run.{name}", (), frozenset({Hazard.READ_ONLY}))
    return Outcome(case, Verdict.INCONCLUSIVE, cause=Cause.SET_UP, message=message)


def _wrong_from_the_start(error: CaseFailed) -> Outcome:
    """A client that says of an idle robot that it is not, or nothing."""
    case = cases.Case("run.begin", (), frozenset({Hazard.READ_ONLY}))
    wrong = (error.requirement, Cause.SUBJECT, f"{error}", error.expected, error.observed)
    return Outcome(case, Verdict.FAIL, *wrong)


def _grouped(
    sightings: list[Sighting], before: Iterable[Case]
) -> Iterator[tuple[int, list[Sighting]]]:
    """Sightings that say the same, numbered on within their requirement; doubts are none.

    Of which of the suite's files they say it is no difference.
    """
    groups: defaultdict[tuple[str, Verdict, object], list[Sighting]] = defaultdict(list)
    for sighting in sightings:
        finding = sighting.finding
        if finding.verdict is not Verdict.INCONCLUSIVE:
            what = finding.reading or _NUMBERED.sub("", finding.message)
            groups[finding.requirement, finding.verdict, what].append(sighting)
    numbers = Counter(requirement for case in before for requirement in case.requirements)
    for (requirement, _, _), listed in groups.items():
        numbers[requirement] += 1
        yield numbers[requirement], listed


@cache
def _cases_in(folder: Path, role: Role) -> tuple[tuple[cases.Case, Path], ...]:
    """Every case in a folder, and its file: a run reads no other files than those of its cases.

    Raises:
        SuiteError: The suite itself is broken.
    """
    bracket = CaseRunner(None, role, Options())
    _pytest(bracket, role, Options(), folder)
    return tuple(zip(bracket.cases, (item.path for item in bracket.items), strict=True))


def _pytest(bracket: CaseRunner, role: Role, options: Options, *where: Path) -> None:
    """Let pytest collect and run shipped cases, silently.

    Raises:
        SuiteError: It could not.
        KeyboardInterrupt: The tester ended it.
    """
    folder = CASES[role]
    _forget_cases(folder)
    quiet = [f"-pno:{name}" for name in _NOT_NEEDED]
    alone = ("-c", os.devnull, f"--rootdir={folder}", f"--confcutdir={folder}")
    drawn = (f"--hypothesis-seed={options.seed}",)
    heard = ("--capture=no",) if options.attended else ()  # an operator reads and types
    status = pytest.main(
        [*map(str, where), *alone, *quiet, *drawn, *heard, "--import-mode=importlib"],
        plugins=[bracket],
    )
    if bracket.mistakes:
        raise SuiteError(bracket.mistakes[0])
    if status is pytest.ExitCode.INTERRUPTED:
        raise KeyboardInterrupt
    if status not in _FINISHED:
        raise SuiteError(UserMessage("pytest ended with {status!r}", status=status))


def _forget_cases(folder: Path) -> None:
    """Let the cases be imported anew: how they draw is settled when they are."""
    cases_here = str(folder / "test_")
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(cases_here):
            del sys.modules[name]


_NOT_NEEDED: Final = (
    *("terminal", "cacheprovider", "junitxml", "logging"),
    *("unraisableexception", "threadexception"),  # each run would collect garbage ten times
)
"""Plugins of pytest."""

_FINISHED: Final = (
    pytest.ExitCode.OK,
    pytest.ExitCode.TESTS_FAILED,
    pytest.ExitCode.NO_TESTS_COLLECTED,
)
