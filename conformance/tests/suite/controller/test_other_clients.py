"""A client that changes settings while the suite runs makes findings inconclusive, never failures.

The other client is part of the virtual controller here and acts at times of its own. Each request
of the suite takes a few milliseconds, so that the other client can come between any two of them.
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
_GENTLE: Final = (Hazard.READ_ONLY, Hazard.STATE, Hazard.MOTION)

Act = Callable[[ControllerCore, int, float], object]
"""What the other client does: to this controller, for which time, and when."""


class SharedCore(ControllerCore):
    """A controller that serves another client, too.

    Attributes:
        act: What the other client does.
        first_s: When it does that for the first time.
        every_s: After what time it does it again; 0 for once only.
        times: How often it has done it.
    """

    act: ClassVar[Act]
    first_s: ClassVar[float]
    every_s: ClassVar[float]
    times: ClassVar[int]

    @property
    def next_event_s(self) -> float | None:
        """When something happens by itself."""
        events = (super().next_event_s, self._next_s)
        return min((event for event in events if event is not None), default=None)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Bytes have come from the suite."""
        self._let_act(now_s)
        return super().receive(connection, data, now_s)

    def advance(self, now_s: float) -> list[Action]:
        """Time has passed."""
        self._let_act(now_s)
        return super().advance(now_s)

    @property
    def _next_s(self) -> float | None:
        kind = type(self)
        over = kind.times and not kind.every_s
        return None if over else kind.first_s + kind.times * kind.every_s

    def _let_act(self, now_s: float) -> None:
        kind = type(self)
        while (next_s := self._next_s) is not None and next_s <= now_s:
            kind.act(self, kind.times, next_s)
            kind.times += 1


class DistantRobot(Robot):
    """A controller to which each request takes some time."""

    def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
        """Bytes have come, after a while."""
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
    allowed: Collection[Hazard] = _GENTLE,
) -> Results:
    """Run the suite while another client acts.

    Args:
        only: The requirements.
        act: What the other client does.
        first_s: When it does that for the first time.
        every_s: After what time it does it again; 0 for once only.
        core: The controller.
        allowed: The hazards that are allowed.
    """
    values = {"act": staticmethod(act), "first_s": first_s, "every_s": every_s, "times": 0}
    robot = DistantRobot(type("Shared", (SharedCore, core), values), DEFAULT)
    options = Options(
        frozenset(each.id for each in select(only)), frozenset(allowed), undefined=True, examples=5
    )
    access = MemoryAccess(robot.network, wait_limit_s=_LONGEST_S)
    names = tokens().__next__
    setting = ControllerAdapter(access, Ics(), PASSWORD, options, draw_token=names)
    return Run(setting).results()


# ---------------------------------------------------------------------- what another client does


def gripper(core: ControllerCore, times: int, _now_s: float) -> None:
    """Set the gripper centre, to another value each time."""
    core.save(gripper_center=(9.0 + times, -7.5, 3.25))


def former_gripper(core: ControllerCore, _times: int, _now_s: float) -> None:
    """Set the gripper centre to what it was at the start of the run."""
    core.save(gripper_center=(0.0, 0.0, 0.0))


def clock(core: ControllerCore, times: int, now_s: float) -> None:
    """Set the clock, to another day each time."""
    core.plant.clock.set(datetime(2031, 5, 6) + timedelta(days=times), now_s)  # noqa: DTZ001 - the document names no zone


def right_clock(core: ControllerCore, _times: int, now_s: float) -> None:
    """Set the clock to what it would show without the suite."""
    core.plant.clock.set(datetime(2026, 1, 1) + timedelta(seconds=now_s), now_s)  # noqa: DTZ001 - the document names no zone


def default(core: ControllerCore, times: int, _now_s: float) -> None:
    """Store a program, or overwrite it, and make it the default one."""
    name = b"theirs%d.rob" % (times % 2)
    core.store.write(name, b"x")
    core.save(default_program=name)


def same_default(core: ControllerCore, _times: int, _now_s: float) -> None:
    """Make one and the same program the default one."""
    default(core, 0, 0.0)


def file(core: ControllerCore, times: int, _now_s: float) -> None:
    """Store a program, up to three hundred."""
    core.store.write(b"theirs%d.rob" % (times % 300), b"x")


def initial(core: ControllerCore, times: int, _now_s: float) -> None:
    """Set the initial position a millimetre lower or higher."""
    x, y, z, *thetas = core.store.settings.initial_tool_position
    core.save(initial_tool_position=(x, y, z + (1 if times % 2 else -1), *thetas))


def output(core: ControllerCore, times: int, _now_s: float) -> None:
    """Switch an output over."""
    port = 3 + times % 5
    core.plant.digital_outputs[port] = not core.plant.digital_outputs[port]


def anything(core: ControllerCore, times: int, now_s: float) -> None:
    """Do all of that in turn."""
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


