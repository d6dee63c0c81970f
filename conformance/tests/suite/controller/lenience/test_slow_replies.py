"""A controller whose replies are slow, but correct, passes with the claim ``reply_timeout``."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Reason, Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import SLOWEST_S
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.journal import Journal
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

RunCases = Callable[..., Any]
PROMPT = frozenset(
    BY_NAME[name].opcode
    for name in (
        *("login", "get_status", "run_program", "simulate_program", "emergency_stop", "reset"),
        *("jog", "upload_chunk", "download_chunk"),
    )
)


class SlowlyServed(ControllerCore):
    """Serves the requests of a connection in order; most of them take some seconds."""

    delay_s, prompt = 7.0, PROMPT

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._waiting: list[tuple[float, Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Serve a request at once, or when its time has come."""
        busy_until_s = max((due_s for due_s, x, _ in self._waiting if x is session), default=0.0)
        due_s = max(busy_until_s, now_s + (0.0 if frame.opcode in self.prompt else self.delay_s))
        if due_s > now_s:
            self._waiting.append((due_s, session, frame))
        else:
            super().handle(session, frame, now_s)

    @property
    def next_event_s(self) -> float | None:
        """The time of the next event."""
        own = [due_s for due_s, _, _ in self._waiting]
        other_s = super().next_event_s
        return min(own if other_s is None else [*own, other_s], default=None)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        due = [entry for entry in self._waiting if entry[0] <= now_s]
        self._waiting = [entry for entry in self._waiting if entry[0] > now_s]
        for _, session, frame in due:
            if session.connection in self.sessions:
                super().handle(session, frame, now_s)


SLOW = DEFAULT.replace(reply_timeout="10")


@pytest.mark.parametrize("only", ["4.7/2", "4.12/5", "3/30", "4.35/2"])
def test_with_the_claim(run_cases: RunCases, only: str) -> None:
    """Every case passes. A clock that is set with a delay cannot be restored exactly."""
    problems = run_cases(SlowlyServed, only, dialect=SLOW).problems
    assert [p for p in problems if not p.startswith("run.restore: the clock")] == []


def test_transfers_time_out_between_slow_replies(run_cases: RunCases) -> None:
    """The case is inconclusive, and the message names the side that was late."""
    cases = run_cases(SlowlyServed, "5.4/8", dialect=SLOW)
    assert not cases.violated
    assert [p for p in cases.problems if "the subject or the network is too slow" in p]


def test_without_the_claim(run_cases: RunCases) -> None:
    """The default is five seconds."""
    assert "4.7/2" in run_cases(SlowlyServed, "4.7/2").violated


class Distant(SlowlyServed):
    """Every reply takes as long, longer than the suite waits for a reply that is optional."""

    delay_s = 0.5
    prompt = frozenset[int]()


def test_a_distant_controller(run_cases: RunCases) -> None:
    """Nothing fails."""
    cases = run_cases(Distant, "4.8", "4.12", "4.24", "5.2/2", "5.3/4", "5.4/6", "6.5/9")
    assert not cases.problems


class RefusesSlowly(SlowlyServed):
    """The refusals of a busy robot take so long that the command ends before the last of them."""

    delay_s = 0.25


def test_command_that_ends_among_refusals_executes_again(run_cases: RunCases) -> None:
    """The refusals that are missing are required while it executes again."""
    cases = run_cases(RefusesSlowly, "4/6")
    assert cases["4/6.set_tool_coordinates"].verdict is Verdict.PASS
    assert not cases.problems


def test_request_that_the_suite_has_sent_too_slowly(
    run_cases: RunCases, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be dropped (A-3-11): neither the case nor the judge fails."""
    pause = ControllerUnderTest.pause
    monkeypatch.setattr(
        ControllerUnderTest, "pause", lambda subject, for_s: pause(subject, 3 * for_s)
    )
    cases = run_cases(ControllerCore, "2/5", "3/31")
    assert not cases.violated
    slow = cases["2/5.slowly"]
    assert (slow.verdict, slow.reason) == (Verdict.INCONCLUSIVE, Reason.STALLED)
    assert "it has sent a request with a pause of 2.700 s inside" in slow.message


def test_a_slow_disk_causes_no_pause_inside_a_request(
    run_cases: RunCases, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a request may change is written to the journal before its first byte is sent."""
    subjects: list[ControllerUnderTest] = []
    begin, write = ControllerUnderTest.begin_case, Journal.write

    def begin_case(subject: ControllerUnderTest) -> None:
        subjects.append(subject)
        begin(subject)

    def write_slowly(journal: Journal, event: str, **values: Any) -> None:
        if subjects:
            subjects[-1].pause(2)
        write(journal, event, **values)

    monkeypatch.setattr(ControllerUnderTest, "begin_case", begin_case)
    monkeypatch.setattr(Journal, "write", write_slowly)
    cases = run_cases(ControllerCore, "4.2/4", examples=10)
    assert cases["4.2/4.sequences"].verdict is Verdict.PASS
    assert not cases.problems


def test_a_busy_machine_makes_a_pause_inside_a_request_too_long(
    run_cases: RunCases, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sequence gives the request up, and continues on another connection."""
    given_up: list[float] = []
    wait = OutgoingConnection.wait

    def wait_long(line: OutgoingConnection, for_s: float) -> None:
        if for_s == SLOWEST_S:
            given_up.append(for_s)
            for_s = 1.5
        wait(line, for_s)

    monkeypatch.setattr(OutgoingConnection, "wait", wait_long)
    cases = run_cases(ControllerCore, "4.2/4", "4.20/3", examples=20)
    assert cases["4.2/4.sequences"].verdict is Verdict.PASS
    assert not cases.problems
    assert given_up
