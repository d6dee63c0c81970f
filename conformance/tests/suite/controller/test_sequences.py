"""Sequences of requests detect faults that single commands do not show, and are shrunk."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import PASSWORD, Robot, certified
from scaraspec.protocol.commands import BY_OPCODE, COMMANDS
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.model.model import Model
from scaraspec.suite.controller.harness.model.state import VALUES, Scene, Step
from scaraspec.suite.controller.harness.requests.queries import QUERIES
from scaraspec.suite.controller.harness.sequences import StepDealer
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Request, Session

RunCases = Callable[..., Any]

READ_ONLY = frozenset({Hazard.READ_ONLY})


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
            ("upload", "make", "delete"),
        ),
    ],
)
def test_failing_sequence_is_shrunk(
    run_cases: RunCases, fault: str, requirement: str, case: str, steps: tuple[str, ...]
) -> None:
    """The message of a failed sequence contains only the few steps that it needs."""
    result = run_cases(mutants()[fault].wrong, requirement, examples=20)[case]
    assert result.verdict is Verdict.FAIL
    assert result.requirements == (requirement,)
    sequence = result.message.partition(" after: ")[2].split("; ")
    assert not sequence[0].startswith("…"), result.message
    remaining = iter(sequence)
    assert all(any(step.startswith(name) for step in remaining) for name in steps), sequence


class ComparesPasswordPrefix(ControllerCore):
    """The old password of a change may have additional letters."""

    def set_password(self, request: Request) -> bool:
        value, old = request.value, self.store.settings.password
        if value is not None and value.old.startswith(old):
            request = replace(request, value=value._replace(old=old))
        return super().set_password(request)


def test_longer_old_password_is_tried(run_cases: RunCases) -> None:
    """Sequences sometimes send an old password with additional letters."""
    assert "4.2/3" in run_cases(ComparesPasswordPrefix, "4.2/3", examples=20).violated


class HasManyPrograms(ControllerCore):
    """There are so many programs that the list has several parts."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        for number in range(20):
            self.store.write(b"some-old-program-%02d.rob" % number, b"")


@pytest.mark.parametrize("list_cont", ["push", "request"])
def test_list_is_read_completely(list_cont: str) -> None:
    """No part of a list is treated as a part of the next list (A-4.10-3)."""
    dialect = DEFAULT.replace(list_cont=list_cont)
    access, ics = MemoryAccess(Robot(HasManyPrograms, dialect).network), Ics(dialect=dialect)
    adapter = ControllerAdapter(access, ics, PASSWORD, Options(allowed=ALL))
    subject = adapter.subject(Observer(adapter.role, ics))
    number = [query.name for query in QUERIES].index("list_programs")
    ask = Step("query", *divmod(number, VALUES), 0)
    model = Model(subject, [], Scene([b"new.rob"]))
    for step in (ask, Step("upload", 0, 0, 0), ask, Step("list_programs", 0, 0, 0)):
        model.perform(step)


class EmptyListAfter40Requests(ControllerCore):
    """After forty requests on a connection, its list is empty."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._requests: Counter[int] = Counter()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self._requests[session.connection] += 1
        super().handle(session, frame, now_s)

    def list_programs(self, request: Request) -> NameListPart:
        if self._requests[request.session.connection] > 40:
            return NameListPart(more=False, names=())
        return super().list_programs(request)


def test_fault_after_many_requests(run_cases: RunCases) -> None:
    """A fault that appears after many requests is found; the message contains the last steps."""
    result = run_cases(EmptyListAfter40Requests, "4.10/11", examples=6)["3/31.long-use"]
    assert result.verdict is Verdict.FAIL
    assert " steps; " in result.message


class LosesSettingsDuringUploads(ControllerCore):
    """A gripper center that is set during the upload of another client is not stored."""

    def set_gripper_center(self, request: Request) -> bool:
        uploads = [session for session in self.sessions.values() if session.transfer]
        return bool(uploads) or super().set_gripper_center(request)


class RoundsInitialHeight(ControllerCore):
    """The height of an initial position is rounded to whole millimeters."""

    def set_initial_tool_position(self, request: Request) -> bool:
        pose = request.value
        return super().set_initial_tool_position(
            replace(request, value=pose._replace(z=float(round(pose.z))))
        )


class DropsRequestsInManyParts(ControllerCore):
    """A request in more than three segments is not answered."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._parts: Counter[int] = Counter()

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        self._parts[connection] += 1
        if data.endswith(b"\xaa"):
            data = data if self._parts[connection] <= 3 else b""
            self._parts[connection] = 0
        return super().receive(connection, data, now_s)


