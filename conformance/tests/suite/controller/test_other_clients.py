"""A client that changes settings during a run makes findings inconclusive, not failures.

The other client is part of the virtual controller here and acts at given times. Each request of the
suite takes a few milliseconds, so that the other client can act between any two of them.
"""

from collections.abc import Callable, Collection, Sequence
from datetime import datetime, timedelta
from functools import cache
from typing import ClassVar, Final

import pytest

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import PASSWORD, Robot, tokens
from scaraspec.protocol.commands import Point
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Case, Results
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.other_clients import REASON
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Request

_REQUEST_S: Final = 0.004
_LONGEST_S: Final = 20.0
_NOT_DESTRUCTIVE: Final = (Hazard.READ_ONLY, Hazard.STATE, Hazard.MOTION)

Act = Callable[[ControllerCore, int, float], object]
"""An action of the other client. Arguments: controller, number of earlier actions, time."""


class SharedCore(ControllerCore):
    """A controller that another client uses, too.

    Attributes:
        act: The action of the other client.
        first_s: Time of the first action.
        every_s: Interval between actions; 0 for a single action.
        times: The number of actions so far.
    """

    act: ClassVar[Act]
    first_s: ClassVar[float]
    every_s: ClassVar[float]
    times: ClassVar[int]

    @property
    def next_event_s(self) -> float | None:
        events = (super().next_event_s, self._next_s)
        return min((event for event in events if event is not None), default=None)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        self._act_if_due(now_s)
        return super().receive(connection, data, now_s)

    def advance(self, now_s: float) -> list[Action]:
        self._act_if_due(now_s)
        return super().advance(now_s)

    @property
    def _next_s(self) -> float | None:
        cls = type(self)
        over = cls.times and not cls.every_s
        return None if over else cls.first_s + cls.times * cls.every_s

    def _act_if_due(self, now_s: float) -> None:
        cls = type(self)
        while (next_s := self._next_s) is not None and next_s <= now_s:
            cls.act(self, cls.times, next_s)
            cls.times += 1


class DistantRobot(Robot):
    """A controller to which each request takes some time."""

    def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
        self.network.now_s = now_s + _REQUEST_S
        return super().receive(connection, data, self.network.now_s)


def nothing(_core: ControllerCore, _times: int, _now_s: float) -> None:
    """Do nothing."""


def run(  # noqa: PLR0913 - each may differ
    only: str,
    act: Act = nothing,
    first_s: float = 0.0,
    every_s: float = 0.0,
    *,
    core: type[ControllerCore] = ControllerCore,
    allowed: Collection[Hazard] = _NOT_DESTRUCTIVE,
) -> Results:
    """Run the suite while another client acts.

    Args:
        only: The requirements.
        act: The action of the other client.
        first_s: Time of the first action.
        every_s: Interval between actions; 0 for a single action.
        core: The controller.
        allowed: The allowed hazards.
    """
    values = {"act": staticmethod(act), "first_s": first_s, "every_s": every_s, "times": 0}
    robot = DistantRobot(type("Shared", (SharedCore, core), values), DEFAULT)
    options = Options(
        frozenset(requirement.id for requirement in select(only)),
        frozenset(allowed),
        undefined=True,
        examples=3,
    )
    access = MemoryAccess(robot.network, wait_limit_s=_LONGEST_S)
    names = tokens().__next__
    adapter = ControllerAdapter(access, Ics(), PASSWORD, options, draw_token=names)
    return Run(adapter).results()


# ---------------------------------------------------------------------- actions of the other client


def gripper(core: ControllerCore, times: int, _now_s: float) -> None:
    """Set the gripper center, each time to another value."""
    core.save(gripper_center=(9.0 + times, -7.5, 3.25))


def initial_gripper(core: ControllerCore, _times: int, _now_s: float) -> None:
    """Set the gripper center to its value at the start of the run."""
    core.save(gripper_center=(0.0, 0.0, 0.0))


