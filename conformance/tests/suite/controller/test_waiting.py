"""Waiting: on one connection while something comes on another, and for a robot that is off."""

from dataclasses import dataclass, field

import pytest

from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.two_stage.commands import RUN, start_program
from scaraspec.suite.engine.expectations import NoReply
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.transports.link import Link, LinkError
from scaraspec.virtual_controller.core import ControllerCore


def _subject(access: MemoryAccess) -> ControllerUnderTest:
    ics = Ics()
    setting = ControllerAdapter(access, ics, PASSWORD, Options(allowed=ALL))
    return setting.subject(Observer(setting.role, ics))


def test_what_comes_elsewhere_is_judged_as_it_comes() -> None:
    """It is not left until somebody listens there: the judge is told all in the order of time."""
    subject = _subject(MemoryAccess(Robot(ControllerCore, DEFAULT).network))
    line, other = subject.open(), subject.open()
    start_program(subject, other, RUN, seconds=1)
    assert not [seen for seen in other.inbox if seen.frame.tagged]
    line.wait(5)
    assert [seen for seen in other.inbox if seen.frame.tagged]


@dataclass(frozen=True)
class IsOff(MemoryAccess):
    """Nobody is there, however often one comes."""

    came: list[float] = field(default_factory=list)

    def connect(self) -> Link:
        self.came.append(self.network.now_s)
        raise LinkError("nobody is there")


@pytest.mark.parametrize("off", [False, True])
def test_a_robot_that_was_shut_down_is_looked_for_once(*, off: bool) -> None:
    """Whoever waits for it looks again by himself; any other one may just be starting."""
    access = IsOff(Robot(ControllerCore, DEFAULT).network)
    subject = _subject(access)
    subject.off = off
    with pytest.raises(NoReply, match="nobody is there"):
        subject.open()
    assert (len(access.came) == 1) is off
