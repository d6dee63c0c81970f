"""What goes wrong while this machine stands still is no verdict on its subject."""

import itertools
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, repeat
from pathlib import Path

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Role
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine import run as suite
from scaraspec.suite.engine import stall_detector as pulse
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.stall_detector import StallDetector
from scaraspec.transports.link import Arrival, Link
from scaraspec.virtual_controller.core import ControllerCore

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


@pytest.mark.parametrize(
    ("good_at", "kind", "still_s", "verdict", "tried"),
    [
        (AT_ONCE, "CaseFailed", [2.0], Verdict.PASS, 1),
        (NEVER, "CaseFailed", [0.0], Verdict.FAIL, 1),
        (THE_SECOND_TIME, "CaseFailed", [2.0, 0.0], Verdict.PASS, 2),
        (THE_SECOND_TIME, "CaseInconclusive", [2.0, 0.0], Verdict.PASS, 2),
        (NEVER, "CaseFailed", [2.0, 0.0], Verdict.FAIL, 2),
        (NEVER, "CaseFailed", [2.0, 2.0, 2.0], Verdict.INCONCLUSIVE, 3),
    ],
)
def test_a_case_is_tried_anew(  # noqa: PLR0913, PLR0917 - a table
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    good_at: int,
    kind: str,
    still_s: list[float],
    verdict: Verdict,
    tried: int,
) -> None:
    """Where it went wrong while nothing happened here; it fails where something did."""
    file = tmp_path / f"test_{abs(hash(tmp_path))}.py"  # modules are kept by their name
    file.write_text(CASE.format(kind=kind, good_at=good_at), encoding="utf-8")
    monkeypatch.setitem(suite.CASES, Role.CONTROLLER, tmp_path)
    access = MemoryAccess(Robot(ControllerCore, DEFAULT).network)
    setting = ControllerAdapter(access, Ics(), PASSWORD, Options(allowed=ALL))
    before_and_after = chain.from_iterable(zip(repeat(0.0), still_s))
    run = suite.Run(setting, stall_s=before_and_after.__next__)
    (found,) = (case for case in run.results().cases if case.id == "4.8/2")
    assert found.verdict is verdict
    assert run.case_runner.subject.attempts == tried  # type: ignore[attr-defined] # set by the case
    said = "this machine stood still for 2.0 s: it is wrong"
    assert (found.message == said) is (verdict is Verdict.INCONCLUSIVE)
    assert next(before_and_after, None) is None


def test_what_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The longest standstill, once; a moment is none."""
    instants_s = iter((0, 0.4, 2.4, 2.8))
    monkeypatch.setattr(pulse, "monotonic_ns", lambda: int(next(instants_s) * 1e9))
    beating = StallDetector()
    assert beating.take_longest_stall_s() == 0
    assert beating.take_longest_stall_s() == pytest.approx(2)
    assert beating.take_longest_stall_s() == 0
    assert next(instants_s, None) is None


def test_it_beats_as_long_as_it_is_used() -> None:
    """No thread is left."""
    with StallDetector():
        assert "pulse" in {thread.name for thread in threading.enumerate()}
    assert "pulse" not in {thread.name for thread in threading.enumerate()}


@dataclass(frozen=True)
class SleepingAccess(MemoryAccess):
    """A machine that sleeps while an answer is awaited, each seventh time, and wakes too late."""

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


def test_what_came_while_this_machine_slept_is_taken() -> None:
    """It is there, though the time to wait for it is over."""
    access = SleepingAccess(Robot(ControllerCore, DEFAULT).network)
    options = Options(only=frozenset({"4.1/2", "4.6/3", "4.7/1", "4.8/2"}), allowed=ALL)
    results = suite.Run(ControllerAdapter(access, Ics(), PASSWORD, options)).results()
    verdicts = {case.id: case.verdict for case in results.cases}
    assert verdicts["4.8/2"] is verdicts["4.6/2"] is Verdict.PASS
    assert Verdict.FAIL not in verdicts.values()
    assert next(access.waits) > len(verdicts)
