"""Failures while this computer stalls do not count for the subject."""

import itertools
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, repeat
from pathlib import Path

import pytest

from scaraspec.judge.verdicts import Cause, Conclusion, Finding, Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.mutants.operators.controller.connections import with_framer
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.report.model import Role
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine import stall_detector
from scaraspec.suite.engine.collection import CASES
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import CaseFinding, Observer
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.suite.engine.stall_detector import Stall, StallDetector
from scaraspec.transports.link import Arrival, Link
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer

CASE = """
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import {kind}

@case("4.8/2")
def test_it(subject, line):
    subject.attempts = getattr(subject, "attempts", 0) + 1
    if subject.attempts < {good_at}:
        raise {kind}("it is wrong")
"""

AT_ONCE, THE_SECOND_TIME, NEVER = 1, 2, 99
STALL = Stall(0, 2 * 10**9)


@pytest.mark.parametrize(
    ("good_at", "kind", "stalled", "verdict", "tried"),
    [
        (AT_ONCE, "CaseFailed", [True], Verdict.PASS, 1),
        (NEVER, "CaseFailed", [False, False], Verdict.FAIL, 2),
        (THE_SECOND_TIME, "CaseFailed", [True, False], Verdict.PASS, 2),
        (THE_SECOND_TIME, "CaseInconclusive", [True, False], Verdict.PASS, 2),
        (NEVER, "CaseFailed", [True, False, False], Verdict.FAIL, 3),
        (NEVER, "CaseFailed", [True, True, True], Verdict.INCONCLUSIVE, 3),
    ],
)
def test_a_stalled_attempt_is_repeated(  # noqa: PLR0913, PLR0917 - a table
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    good_at: int,
    kind: str,
    stalled: list[bool],
    verdict: Verdict,
    tried: int,
) -> None:
    """A stalled attempt that did not pass is repeated; a failure of another attempt counts."""
    file = tmp_path / f"test_{abs(hash(tmp_path))}.py"  # modules are kept by their name
    file.write_text(CASE.format(kind=kind, good_at=good_at), encoding="utf-8")
    monkeypatch.setitem(CASES, Role.CONTROLLER, tmp_path)
    access = MemoryAccess(Robot(ControllerCore, DEFAULT).network)
    adapter = ControllerAdapter(access, Ics(), PASSWORD, Options(allowed=ALL))
    before_and_after = chain.from_iterable(([], [STALL] if each else []) for each in stalled)
    run = Run(adapter, stalls=before_and_after.__next__)
    (result,) = (case for case in run.results().cases if case.id == "4.8/2")
    assert result.verdict is verdict
    assert run.case_runner.subject.attempts == tried  # type: ignore[attr-defined] # set by the case
    assert len(result.attempts) == (tried if tried > 1 else 0)
    message = "this machine stalled for 2.0 s: it is wrong"
    assert (result.message == message) is (verdict is Verdict.INCONCLUSIVE)
    assert next(before_and_after, None) is None


def test_a_stall_does_not_explain_a_dead_controller() -> None:
    """The case cannot be repeated, and the failure is reported."""
    dies = mutants()["dies-of-its-own-form"].wrong
    access = MemoryAccess(Robot(dies, DEFAULT).network)
    options = Options(frozenset({"3/23"}), allowed=ALL)
    run = Run(ControllerAdapter(access, Ics(), PASSWORD, options), stalls=repeat([STALL]).__next__)
    assert run.results().verdict is Conclusion.NONCONFORMANT


SPLIT = """
from scaraspec.suite.engine.case import case

@case("4.7/2")
def test_it(subject, line):
    subject.attempts = getattr(subject, "attempts", 0) + 1
    line.send_bytes(b"\\xaa\\x08")
    line.wait(1.5 if subject.attempts == 1 else 0.1)
    line.send_bytes(b"\\x00\\xcc")
    line.reply("get_version")
"""
"""A frame with a pause, which is permitted up to a second (2/5)."""


class ImpatientFramer(RequestFramer):
    """Discards an incomplete frame after a little more than a second of silence."""

    def __init__(self, dialect: Dialect) -> None:
        super().__init__(dialect)
        self._timeout_s = 1.2


