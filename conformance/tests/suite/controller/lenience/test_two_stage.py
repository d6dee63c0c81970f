"""Conforming controllers that follow readings of two-stage commands without a key in the ICS.

The register lists these readings as conforming, so no case of the suite may fail.
"""

import itertools
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import pytest

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.rules.busy import STATE_OF
from scaraspec.judge.tolerances import differences, max_deviation
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import JointValues, Pose
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller import arm, motion
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.robot import DONE, MOVING, Task
from scaraspec.virtual_controller.session import Action, Request, Session

RunCases = Callable[..., Any]

_MIN_STEP = 0.5
_CLAUSES = ("4", "7", *(f"4.{n}" for n in (15, 16, 17, 18, 23, 24, 25, 26, 27, 28)))


class StopLatches(ControllerCore):
    """After a stop, motion is refused until a reset (A-4.17-2); a stop is never refused."""

    latched = False

    def emergency_stop(self, request: Request) -> Acceptance:
        if not super().emergency_stop(request).accepted:
            self.send_result(request, DONE)
        self.latched = True
        return ACCEPTED

    def _reply(self, session: Session, command: Any, frame: Frame, answer: Any) -> None:
        moves = command.name in ("set_tool_coordinates", "jog", "run_program", "simulate_program")
        if moves and self.latched and answer == ACCEPTED:
            self.robot.stop(self.plant.motion_ends_s)
            self._deferred.clear()
            answer = refused("05")
        super()._reply(session, command, frame, answer)

    def reset(self, request: Request) -> Acceptance:
        self.latched = False
        return super().reset(request)


class SlowAndAwayFromHome(StopLatches):
    """The arm is slow and not at its initial position, so that every reset takes time."""

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        start = arm.inverse(arm.Pose(296.0, 0.0, 250.0, 0.0), near=arm.UPPER)
        super().__init__(Plant(plant.clock.time(0.0), 0.0, start), *arguments, **named)

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        return super()._plan_move(pose, min(speed_percent, 2), now_s)


class DetectsProblemsLate(ControllerCore):
    """Missing programs and unreachable targets are detected late (A-4.15-1, A-4.24-5).

    A release ends when the joints are locked again (A-4.25-2). Releasing released joints and
    locking locked joints is refused (A-4.25-3).
    """

    release: Request | None = None

    def run_program(self, request: Request) -> Acceptance:
        return self._accept_refused(request, super().run_program(request), "20")

    def simulate_program(self, request: Request) -> Acceptance:
        return self._accept_refused(request, super().simulate_program(request), "20")

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        answer = super().set_tool_coordinates(request)
        return self._accept_refused(request, answer, "05") if request.value else answer

    def _accept_refused(self, request: Request, answer: Acceptance, code: str) -> Acceptance:
        if answer.code != code or self.robot.task is not None:
            return answer
        self.send_result(request, Outcome(done=False, code=code))
        return ACCEPTED

    def release_joints(self, request: Request) -> Acceptance:
        if not self.plant.locked and self.robot.task is None:
            return refused("06")
        return super().release_joints(request)

    def lock_joints(self, request: Request) -> Acceptance:
        if self.plant.locked and self.robot.task is None:
            return refused("06")
        return super().lock_joints(request)

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name == "release_joints":
            self.release = request
            return
        super().send_result(request, outcome)
        if request.command.name == "lock_joints" and self.release is not None:
            super().send_result(self.release, outcome)


class ResetsInNoTimeAtFirst(ControllerCore):
    """The first two resets take no time."""

    _resets = 0

    def reset(self, request: Request) -> Acceptance:
        self._resets += 1
        if self._resets > 2 or self.robot.refusal_code():
            return super().reset(request)
        self.send_result(request, DONE)
        return ACCEPTED


def test_a_case_is_repeated_if_a_command_ends_too_soon(run_cases: RunCases) -> None:
    """The third attempt has the time that the case needs."""
    (case,) = (c for c in run_cases(ResetsInNoTimeAtFirst, "4.8/6").values() if c.id == "4.8/6")
    assert case.verdict is Verdict.PASS
    assert [attempt.verdict for attempt in case.attempts] == [*[Verdict.NONE] * 2, Verdict.PASS]


