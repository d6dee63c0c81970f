"""An operator replaces hooks; the requests are evidence, and the time of the operator does not
count."""

import os
import string
from collections.abc import Callable, Iterator

import pytest

from scaraspec.judge.verdicts import Reason, Verdict
from scaraspec.mutants.controller_run import Robot, RobotOperator, certified
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Case, Results
from scaraspec.report.operator_request import OperatorAnswer
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.hooks import HOOKS, REQUESTS
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.operator import GUIDANCE, TerminalOperator
from scaraspec.suite.engine.plan import ALL, Options, skip_reason
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

INPUTS, FAULT = "4.31/2.driven", "4.15/2.fault"


def attended(*cases: str) -> Options:
    """Options of a run of these cases with an operator."""
    return Options(only=frozenset(), cases=frozenset(cases), allowed=ALL, attended=True)


def run(
    make: Callable[[Robot], RobotOperator],
    *cases: str,
    core: type[ControllerCore] = ControllerCore,
) -> Results:
    """Run cases with an operator and without hooks."""
    robot = Robot(core, DEFAULT)
    return certified(robot, Ics(), attended(*cases), make(robot))


def only(results: Results) -> Case:
    """The only case."""
    (case,) = results.cases
    return case


# ---------------------------------------------------------------------- the terminal

Terminal = tuple[TerminalOperator, Callable[[str], object], list[str]]


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    """Return an operator at a terminal, a function that types, and the lines shown."""
    shown: list[str] = []
    ours, theirs = os.pipe()
    yield TerminalOperator(shown.append, ours), lambda text: os.write(theirs, text.encode()), shown
    os.close(ours)
    os.close(theirs)


def test_a_request_in_plain_words(terminal: Terminal) -> None:
    """The operator types a note, an unknown word, and the confirmation."""
    operator, types, shown = terminal
    notes: list[str] = []
    operator.ask("set digital input 3 to 1")
    assert operator.poll(notes.append) is None
    types("n The lamp is red\nwhat\nn\n\n")
    assert operator.poll(notes.append) is OperatorAnswer.DONE
    assert notes == ["The lamp is red"]
    assert shown[0] == f"now: set digital input 3 to 1. {GUIDANCE}"
    assert shown[1:] == [GUIDANCE, shown[0]] * 2


def test_keys_typed_before_a_request(terminal: Terminal) -> None:
    """An additional Enter does not confirm the next request."""
    operator, types, _ = terminal
    types("\n\n")
    operator.ask("set digital input 3 to 1")
    assert operator.poll(print) is None
    types("\n")
    assert operator.poll(print) is OperatorAnswer.DONE


def test_leaving(terminal: Terminal) -> None:
    """The operator skips the case, and then ends the run."""
    operator, types, _ = terminal
    types("s\nq\n")
    assert operator.poll(print) is OperatorAnswer.SKIPPED
    with pytest.raises(KeyboardInterrupt):
        operator.poll(print)


# ---------------------------------------------------------------------- cases


def test_every_attended_case_has_a_request() -> None:
    """A request has the placeholders of its hook; an attended case needs no other hook."""
    for name, request in REQUESTS.items():
        fields = [{f for _, f, *_ in string.Formatter().parse(t)} for t in (request, HOOKS[name])]
        assert fields[0] - {None} == fields[1] - {None}, name
    for case in collect(Options()):
        assert not case.attended or REQUESTS.keys() >= {*case.needs}, case.id


def test_which_cases_run() -> None:
    """Cases with hooks need an operator; cases with critical times or many requests are skipped
    even then."""
    driven, patterns = (
        next(case for case in collect(Options()) if case.id == name)
        for name in (INPUTS, "4.31/2.patterns")
    )
    for case, reasons in ((driven, [Reason.HOOK, None]), (patterns, [Reason.HOOK] * 2)):
        skips = [skip_reason(case, Options(attended=each), Ics()) for each in (False, True)]
        assert [skip and skip.reason for skip in skips] == reasons