@pytest.mark.parametrize("stalls", [[[], [Stall(0, 2**62)]], []])
def test_a_frame_that_a_stall_splits(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stalls: list[list[Stall]],
) -> None:
    """The case is repeated, whether the stall was measured or not."""
    (tmp_path / f"test_{abs(hash(tmp_path))}.py").write_text(SPLIT, encoding="utf-8")
    monkeypatch.setitem(CASES, Role.CONTROLLER, tmp_path)
    access = MemoryAccess(Robot(with_framer(ImpatientFramer), DEFAULT).network)
    adapter = ControllerAdapter(access, Ics(), PASSWORD, Options(allowed=ALL))
    series = chain(stalls, repeat([]))
    results = Run(adapter, stalls=series.__next__).results()
    assert {case.id: case.verdict for case in results.cases} == {"4.7/2": Verdict.PASS}


@pytest.mark.parametrize(
    ("stall", "kept"), [((0, 5), True), ((5, 15), False), ((12, 13), False), ((21, 30), True)]
)
def test_findings_that_span_a_stall_are_dropped(stall: tuple[int, int], *, kept: bool) -> None:
    """A stall matters from the first byte of the evidence until the finding."""
    observer = Observer(Role.CONTROLLER, Ics())
    finding = Finding("3/31", Verdict.FAIL, Cause.SUBJECT, "no reply")
    observer.findings.append(CaseFinding(observer.attempt, finding, 10, 20, late=True))
    observer.drop_stalled(0, [Stall(*stall)])
    assert bool(observer.findings) is kept


def test_stalls(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pause longer than the threshold is reported once; a shorter one is not."""
    times_ns = [int(time_s * 1e9) for time_s in (0, 0.4, 2.4, 2.8)]
    monkeypatch.setattr(stall_detector, "now_ns", iter(times_ns).__next__)
    detector = StallDetector(0.5)
    assert detector.stalls() == []
    assert detector.stalls() == [Stall(times_ns[1], times_ns[2])]
    assert detector.stalls() == []


@pytest.mark.parametrize(
    ("time_scale", "timeout_s", "threshold_s"),
    [(1, 30, 0.5), (1, 1, 0.25), (2, 30, 0.25), (8, 1, 0.1), (0.5, 30, 0.5)],
)
def test_threshold(time_scale: float, timeout_s: float, threshold_s: float) -> None:
    """The threshold follows the clock and the shortest timeout of the subject."""
    assert stall_detector.threshold_s(time_scale, timeout_s) == threshold_s


def test_the_thread_ends_with_the_context() -> None:
    """No thread remains."""
    with StallDetector():
        assert "stall detector" in {thread.name for thread in threading.enumerate()}
    assert "stall detector" not in {thread.name for thread in threading.enumerate()}


@dataclass(frozen=True)
class SleepingAccess(MemoryAccess):
    """A computer that sleeps during each seventh wait and wakes after the deadline."""

    waits: Iterator[int] = field(default_factory=itertools.count)

    def connect(self) -> Link:
        link = super().connect()
        receive = link.receive

        def sleep(deadline_s: float, others: Sequence[Link] = ()) -> Arrival | None:
            if deadline_s > link.now_s and next(self.waits) % 7 == 6:
                self.pause(31)
                return None
            return receive(deadline_s, others)

        link.receive = sleep  # type: ignore[method-assign]  # of this one link
        return link


def test_bytes_that_arrive_during_a_stall_are_read() -> None:
    """Bytes that arrived during the sleep are read after the deadline.

    These cases send whole requests.
    """
    access = SleepingAccess(Robot(ControllerCore, DEFAULT).network)
    cases = frozenset({"4.1/2", "4.1/3", "4.6/2", "4.8/2"})
    options = Options(only=frozenset(), cases=cases, allowed=ALL)
    results = Run(ControllerAdapter(access, Ics(), PASSWORD, options)).results()
    verdicts = {case.id: case.verdict for case in results.cases}
    assert verdicts["4.8/2"] is verdicts["4.6/2"] is Verdict.PASS
    assert Verdict.FAIL not in verdicts.values()
    assert next(access.waits) > len(verdicts)