def check(results: Results) -> list[Case]:
    """There is no failure; the cases that another client has made inconclusive."""
    wrong = [c for c in results.cases if c.verdict in (Verdict.FAIL, Verdict.ERROR)]
    assert not wrong, [(case.id, case.message) for case in wrong]
    doubtful = [case for case in results.cases if case.verdict is Verdict.INCONCLUSIVE]
    others = [case for case in doubtful if not case.message.startswith(REASON)]
    assert {case.id for case in others} <= {"run.restore"}, [case.message for case in others]
    assert results.verdict is (Conclusion.INCONCLUSIVE if doubtful else Conclusion.CONFORMANT)
    return [case for case in doubtful if case not in others]


def suspicions(results: Results) -> list[str]:
    """What the head of the results says of another client."""
    return [notice for notice in results.notices if notice.startswith(REASON)]


@cache
def _lasts_s(only: str) -> float:
    """How long these cases last without another client."""
    return sum(case.duration_s for case in run(only).cases)


@pytest.mark.parametrize("moment", [0.47, 0.83])
@pytest.mark.parametrize(("act", "only"), _CASES, ids=_NAMES)
def test_one_change(act: Act, only: str, moment: float) -> None:
    """A single change, at whatever moment of the run, fails no case."""
    check(run(only, act, moment * _lasts_s(only)))


@pytest.mark.parametrize("every_s", [0.3, 4.7])
@pytest.mark.parametrize(("act", "only"), _CASES, ids=_NAMES)
def test_change_after_change(act: Act, only: str, every_s: float) -> None:
    """Changes in a row fail no case, however often they come."""
    check(run(only, act, 0.9, every_s))


@pytest.mark.parametrize("every_s", [0.3, 4.7])
@pytest.mark.parametrize(
    ("act", "only"), [(former_gripper, "4.20"), (right_clock, "4.5,4.6")], ids=["gripper", "clock"]
)
def test_former_values(act: Act, only: str, every_s: float) -> None:
    """A client that sets what there was at the start is proved by setting something else."""
    check(run(only, act, 0.9, every_s))


def test_the_reason_is_reported() -> None:
    """Each finding names the reason and what was seen, and the run says so once, at its head."""
    results = run("4.20", gripper, 0.9, 0.3)
    cases = check(results)
    assert cases
    for case in cases:
        assert case.message.startswith(f"{REASON}: the gripper centre changed from ")
    assert "The case had found: " in cases[0].message
    (notice,) = suspicions(results)
    assert notice.startswith(f"{REASON}: the gripper centre changed from ")


def test_a_run_without_other_clients() -> None:
    """Nothing is suspected, and all is conformant."""
    results = run("4.5,4.6,4.10,4.12,4.13,4.19,4.20,4.21,4.22,4.34", allowed=ALL)
    assert not check(results)
    assert not suspicions(results)


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
    """What a fault makes of a setting is no work of another client."""
    results = run("4.20", core=mutants()[name].wrong)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert not suspicions(results)


class ForgetsGripper(ControllerCore):
    """A new gripper centre is forgotten after a fixed time."""

    after_s: ClassVar[float]
    _set_s = 0.0

    def set_gripper_center(self, request: Request) -> bool:
        """Note when."""
        self._set_s = request.now_s
        return super().set_gripper_center(request)

    def get_gripper_center(self, request: Request) -> Point:
        """Forget it."""
        if request.now_s - self._set_s > self.after_s:
            self.save(gripper_center=(0.0, 0.0, 0.0))
        return super().get_gripper_center(request)


@pytest.mark.parametrize("after_s", [0.01, 0.02, 0.05, 0.1])
def test_what_is_forgotten(after_s: float) -> None:
    """A controller that forgets a setting after a fixed time has no other client."""
    core = type("Forgets", (ForgetsGripper,), {"after_s": after_s})
    results = run("4.20", core=core)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert not suspicions(results)


class VariesGripper(ControllerCore):
    """The gripper centre is now and then told as another one."""

    readings = 0

    def get_gripper_center(self, request: Request) -> Point:
        """Tell it, or another one."""
        self.readings += 1
        point = super().get_gripper_center(request)
        return point._replace(x=point.x + 5) if self.readings**2 % 7 in (1, 2) else point


def test_noise() -> None:
    """Values that vary by themselves are a fault."""
    results = run("4.19,4.20", core=VariesGripper)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert not suspicions(results)


def test_faults_elsewhere() -> None:
    """Another client that sets the clock makes nothing inconclusive that does not depend on it."""
    core = mutants()["gripper-of-two-numbers"].wrong
    results = run("4.5,4.19,4.20", clock, 0.9, 0.3, core=core)
    failed = [case.id for case in results.cases if case.verdict is Verdict.FAIL]
    assert "4.19/2" in failed
    assert not [case for case in failed if case.startswith("4.5")]
    assert results.verdict is Conclusion.NONCONFORMANT