def test_requests_are_evidence() -> None:
    """All inputs are restored with one request; the cases with the same hooks are together."""
    results = run(RobotOperator, INPUTS, FAULT, "8/2.faults", "6.5/21.each-port")
    assert {case.verdict for case in results.cases} == {Verdict.PASS}
    assert [case.id for case in results.cases] == [FAULT, "8/2.faults", INPUTS, "6.5/21.each-port"]
    operator_requests = [each.request for each in results.cases[2].operator]
    assert operator_requests[0] == "set digital input 1 to 1"
    assert operator_requests[-1].count("; ") == 7
    assert len(operator_requests) == 9
    assert results.cases[0].operator[0].request == "cause a motor fault of inner arm that lasts"
    assert Results.from_json(results.to_json().encode()) == results


class Slow(RobotOperator):
    """Needs an hour for each request, and types a note."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self._network = robot.network

    def poll(self, note: Callable[[str], None]) -> OperatorAnswer | None:
        self._network.run_until(self._network.now_s + 3600)
        note("late")
        return OperatorAnswer.DONE


def test_the_time_of_the_operator_does_not_count() -> None:
    """The time is in the evidence, but not in the duration of the case."""
    case = only(run(Slow, INPUTS))
    assert case.verdict is Verdict.PASS
    assert case.duration_s < 60
    assert all(each.duration_s >= 3600 for each in case.operator)
    assert case.operator[0].notes == ("late",)


class Lazy(RobotOperator):
    """Does nothing, and confirms all requests."""

    def ask(self, request: str) -> None:
        """Do nothing."""
        self.requests.append(request)


def test_a_failure_is_not_repeated() -> None:
    """The operator would have to do everything again."""
    case = only(run(Lazy, FAULT))
    assert case.verdict is Verdict.FAIL
    assert not case.attempts
    assert len(case.operator) == 2


class Skips(RobotOperator):
    """Skips the requests from this number on."""

    first = 0

    def poll(self, note: Callable[[str], None]) -> OperatorAnswer | None:
        """Skip."""
        skips = len(self.requests) > self.first
        return OperatorAnswer.SKIPPED if skips else super().poll(note)


def test_a_skipped_case() -> None:
    """The case has no verdict because of the hook, and a notice names the hook."""
    results = run(Skips, INPUTS)
    case = only(results)
    assert (case.verdict, case.reason) == (Verdict.NONE, Reason.HOOK)
    assert case.message == "the operator skipped the case"
    assert {each.answer for each in case.operator} == {OperatorAnswer.SKIPPED}
    assert any("set_input" in notice for notice in results.notices)


def test_a_robot_that_is_not_switched_on_again() -> None:
    """The shutdown was judged before the request, so skipping it does not skip the case."""
    case = only(run(Skips, "4.35/2"))
    assert case.verdict is Verdict.PASS
    assert [each.answer for each in case.operator] == [OperatorAnswer.SKIPPED]


class LazyAtFirst(Skips, Lazy):
    """Does nothing, and skips the second request."""

    first = 1


def test_a_skipped_cleanup_hides_no_failure() -> None:
    """The case had failed before the operator skipped the cleanup."""
    assert only(run(LazyAtFirst, FAULT)).verdict is Verdict.FAIL


class Clumsy(RobotOperator):
    """Does not only what is requested, but also restarts the robot."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self._restart = robot.restart

    def ask(self, request: str) -> None:
        self._restart()
        super().ask(request)


def test_a_connection_that_ends_during_a_request() -> None:
    """The case is inconclusive, because the operator may have caused it."""
    case = only(run(Clumsy, INPUTS))
    assert case.verdict is Verdict.INCONCLUSIVE
    assert case.message == "a connection ended during a request to the operator"


class HangsAtAVersion(ControllerCore):
    """After a query of the version it answers nothing until it is restarted."""

    dead = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self.dead |= frame.opcode == 0x08
        if not self.dead:
            super().handle(session, frame, now_s)


def test_a_controller_that_hangs() -> None:
    """The operator restarts it after each attempt, and the other cases run."""
    results = run(RobotOperator, "4.7/2", "4.10/2", core=HangsAtAVersion)
    verdicts = {case.id: case.verdict for case in results.cases}
    assert verdicts == {"4.7/2": Verdict.FAIL, "4.10/2": Verdict.PASS}
    hangs = results.cases[0]
    assert len(hangs.operator) == len(hangs.attempts) == 2
    assert "off at its plug" in hangs.operator[0].request
