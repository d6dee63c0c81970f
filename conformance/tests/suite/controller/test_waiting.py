"""Waiting: frames on other connections, and a robot that was shut down."""

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
    adapter = ControllerAdapter(access, ics, PASSWORD, Options(allowed=ALL))
    return adapter.subject(Observer(adapter.role, ics))


def test_frames_of_other_connections_are_read_while_waiting() -> None:
    """While the suite waits on one connection, frames of others are read and judged in order."""
    subject = _subject(MemoryAccess(Robot(ControllerCore, DEFAULT).network))
    line, other = subject.open(), subject.open()
    start_program(subject, other, RUN, seconds=1)
    assert not [seen for seen in other.inbox if seen.frame.tagged]
    line.wait(5)
    assert [seen for seen in other.inbox if seen.frame.tagged]


@dataclass(frozen=True)
class SwitchedOff(MemoryAccess):
    """Every connection attempt fails."""

    attempts_s: list[float] = field(default_factory=list)

    def connect(self) -> Link:
        self.attempts_s.append(self.network.now_s)
        raise LinkError("connection refused")


@pytest.mark.parametrize("off", [False, True])
def test_one_connection_attempt_after_a_shutdown(*, off: bool) -> None:
    """After a shutdown, one attempt is made; otherwise, the controller may be starting."""
    access = SwitchedOff(Robot(ControllerCore, DEFAULT).network)
    subject = _subject(access)
    subject.off = off
    with pytest.raises(NoReply, match="connection refused"):
        subject.open()
    assert (len(access.attempts_s) == 1) is off