def clock(core: ControllerCore, times: int, now_s: float) -> None:
    """Set the clock, each time to another day."""
    core.plant.clock.set(datetime(2031, 5, 6) + timedelta(days=times), now_s)  # noqa: DTZ001 - the document names no zone


def correct_clock(core: ControllerCore, _times: int, now_s: float) -> None:
    """Set the clock to the time that it would show without the suite."""
    core.plant.clock.set(datetime(2026, 1, 1) + timedelta(seconds=now_s), now_s)  # noqa: DTZ001 - the document names no zone


def default(core: ControllerCore, times: int, _now_s: float) -> None:
    """Store or overwrite a program, and set it as the default program."""
    name = b"theirs%d.rob" % (times % 2)
    core.store.write(name, b"x")
    core.save(default_program=name)


def same_default(core: ControllerCore, _times: int, _now_s: float) -> None:
    """Set the same program as the default program each time."""
    default(core, 0, 0.0)


def file(core: ControllerCore, times: int, _now_s: float) -> None:
    """Store a program; there are at most 300."""
    core.store.write(b"theirs%d.rob" % (times % 300), b"x")


def initial(core: ControllerCore, times: int, _now_s: float) -> None:
    """Change the initial position by a millimeter, up and down in turns."""
    x, y, z, *thetas = core.store.settings.initial_tool_position
    core.save(initial_tool_position=(x, y, z + (1 if times % 2 else -1), *thetas))


def output(core: ControllerCore, times: int, _now_s: float) -> None:
    """Invert an output."""
    port = 3 + times % 5
    core.plant.digital_outputs[port] = not core.plant.digital_outputs[port]


def anything(core: ControllerCore, times: int, now_s: float) -> None:
    """Execute all of these actions in turn."""
    acts = (gripper, clock, default, file, initial, output)
    acts[times % len(acts)](core, times, now_s)


_CASES: Final = (
    (gripper, "4.19,4.20,4.21"),
    (clock, "4.5,4.6"),
    (default, "4.12,4.13"),
    (same_default, "4.12,4.13"),
    (file, "4.10"),
    (initial, "4.21,4.22"),
    (output, "4.32,4.34"),
    (anything, "4.5,4.6,4.10,4.13,4.20,4.21,4.34"),
)
_NAMES: Final = [act.__name__ for act, _ in _CASES]


def check_no_failure(results: Results) -> list[Case]:
    """Assert that no case failed; return the cases that another client made inconclusive."""
    failed = [c for c in results.cases if c.verdict in (Verdict.FAIL, Verdict.ERROR)]
    assert not failed, [(case.id, case.message) for case in failed]
    inconclusive = [case for case in results.cases if case.verdict is Verdict.INCONCLUSIVE]
    others = [case for case in inconclusive if not case.message.startswith(REASON)]
    assert {case.id for case in others} <= {"run.restore"}, [case.message for case in others]
    assert results.verdict is (Conclusion.INCONCLUSIVE if inconclusive else Conclusion.NO_VIOLATION)
    return [case for case in inconclusive if case not in others]


def other_client_notices(results: Results) -> list[str]:
    """Return the notices of the results about another client."""
    return [notice for notice in results.notices if notice.startswith(REASON)]


@cache
def _duration_s(only: str) -> float:
    """Return the duration of these cases without another client."""
    return sum(case.duration_s for case in run(only).cases)


@pytest.mark.parametrize(("act", "only"), _CASES[:-1], ids=_NAMES[:-1])
def test_one_change(act: Act, only: str) -> None:
    """A single change at any moment of the run fails no case."""
    moment = 0.3 + 0.6 * _NAMES.index(act.__name__) / len(_NAMES)
    check_no_failure(run(only, act, moment * _duration_s(only)))


@pytest.mark.parametrize("every_s", [0.3, 4.7])
@pytest.mark.parametrize(("act", "only"), _CASES, ids=_NAMES)
def test_repeated_changes(act: Act, only: str, every_s: float) -> None:
    """Repeated changes fail no case, however frequent they are."""
    check_no_failure(run(only, act, 0.9, every_s))