class MovesInNoTime(ControllerCore):
    """Moves take no time, and a reset does not move the arm (A-4.18-3).

    Another jog replaces the current one (A-4.28-5). A jog with an invalid direction is not
    answered. The arm is at the limit of its workspace.
    """

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        start = arm.inverse(arm.Pose(399.9, 0.0, 350.0, 0.0), near=arm.UPPER)
        super().__init__(Plant(plant.clock.time(0.0), 0.0, start), *arguments, **named)

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        return motion.hold(super()._plan_move(pose, speed_percent, now_s).waypoints[-1])

    def reset(self, request: Request) -> Acceptance:
        if code := self.robot.refusal_code():
            return refused(code)
        self.send_result(request, DONE)
        return ACCEPTED

    def jog(self, request: Request) -> Any:
        if request.value is None:
            return SILENCE
        task = self.robot.task
        if task is not None and task.request.command.name == "jog":
            self.robot.stop(request.now_s)
        return super().jog(request)


class DelaysEverything(ControllerCore):
    """Everything is sent two seconds late (A-3-15)."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._sent: list[tuple[float, Action]] = []

    def _take_actions(self) -> list[Action]:
        now_s = self._now_s
        self._sent += [(now_s + 2, action) for action in super()._take_actions()]
        due = [action for due_s, action in self._sent if due_s <= now_s]
        self._sent = [(due_s, action) for due_s, action in self._sent if due_s > now_s]
        return due

    def _process_due(self, now_s: float) -> None:
        self._now_s = now_s
        super()._process_due(now_s)

    @property
    def next_event_s(self) -> float | None:
        times_s = [due_s for due_s, _ in self._sent]
        if (next_s := super().next_event_s) is not None:
            times_s.append(next_s)
        return min(times_s, default=None)


class UnresponsiveWhileBusy(ControllerCore):
    """While a command executes, only the emergency stop is answered (A-4-3)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if self.robot.task is None or frame.opcode == 0x32:
            super().handle(session, frame, now_s)


class SlowAndUnresponsive(UnresponsiveWhileBusy):
    """Every move takes at least two seconds, also to the current pose."""

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        plan = super()._plan_move(pose, speed_percent, now_s)
        return replace(plan, duration_s=max(plan.duration_s, 2.0))


class _SlowBrakes:
    """An activity of a tenth of a second."""

    def __init__(self, now_s: float) -> None:
        self.next_event_s = now_s + 0.1

    def advance(self, now_s: float) -> Outcome | None:
        return DONE if now_s >= self.next_event_s else None


class UnresponsiveWhileBraking(UnresponsiveWhileBusy):
    """Releasing and locking the joints takes a tenth of a second, in which nothing is answered."""

    def _set_locked(self, request: Request, *, locked: bool) -> Acceptance:
        if code := self.robot.refusal_code(moves=False):
            return refused(code)
        self.plant.locked = locked
        self.robot.task = Task(request, MOVING, _SlowBrakes(request.now_s))
        return ACCEPTED


class SimulatesInNoTime(ControllerCore):
    """A simulation takes no time (A-4.16-1), and a stop of an idle robot succeeds (A-4.17-1)."""

    def simulate_program(self, request: Request) -> Acceptance:
        answer = super().simulate_program(request)
        if answer is ACCEPTED:
            self.robot.stop(request.now_s)
            self.send_result(request, DONE)
        return answer

    def emergency_stop(self, request: Request) -> Acceptance:
        answer = super().emergency_stop(request)
        if not answer.accepted:
            self.send_result(request, DONE)
        return ACCEPTED


