"""Controllers that follow readings of two-stage commands which have no key, and so no claim.

The register lists them as conforming: no case of the suite may fail of them.
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

Try = Callable[..., Any]

_VISIBLE = 0.5
_CLAUSES = ("4", "7", *(f"4.{n}" for n in (15, 16, 17, 18, 23, 24, 25, 26, 27, 28)))


class Latching(ControllerCore):
    """Behind an emergency stop nothing moves until a reset (A-4.17-2); a stop is never refused."""

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


class Away(Latching):
    """It is slow, and its initial tool position elsewhere: every reset takes its time."""

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        stands = arm.inverse(arm.Pose(296.0, 0.0, 250.0, 0.0), near=arm.UPPER)
        super().__init__(Plant(plant.clock.time(0.0), 0.0, stands), *arguments, **named)

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        return super()._plan_move(pose, min(speed_percent, 2), now_s)


class Late(ControllerCore):
    """What is missing or out of reach is found out late (A-4.15-1, A-4.24-5); a release ends when
    the joints are locked again (A-4.25-2); locked joints are not locked again (A-4.25-3)."""

    release: Request | None = None

    def run_program(self, request: Request) -> Acceptance:
        return self._later_refused(request, super().run_program(request), "20")

    def simulate_program(self, request: Request) -> Acceptance:
        return self._later_refused(request, super().simulate_program(request), "20")

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        answer = super().set_tool_coordinates(request)
        return self._later_refused(request, answer, "05") if request.value else answer

    def _later_refused(self, request: Request, answer: Acceptance, code: str) -> Acceptance:
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


class Quick(ControllerCore):
    """Moves take no time, a reset moves nothing (A-4.18-3), another jog replaces the one before
    (A-4.28-5), a jog in no direction is not answered; the arm stands at the end of its reach."""

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        stretched = arm.inverse(arm.Pose(399.9, 0.0, 350.0, 0.0), near=arm.UPPER)
        super().__init__(Plant(plant.clock.time(0.0), 0.0, stretched), *arguments, **named)

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


class Slow(ControllerCore):
    """Whatever is sent comes two seconds late (A-3-15)."""

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


class Deaf(ControllerCore):
    """A robot that executes answers nothing but the stop (A-4-3)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if self.robot.task is None or frame.opcode == 0x32:
            super().handle(session, frame, now_s)


class DeafAndSlow(Deaf):
    """Whatever it does lasts for two seconds, even a move to where it stands."""

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        way = super()._plan_move(pose, speed_percent, now_s)
        return replace(way, duration_s=max(way.duration_s, 2.0))


class _Brakes:
    """What takes a tenth of a second."""

    def __init__(self, now_s: float) -> None:
        self.next_event_s = now_s + 0.1

    def advance(self, now_s: float) -> Outcome | None:
        return DONE if now_s >= self.next_event_s else None


class DeafAtItsBrakes(Deaf):
    """The joints take their time to be released and locked, in which nothing is answered."""

    def _set_locked(self, request: Request, *, locked: bool) -> Acceptance:
        if code := self.robot.refusal_code(moves=False):
            return refused(code)
        self.plant.locked = locked
        self.robot.task = Task(request, MOVING, _Brakes(request.now_s))
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


class Trembles(ControllerCore):
    """At the ends of its travel it stands, the last digits of its readings are never still, and
    every second one lies beyond; what does is refused (A-4.24-5)."""

    at: Final = arm.Joints(arm.UPPER[0], 100.0, arm.LOWER[2], 0.0)
    _odd = False

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        super().__init__(Plant(plant.clock.time(0.0), 0.0, self.at), *arguments, **named)

    def _trembling(self, request: Request) -> arm.Joints:
        self._odd = not self._odd
        by = 0.012 if self._odd else -0.012
        inner, outer, wrist, rotation = self.plant.joints(request.now_s)
        return arm.Joints(inner + by, outer + by, wrist - by, rotation + by)

    def get_joint_angles(self, request: Request) -> JointValues:
        return JointValues(*(round(value, 3) for value in self._trembling(request)))

    def get_tool_coordinates(self, request: Request) -> Pose:
        shown = arm.forward(self._trembling(request))
        return Pose(*[round(value, 3) for value in (*shown[:4], 0.0, 0.0)])


class Turns(ControllerCore):
    """It tells thetaX within half a turn of 0 (A-7-2), and stands where a tremble turns it over.

    It turns by tenths of a degree, so that it does not creep away from there.
    """

    _odd = False

    def __init__(self, plant: Plant, *arguments: Any, **named: Any) -> None:
        stands = arm.inverse(arm.Pose(300.0, 0.0, 250.0, 180.0), near=arm.UPPER)
        super().__init__(Plant(plant.clock.time(0.0), 0.0, stands), *arguments, **named)

    def get_tool_coordinates(self, request: Request) -> Pose:
        self._odd = not self._odd
        pose = super().get_tool_coordinates(request)
        return pose._replace(theta_x=_within_half_a_turn(pose.theta_x + 0.01 * self._odd))

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        stands_deg = arm.forward(self.plant.joints(now_s)).theta_x_deg
        turned_deg = round(stands_deg + _within_half_a_turn(pose.theta_x_deg - stands_deg), 1)
        return super()._plan_move(pose._replace(theta_x_deg=turned_deg), speed_percent, now_s)


def _within_half_a_turn(angle_deg: float) -> float:
    return 180 - (180 - angle_deg) % 360


