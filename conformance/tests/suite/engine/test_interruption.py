"""A run can be interrupted at any moment, and no case fails because of it."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.transports.link import Arrival, Link
from scaraspec.virtual_controller.core import ControllerCore


@dataclass(frozen=True)
class EndingAccess(MemoryAccess):
    """Sends a signal after a number of sent or received pieces of bytes."""

    signals: list[Callable[[], None]] = field(default_factory=list)
    at: int = 0
    passed: "itertools.count[int]" = field(default_factory=itertools.count)

    def connect(self) -> Link:
        link = super().connect()
        send, receive = link.send, link.receive

        def sent(data: bytes) -> int:
            time_ns = send(data)
            self._signal()
            return time_ns

        def received(deadline_s: float, others: Sequence[Link] = ()) -> Arrival | None:
            arrival = receive(deadline_s, others)
            if arrival is not None:
                self._signal()
            return arrival

        link.send, link.receive = sent, received  # type: ignore[method-assign]  # of this one link
        return link

    def _signal(self) -> None:
        if next(self.passed) == self.at:
            for signal in self.signals:
                signal()


@pytest.mark.parametrize("at", range(20, 700, 61))
def test_an_interrupted_run_has_no_failures(at: int) -> None:
    """The traffic until then is judged once, and everything is restored."""
    access = EndingAccess(Robot(ControllerCore, DEFAULT).network, at=at)
    options = Options(only=frozenset({"5.2/2", "5.3/4"}), allowed=ALL, examples=3)
    run = Run(ControllerAdapter(access, Ics(), PASSWORD, options))
    access.signals.append(run.interruption.ask)
    results = run.results()
    found = {case.id for case in results.cases}
    assert not {case.message for case in results.cases if case.verdict is Verdict.FAIL}
    assert "run.interrupted" in found
    assert "run.restore" not in found


def test_a_step_is_not_interrupted() -> None:
    """An interruption during a step takes effect after the step, and once."""
    interruption, done = Interruption(), []

    def step() -> None:
        with interruption:
            with interruption:
                interruption.ask()
            done.append("the step")

    with pytest.raises(KeyboardInterrupt):
        step()
    assert done
    with interruption:  # the interruption is over, so that restoring continues
        pass