class ReportsNoise(ControllerCore):
    """The reported values are noisy, and the arm is at the limits of its joints.

    Every second reported value is beyond a limit, and is refused as a target (A-4.24-5).
    """

    at: Final = arm.Joints(arm.UPPER[0], 100.0, arm.LOWER[2], 0.0)
    _odd = False

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        super().__init__(Plant(plant.clock.time(0.0), 0.0, self.at), *arguments, **named)

    def _noisy_joints(self, request: Request) -> arm.Joints:
        self._odd = not self._odd
        noise = 0.012 if self._odd else -0.012
        inner, outer, wrist, rotation = self.plant.joints(request.now_s)
        return arm.Joints(inner + noise, outer + noise, wrist - noise, rotation + noise)

    def get_joint_angles(self, request: Request) -> JointValues:
        return JointValues(*(round(value, 3) for value in self._noisy_joints(request)))

    def get_tool_coordinates(self, request: Request) -> Pose:
        shown = arm.forward(self._noisy_joints(request))
        return Pose(*[round(value, 3) for value in (*shown[:4], 0.0, 0.0)])


class WrapsAngle(ControllerCore):
    """The reported thetaX is within half a turn of 0 (A-7-2), and is at the point where it wraps.

    Moves are rounded to tenths of a degree, so that the arm stays at this point.
    """

    _odd = False

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        start = arm.inverse(arm.Pose(300.0, 0.0, 250.0, 180.0), near=arm.UPPER)
        super().__init__(Plant(plant.clock.time(0.0), 0.0, start), *arguments, **named)

    def get_tool_coordinates(self, request: Request) -> Pose:
        self._odd = not self._odd
        pose = super().get_tool_coordinates(request)
        return pose._replace(theta_x=_within_half_a_turn(pose.theta_x + 0.01 * self._odd))

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        current_deg = arm.forward(self.plant.joints(now_s)).theta_x_deg
        target_deg = round(current_deg + _within_half_a_turn(pose.theta_x_deg - current_deg), 1)
        return super()._plan_move(pose._replace(theta_x_deg=target_deg), speed_percent, now_s)


def _within_half_a_turn(angle_deg: float) -> float:
    return 180 - (180 - angle_deg) % 360


@pytest.mark.parametrize(
    ("core", "requirement"),
    [
        *(
            (UnresponsiveWhileBusy, alone)
            for alone in ("3/18", "4/14", "4.17/7", "4.24/8", "6.5/20", "6.5/25")
        ),
        *((SlowAndUnresponsive, alone) for alone in ("3/18", "4.17/6", "4.24/8", "4.28/3")),
        (UnresponsiveWhileBraking, "4.25/2"),
        (SimulatesInNoTime, "4.17/6"),
        (StopLatches, "3/17"),
        (SlowAndAwayFromHome, "4.28/3"),
        (ReportsNoise, "4.21/3"),
    ],
)
def test_single_cases_probe_what_they_need(
    run_cases: RunCases, core: type[ControllerCore], requirement: str
) -> None:
    """A case that runs alone probes the readings that a complete run would already know."""
    assert not run_cases(core, requirement).violated


class DelaysStatus(ControllerCore):
    """The status of a command is reported for 30 ms after its end."""

    lag_s = 0.03
    _last_state, _ended_s = "00", -1.0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name in STATE_OF:
            self._last_state, self._ended_s = STATE_OF[request.command.name], self._now_s
        super().send_result(request, outcome)

    def _process_due(self, now_s: float) -> None:
        self._now_s = now_s
        super()._process_due(now_s)

    def get_status(self, request: Request) -> str:
        late = super().get_status(request) == "00" and request.now_s < self._ended_s + self.lag_s
        return self._last_state if late else super().get_status(request)


class DelaysStatusLong(DelaysStatus):
    """The status of a command is reported for 200 ms after its end."""

    lag_s = 0.2


def test_status_may_be_slightly_late(run_cases: RunCases) -> None:
    """The status returns to 00 after the final result (L318), not necessarily at the same time."""
    only = ("3/30", "4.8/7", "4.17/6", "4.17/8", "4.18/4", "4/7", "4/8")
    assert not run_cases(DelaysStatus, *only).problems
    assert run_cases(DelaysStatusLong, *only).violated >= {"4.8/3", "4/7"}


class SendsStatusChanges(ControllerCore):
    """Every change of the status is sent to every client without a request (A-3-16)."""

    _last_status = "00"

    def _finish_tasks(self, now_s: float) -> None:
        super()._finish_tasks(now_s)
        if self.robot.status == self._last_status:
            return
        self._last_status = self.robot.status
        for session in self.sessions.values():
            if session.logged_in:
                self.emit(session, Frame(C2A, 0x09, self._last_status.encode()))