@pytest.mark.parametrize(
    ("core", "requirement"),
    [
        *((Deaf, alone) for alone in ("3/18", "4/14", "4.17/7", "4.24/8", "6.5/20", "6.5/25")),
        *((DeafAndSlow, alone) for alone in ("3/18", "4.17/6", "4.24/8", "4.28/3")),
        (DeafAtItsBrakes, "4.25/2"),
        (SimulatesInNoTime, "4.17/6"),
        (Latching, "3/17"),
        (Away, "4.28/3"),
        (Trembles, "4.21/3"),
    ],
)
def test_cases_that_are_tried_alone_know_no_less(
    tried: Try, core: type[ControllerCore], requirement: str
) -> None:
    """What is found out in a whole run is found out by whoever has to know it, too."""
    assert not tried(core, requirement).failed


class Lags(ControllerCore):
    """Its status is that of what has ended for a moment longer."""

    lag_s = 0.03
    _ended, _ended_s = "00", -1.0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Remember what ended, and when."""
        if request.command.name in STATE_OF:
            self._ended, self._ended_s = STATE_OF[request.command.name], self._now_s
        super().send_result(request, outcome)

    def _process_due(self, now_s: float) -> None:
        self._now_s = now_s
        super()._process_due(now_s)

    def get_status(self, request: Request) -> str:
        """Tell of it."""
        late = super().get_status(request) == "00" and request.now_s < self._ended_s + self.lag_s
        return self._ended if late else super().get_status(request)


class LagsForLong(Lags):
    """For longer than a moment."""

    lag_s = 0.2


def test_the_status_may_be_a_moment_late(tried: Try) -> None:
    """Behind the final result it returns to 00 (L318): not every robot changes both at once."""
    only = ("3/30", "4.8/7", "4.17/6", "4.17/8", "4.18/4", "4/7", "4/8")
    assert not tried(Lags, *only).alarms
    assert tried(LagsForLong, *only).failed >= {"4.8/3", "4.17/4", "4/7"}


class TellsOfItself(ControllerCore):
    """Whenever its status changes it is told to every client, whether asked for or not (A-3-16)."""

    _told = "00"

    def _finish_tasks(self, now_s: float) -> None:
        super()._finish_tasks(now_s)
        if self.robot.status == self._told:
            return
        self._told = self.robot.status
        for session in self.sessions.values():
            if session.logged_in:
                self.emit(session, Frame(C2A, 0x09, self._told.encode()))


@pytest.mark.parametrize(
    "core", [Latching, Away, Late, Quick, Deaf, DeafAndSlow, Trembles, Turns, TellsOfItself]
)
def test_no_false_alarm(tried: Try, core: type[ControllerCore]) -> None:
    """No case of the two-stage commands fails of what the register lets a controller do."""
    cases = tried(core, *(r for r in REQUIREMENTS if r.partition("/")[0] in _CLAUSES))
    assert not cases.alarms
    assert cases.counts[Verdict.PASS] > 60


def test_a_latch_is_released_by_a_reset_that_ends(tried: Try) -> None:
    """The result of the reset that was stopped is none of the reset that follows."""
    stops = []

    class Watched(Away):
        def emergency_stop(self, request: Request) -> Acceptance:
            stops.append(request.now_s)
            return super().emergency_stop(request)

    assert not tried(Watched, "4.8/6").wrong
    assert len(stops) == 2  # the first proves the emergency stop


def test_slow_replies(tried: Try) -> None:
    """A program that is to be interrupted outlasts what is asked meanwhile, slow as that may be."""
    assert not tried(Slow, "4.15/8", "4.18/2").wrong


class Loose(ControllerCore):
    """Switched on, its joints are loose, and nothing moves until they are locked (A-4.25-1)."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.plant.locked = False


class LetsGo(ControllerCore):
    """An emergency stop lets go of the joints, and nothing moves until they are locked."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Let go of them."""
        said = super().emergency_stop(request)
        self.plant.locked &= not said.accepted
        return said


class Unhomed(Latching):
    """Switched on, it moves only behind a reset (A-4-1)."""

    latched = True


@pytest.mark.parametrize("core", [Loose, Unhomed])
def test_what_a_robot_wants_first(tried: Try, core: type[ControllerCore]) -> None:
    """A robot that is not ready to move is made so, ahead of the first case that moves it."""
    assert not tried(core, "4.24/5").wrong


def test_joints_may_be_loose_behind_a_stop(tried: Try) -> None:
    """They are locked again by who wants it to move, if a reset does not do (A-4.17-2)."""
    assert not tried(LetsGo, "4.8/7", "4.15/5", "4.17/6", "4.28/4").alarms


def test_who_need_not_move_is_not_moved(tried: Try) -> None:
    """Where no case moves anything, nothing is moved, allowed or not: the plan says so."""
    asked = set()

    class Watched(Unhomed):
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            asked.add(frame.opcode)
            super().handle(session, frame, now_s)

    assert not tried(Watched, "4.6/2").wrong
    assert asked.isdisjoint({0x30, 0x31, 0x33, 0x39, 0x3A, 0x3B, 0x3D})
    tried(Watched, "4.24/5")
    assert 0x33 in asked


def test_who_steps_aside_comes_back(tried: Try) -> None:
    """It goes along one axis at a time, and at the end back to where it stood."""
    went = [arm.forward(Trembles.at)[:4]]

    class Watched(Trembles):
        def set_tool_coordinates(self, request: Request) -> Acceptance:
            answer = super().set_tool_coordinates(request)
            if answer.accepted:
                went.append(request.value[1:5])
            return answer

    assert not tried(Watched, "4.24/5").wrong
    steps = [differences(there, here) for here, there in pairwise(went)]
    assert max(map(max_deviation, went, itertools.repeat(went[0]))) > _VISIBLE
    assert max_deviation(went[-1], went[0]) < _VISIBLE
    assert all(sum(abs(way) > _VISIBLE for way in step) <= 1 for step in steps)