@pytest.mark.parametrize(
    "core", [LosesSettingsDuringUploads, RoundsInitialHeight, DropsRequestsInManyParts]
)
def test_rare_combination_is_found(run_cases: RunCases, core: type[ControllerCore]) -> None:
    """Sequences interleave transfers with settings, draw numbers and cut requests."""
    case = run_cases(core, "4.1/2", examples=20)["4.20/3.sequences"]
    assert case.verdict is Verdict.FAIL


@pytest.mark.parametrize(
    "readings",
    [
        {},
        {"pipelining": "one", "list_cont": "request"},
        {"max_clients": "one", "xfer_concurrency": "refuse", "estop_interrupted": "after"},
        {"loop_iter": "counts", "pose_point": "gripper", "default_none": "empty"},
    ],
)
def test_conforming_controllers_pass(readings: dict[str, str]) -> None:
    """No seed fails a conforming controller in any dialect."""
    dialect = DEFAULT.replace(**readings)
    cases = frozenset({"4.20/3.sequences", "4/15.sequences", "6.5/23.drawn"})
    options = Options(frozenset(), frozenset(ALL), seed=len(readings), examples=4, cases=cases)
    results = certified(Robot(ControllerCore, dialect), Ics(dialect=dialect), options)
    passed = {case.id for case in results.cases if case.verdict is Verdict.PASS}
    assert passed >= cases
    assert not results.counts[Verdict.FAIL]


def test_every_step_occurs_in_every_variant() -> None:
    """Steps are dealt like cards and numbered, and their requests are cut in some of them."""
    acts = ["move", "upload", "move", "stop"]
    dealer = StepDealer(acts)
    sequences = [dealer.sequence(seed, 30) for seed in range(10)]
    steps = [step for sequence in sequences for step in sequence]
    for number in range(0, len(steps) - len(acts), len(acts)):
        assert sorted(step.act for step in steps[number : number + len(acts)]) == sorted(acts)
    moves = [step.turn for step in steps if step.act == "move"]
    assert moves == [*range(len(moves))]
    assert {bool(step.cuts) for step in steps} == {False, True}
    assert len({step.seed for step in steps}) > len(steps) / 2
    assert dealer.sequence(3, 30) is sequences[3]


class RecordsOpcodes(ControllerCore):
    """Records the opcodes of all requests."""

    inbox: set[int] = set()  # noqa: RUF012 - the test empties it

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self.inbox.add(frame.opcode)
        super().handle(session, frame, now_s)


def test_only_allowed_requests_are_generated(run_cases: RunCases) -> None:
    """If only read-only cases are allowed, sequences contain only queries."""
    RecordsOpcodes.inbox.clear()
    cases = run_cases(RecordsOpcodes, "3/31", allowed=READ_ONLY, examples=20)
    assert cases["3/31.sequences"].verdict is Verdict.PASS
    assert cases["3/31.long-use"].verdict is Verdict.NONE
    names = {BY_OPCODE[opcode].name for opcode in RecordsOpcodes.inbox}
    assert names <= {c.name for c in COMMANDS if c.hazard is Hazard.READ_ONLY} | {"login"}