class WrapsAngleAndSendsStatus(WrapsAngle, SendsStatusChanges):
    """Combines two independent readings."""


@pytest.mark.parametrize(
    "core",
    [
        SlowAndAwayFromHome,
        DetectsProblemsLate,
        MovesInNoTime,
        SlowAndUnresponsive,
        ReportsNoise,
        WrapsAngleAndSendsStatus,
    ],
)
def test_no_false_alarm(run_cases: RunCases, core: type[ControllerCore]) -> None:
    """No case of the two-stage commands fails because of a reading in the register."""
    cases = run_cases(core, *(r for r in REQUIREMENTS if r.partition("/")[0] in _CLAUSES))
    assert not cases.problems
    assert cases.counts[Verdict.PASS] > 60


def test_latch_is_released_by_a_completed_reset(run_cases: RunCases) -> None:
    """The result of a stopped reset is not treated as the result of the next reset."""
    stops = []

    class Watched(SlowAndAwayFromHome):
        def emergency_stop(self, request: Request) -> Acceptance:
            stops.append(request.now_s)
            return super().emergency_stop(request)

    assert not run_cases(Watched, "4.8/6").not_passed
    assert len(stops) == 2  # the first one proves that the emergency stop works


def test_slow_replies(run_cases: RunCases) -> None:
    """A program that must be interrupted runs longer than the requests before the stop take."""
    assert not run_cases(DelaysEverything, "4.15/8", "4.18/2").not_passed


class StartsReleased(ControllerCore):
    """At power-on the joints are released; moves are refused until they are locked (A-4.25-1)."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.plant.locked = False


class StopReleasesJoints(ControllerCore):
    """An emergency stop releases the joints, and moves are refused until they are locked."""

    def emergency_stop(self, request: Request) -> Acceptance:
        reply = super().emergency_stop(request)
        self.plant.locked &= not reply.accepted
        return reply


class NeedsResetFirst(StopLatches):
    """After power-on, moves are refused until a reset (A-4-1)."""

    latched = True


@pytest.mark.parametrize("core", [StartsReleased, NeedsResetFirst])
def test_robot_is_made_ready_first(run_cases: RunCases, core: type[ControllerCore]) -> None:
    """A robot that is not ready to move is made ready before the first case that moves it."""
    assert not run_cases(core, "4.24/5").not_passed


def test_stop_may_release_the_joints(run_cases: RunCases) -> None:
    """If a reset does not lock the joints, the suite locks them before a motion (A-4.17-2)."""
    assert not run_cases(StopReleasesJoints, "4.8/7", "4.15/5", "4.17/6", "4.28/4").problems


def test_robot_is_not_moved_without_need(run_cases: RunCases) -> None:
    """If no planned case moves the arm, the suite does not move it, even if motion is allowed."""
    opcodes = set()

    class Watched(NeedsResetFirst):
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            opcodes.add(frame.opcode)
            super().handle(session, frame, now_s)

    assert not run_cases(Watched, "4.6/2").not_passed
    assert opcodes.isdisjoint({0x30, 0x31, 0x33, 0x39, 0x3A, 0x3B, 0x3D})
    run_cases(Watched, "4.24/5")
    assert 0x33 in opcodes


def test_arm_returns_after_moving_away_from_its_limits(run_cases: RunCases) -> None:
    """The arm moves away along one axis at a time, and returns to its initial pose."""
    poses = [arm.forward(ReportsNoise.at)[:4]]

    class Watched(ReportsNoise):
        def set_tool_coordinates(self, request: Request) -> Acceptance:
            answer = super().set_tool_coordinates(request)
            if answer.accepted:
                poses.append(request.value[1:5])
            return answer

    assert not run_cases(Watched, "4.24/5").not_passed
    steps = [differences(there, here) for here, there in pairwise(poses)]
    assert max(map(max_deviation, poses, itertools.repeat(poses[0]))) > _MIN_STEP
    assert max_deviation(poses[-1], poses[0]) < _MIN_STEP
    assert all(sum(abs(change) > _MIN_STEP for change in step) <= 1 for step in steps)