class InvertsOnce(ControllerCore):
    """Another client inverts an output once, before the suite reads what it has just set."""

    _settings = 0

    def set_digital_output(self, request: Request) -> bool:
        accepted = super().set_digital_output(request)
        self._settings += 1
        if self._settings == 25:
            outputs = self.plant.digital_outputs
            outputs[request.value.port] = not outputs[request.value.port]
        return accepted


def test_output_changed_before_it_is_read() -> None:
    """The case passes when it is repeated, so that the failure does not count."""
    assert check_no_failure(run("4.32/6", core=InvertsOnce))


@pytest.mark.parametrize("every_s", [0.3, 4.7])
@pytest.mark.parametrize(
    ("act", "only"),
    [(initial_gripper, "4.20"), (correct_clock, "4.5,4.6")],
    ids=["gripper", "clock"],
)
def test_initial_values(act: Act, only: str, every_s: float) -> None:
    """A client that sets the initial values again is detected by setting another value."""
    check_no_failure(run(only, act, 0.9, every_s))


def test_the_reason_is_reported() -> None:
    """Each finding has the reason and the observation, and the results have one notice."""
    results = run("4.20", gripper, 0.9, 0.3)
    cases = check_no_failure(results)
    assert cases
    for case in cases:
        assert case.message.startswith(f"{REASON}: the gripper centre changed from ")
    assert "The case had found: " in cases[0].message
    (notice,) = other_client_notices(results)
    assert notice.startswith(f"{REASON}: the gripper centre changed from ")


def test_a_run_without_other_clients() -> None:
    """Without another client, there is no notice and all cases are conformant."""
    results = run("4.5,4.6,4.10,4.12,4.13,4.19,4.20,4.21,4.22,4.34", allowed=ALL)
    assert not check_no_failure(results)
    assert not other_client_notices(results)


# ---------------------------------------------------------------------- faults remain failures


@pytest.mark.parametrize(
    "name",
    [
        "gripper-loses-its-sign",
        "gripper-comes-late",
        "late-grippers-are-forgotten",
        "reset-clears-the-centre",
    ],
)
def test_faults(name: str) -> None:
    """The effect of a fault is not attributed to another client."""
    results = run("4.20", core=mutants()[name].wrong)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert not other_client_notices(results)


class ForgetsGripperCenter(ControllerCore):
    """The gripper center is reset after a fixed time."""

    after_s: ClassVar[float]
    _set_s = 0.0

    def set_gripper_center(self, request: Request) -> bool:
        self._set_s = request.now_s
        return super().set_gripper_center(request)

    def get_gripper_center(self, request: Request) -> Point:
        if request.now_s - self._set_s > self.after_s:
            self.save(gripper_center=(0.0, 0.0, 0.0))
        return super().get_gripper_center(request)


@pytest.mark.parametrize("after_s", [0.01, 0.1])
def test_forgotten_setting(after_s: float) -> None:
    """A setting that is reset after a fixed time is not attributed to another client."""
    core = type("Forgets", (ForgetsGripperCenter,), {"after_s": after_s})
    results = run("4.20", core=core)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert not other_client_notices(results)


class VariesGripperCenter(ControllerCore):
    """The reported gripper center sometimes differs."""

    requests = 0

    def get_gripper_center(self, request: Request) -> Point:
        self.requests += 1
        point = super().get_gripper_center(request)
        return point._replace(x=point.x + 5) if self.requests**2 % 7 in (1, 2) else point


def test_varying_value() -> None:
    """A value that varies by itself is a failure."""
    results = run("4.19,4.20", core=VariesGripperCenter)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert not other_client_notices(results)


def test_faults_of_other_settings() -> None:
    """Another client that sets the clock does not affect findings of other settings."""
    core = mutants()["gripper-of-two-numbers"].wrong
    results = run("4.5,4.19,4.20", clock, 0.9, 0.3, core=core)
    failed = [case.id for case in results.cases if case.verdict is Verdict.FAIL]
    assert "4.19/2" in failed
    assert not [case for case in failed if case.startswith("4.5")]
    assert results.verdict is Conclusion.NONCONFORMANT
