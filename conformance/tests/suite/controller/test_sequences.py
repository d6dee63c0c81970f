"""Sequences find what no single command shows, and say which few steps it takes."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.protocol.commands import BY_OPCODE, COMMANDS
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.model.model import Model
from scaraspec.suite.controller.harness.model.state import VALUES, Step
from scaraspec.suite.controller.harness.requests.queries import QUERIES
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

Try = Callable[..., Any]

ASKING = frozenset({Hazard.READ_ONLY})


@pytest.mark.parametrize(
    ("fault", "requirement", "case", "steps"),
    [
        (
            "stopped-simulation-undoes-the-setting",
            "4.32/6",
            "4/15.sequences",
            ("set output", "simulate_program", "stop"),
        ),
        (
            "second-login-sets-the-clock-back",
            "4.5/4",
            "4.20/3.sequences",
            ("set the clock", "log in again"),
        ),
        (
            "any-deletion-forgets-the-default",
            "4.13/3",
            "5.2/12.sequences",
            ("upload", "upload", "make", "delete"),
        ),
    ],
)
def test_shrunk(
    tried: Try, fault: str, requirement: str, case: str, steps: tuple[str, ...]
) -> None:
    """A fault that lies between commands is found, and told with the few steps that it takes."""
    found = tried(mutants()[fault].wrong, requirement, examples=20)[case]
    assert found.verdict is Verdict.FAIL
    assert found.requirements == (requirement,)
    told = found.message.partition(" after: ")[2].split("; ")
    assert not told[0].startswith("…"), found.message
    left = iter(told)
    assert all(any(step.startswith(name) for step in left) for name in steps), told


class LooksAtTheBeginning(ControllerCore):
    """The old password may be any that begins like it."""

    def set_password(self, request: Request) -> bool:
        """Take it."""
        value, old = request.value, self.store.settings.password
        if value is not None and value.old.startswith(old):
            request = replace(request, value=value._replace(old=old))
        return super().set_password(request)


def test_more_than_the_old_password_is_a_wrong_one(tried: Try) -> None:
    """It is offered now and then where passwords are changed."""
    assert "4.2/3" in tried(LooksAtTheBeginning, "4.2/3", examples=20).failed


class IsFull(ControllerCore):
    """There are so many programs that their list has parts."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        for number in range(20):
            self.store.write(b"some-old-program-%02d.rob" % number, b"")


@pytest.mark.parametrize("list_cont", ["push", "request"])
def test_a_list_that_was_asked_for_is_taken_to_its_end(list_cont: str) -> None:
    """No part of it is taken for one of the next list (A-4.10-3)."""
    dialect = DEFAULT.replace(list_cont=list_cont)
    access, ics = MemoryAccess(Robot(IsFull, dialect).network), Ics(dialect=dialect)
    setting = ControllerAdapter(access, ics, PASSWORD, Options(allowed=ALL))
    subject = setting.subject(Observer(setting.role, ics))
    number = [query.name for query in QUERIES].index("list_programs")
    ask = Step("query", *divmod(number, VALUES), 0)
    model = Model(subject, [], [b"new.rob"])
    for step in (ask, Step("upload", 0, 0, 0), ask, Step("list_programs", 0, 0, 0)):
        model.perform(step)


class ForgetsItsListLate(ControllerCore):
    """A connection that has brought forty requests gets an empty list."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._requests: Counter[int] = Counter()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Count."""
        self._requests[session.connection] += 1
        super().handle(session, frame, now_s)

    def list_programs(self, request: Request) -> NameListPart:
        """Tell nothing."""
        if self._requests[request.session.connection] > 40:
            return NameListPart(more=False, names=())
        return super().list_programs(request)


def test_late_faults(tried: Try) -> None:
    """What shows only after many requests is found, and the last steps before it are told."""
    found = tried(ForgetsItsListLate, "4.10/11", examples=4)["3/31.long-use"]
    assert found.verdict is Verdict.FAIL
    assert " steps; " in found.message


class Hears(ControllerCore):
    """Keeps what it is asked."""

    inbox: set[int] = set()  # noqa: RUF012 - the test empties it

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Keep the opcode."""
        self.inbox.add(frame.opcode)
        super().handle(session, frame, now_s)


def test_only_what_is_allowed(tried: Try) -> None:
    """Where nothing but asking is allowed, nothing else is drawn."""
    Hears.inbox.clear()
    cases = tried(Hears, "3/31", allowed=ASKING, examples=20)
    assert cases["3/31.sequences"].verdict is Verdict.PASS
    assert cases["3/31.long-use"].verdict is Verdict.NONE
    names = {BY_OPCODE[opcode].name for opcode in Hears.inbox}
    assert names <= {c.name for c in COMMANDS if c.hazard is Hazard.READ_ONLY} | {"login"}
