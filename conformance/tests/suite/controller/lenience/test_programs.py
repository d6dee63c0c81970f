"""Conforming controllers that run programs and handle ports according to readings of their own.

No case and no rule of the judge may fail.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from scaraspec.protocol.commands import JointValues
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.program_files import Node, ProgramError, parse
from scaraspec.suite.controller.harness.own_files import OwnFiles
from scaraspec.suite.engine.journal import Journal
from scaraspec.virtual_controller.arm import UPPER, Joints, Pose, UnreachableError, inverse
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, refused
from scaraspec.virtual_controller.behaviour.programs import NO_SUCH_PROGRAM
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run
from scaraspec.virtual_controller.plant import OUTPUTS, Plant
from scaraspec.virtual_controller.robot import BAD_ARGUMENT, Task
from scaraspec.virtual_controller.session import Request
from scaraspec.virtual_controller.store import Store

RunCases = Callable[..., Any]


class StopClearsOutputs(ControllerCore):
    """An emergency stop clears all outputs; initially all of them are set."""

    def __init__(self, plant: Plant, *others: Any) -> None:
        super().__init__(plant, *others)
        self._set_all(on=True)

    def _set_all(self, *, on: bool) -> None:
        for port in range(1, OUTPUTS + 1):
            self.plant.digital_outputs[port] = on

    def emergency_stop(self, request: Request) -> Acceptance:
        self._set_all(on=False)
        return super().emergency_stop(request)


class RunClearsOutputs(StopClearsOutputs):
    """The start of a program also clears all outputs: it configures the ports (A-4.32-3)."""

    def run_program(self, request: Request) -> Acceptance:
        reply: Acceptance = super().run_program(request)
        if reply.accepted:
            self._set_all(on=False)
        return reply


@pytest.mark.parametrize("core", [StopClearsOutputs, RunClearsOutputs])
def test_other_outputs_may_be_cleared(run_cases: RunCases, core: type[ControllerCore]) -> None:
    """The start of a program and a stop may clear outputs that the program does not set."""
    only = ("4/15", "6.4/5", "6.5/9", "6.5/19", "6.5/21", "6.5/24", "6.5/26", "6.6a/14")
    assert not run_cases(core, *only, examples=10, hooks=("set_input",)).problems


class _Ticks(Run):
    """Starts nodes only at full quarters of a second."""

    def _step(self, now_s: float) -> None:
        super()._step(now_s)
        if self.next_event_s < math.inf:
            self.next_event_s = math.ceil(max(self.next_event_s, now_s + 0.001) * 4) / 4


class SlowNodes(ControllerCore):
    """A node takes at least a quarter of a second."""

    interpreter = _Ticks


def test_nodes_may_be_slow(run_cases: RunCases) -> None:
    """A wait may be late by half a second (6.5/20); the duration of other nodes is open."""
    assert not run_cases(SlowNodes, "6.5/20", "6.5/22", "6.5/23").problems


class TwoNoisyAnalogInputs(ControllerCore):
    """There are two analog inputs with ten bits for ten volts, and the lowest bit is noisy."""

    noise = 0

    def get_analog_input(self, request: Request) -> float | None:
        value = super().get_analog_input(request)
        if value is None or request.value not in (1, 8):
            return None
        self.noise ^= 1
        return min(int(value * 102.3) + self.noise, 1023)


def test_analog_inputs_may_be_few_coarse_and_noisy(run_cases: RunCases) -> None:
    """The unit (A-4.33-1) and the number of analog inputs are open."""
    assert not run_cases(TwoNoisyAnalogInputs, "4.33/2", "6.5/9", hooks=("set_analog",)).problems


class HasSensors(ControllerCore):
    """Half of the inputs change by themselves, one of them quickly."""

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        for port in (2, 4, 6):
            self.plant.digital_inputs[port] = int(now_s / (0.1 * port)) % 2 == 1


def test_inputs_may_change_by_themselves(run_cases: RunCases) -> None:
    """Programs wait only for inputs that do not change."""
    assert not run_cases(HasSensors, "6.5/9", "6.5/21").problems


class RunStoresConfiguration(ControllerCore):
    """A run stores the positions of its file (A-6.3-3) and is refused if they are unreachable."""

    def run_program(self, request: Request) -> Acceptance:
        program = self._program(request.value)
        if program is None or self.robot.task is not None:
            return super().run_program(request)
        try:
            inverse(Pose(*program.tool_position[:4]), near=UPPER)
        except UnreachableError as error:
            return refused(error.code)
        position, center = tuple(program.tool_position), tuple(program.tool_center)
        self.save(initial_tool_position=position, gripper_center=center)
        return super().run_program(request)


def test_run_may_store_the_configuration_of_its_file(run_cases: RunCases) -> None:
    """Programs contain valid positions, and resets do not rely on positions set before a run."""
    assert not run_cases(RunStoresConfiguration, "4.15/5", "4.18/3", "4.8/4").problems


class RunsShortPrograms(ControllerCore):
    """Programs of more than 200 nodes or 16 variables are refused (A-5-21)."""

    def run_program(self, request: Request) -> Acceptance:
        program = self._program(request.value)
        if program and (len(program.nodes) > 200 or len(program.variables) > 16):
            return refused(BAD_ARGUMENT)
        reply: Acceptance = super().run_program(request)
        return reply


def test_large_programs_may_be_refused(run_cases: RunCases) -> None:
    """The maximum size of a program is open (A-5-21)."""
    assert not run_cases(RunsShortPrograms, "6.4/5", "6.5/26").problems


class StoresEightFiles(ControllerCore):
    """There is room for eight files."""

    def __init__(self, plant: Plant, store: Store, *others: Any) -> None:
        super().__init__(plant, store, *others)
        self.store = Store(max_files=8)


def test_there_may_be_room_for_few_programs(run_cases: RunCases) -> None:
    """No case fails because the store is full (A-5-21)."""
    assert not run_cases(StoresEightFiles, "4.10/4", "6.5/28").problems


@dataclass(frozen=True, slots=True)
class _FailsLate:
    """An activity that fails at a given time, because the file is not a valid program."""

    ends_s: float

    @property
    def next_event_s(self) -> float:
        return self.ends_s

    def advance(self, now_s: float) -> Outcome | None:
        return Outcome(done=False, code=BAD_ARGUMENT) if now_s >= self.ends_s else None


class DetectsDamageDuringRun(ControllerCore):
    """Every stored file is accepted; a damaged one fails during its run."""

    def _start(self, request: Request, state: str) -> Acceptance:
        accepted = super()._start(request, state)
        if accepted != refused(NO_SUCH_PROGRAM) or not self.is_program(request.value):
            return accepted
        activity = _FailsLate(request.now_s + 0.1)
        self.robot.task = Task(request, state, activity, program=request.value)
        return ACCEPTED


def test_damaged_file_may_fail_during_its_run(run_cases: RunCases) -> None:
    """A failed run is as valid as a refusal (A-4.15-2), and no further event is waited for."""
    cases = run_cases(DetectsDamageDuringRun, "6.5/28")
    assert not cases.problems
    assert sum(case.duration_s for case in cases.values()) < 30


class _StartsLate(Run):
    """Starts its first node after two seconds."""

    def __init__(self, *args: Any, now_s: float, **kwargs: Any) -> None:
        super().__init__(*args, now_s=now_s + 2, **kwargs)


class LoadsProgramsSlowly(ControllerCore):
    """A program starts two seconds after the first reply."""

    interpreter = _StartsLate


class _SlowNodes(Run):
    """Each node takes 0.12 s longer."""

    def _begin(self, node: Node, now_s: float) -> float:
        return super()._begin(node, now_s) + 0.12


class InterpretsSlowly(ControllerCore):
    """Programs of 500 nodes last a minute."""

    interpreter = _SlowNodes


@pytest.mark.parametrize(
    ("core", "only"),
    [(LoadsProgramsSlowly, ("6.5/20", "6.5/9")), (InterpretsSlowly, ("6.5/26",))],
)
def test_start_and_nodes_may_take_time(
    run_cases: RunCases, core: type[ControllerCore], only: tuple[str, ...]
) -> None:
    """Only the waits of a program have a duration (6.5/20)."""
    assert not run_cases(core, *only, hooks=("set_analog",)).problems


class Overshoots(ControllerCore):
    """After a motion the gripper swings by 0.3 degrees for a third of a second."""

    def _joints(self, now_s: float) -> Joints:
        joints, since_s = self.plant.joints(now_s), now_s - self.plant.motion_ends_s
        swing = 0.3 * math.exp(-since_s / 0.08) * math.sin(50 * since_s) if since_s > 0 else 0.0
        return joints._replace(rotation_deg=joints.rotation_deg + swing)

    def get_joint_angles(self, request: Request) -> JointValues:
        return JointValues(*self._joints(request.now_s))


class ReportsWholeNumbers(ControllerCore):
    """Joint angles are reported without decimals (A-T-5)."""

    def get_joint_angles(self, request: Request) -> JointValues:
        return JointValues(*map(round, super().get_joint_angles(request)))


@pytest.mark.parametrize("core", [Overshoots, ReportsWholeNumbers])
def test_arm_may_be_near_the_point(run_cases: RunCases, core: type[ControllerCore]) -> None:
    """The last point of a program may be reported after a moment, and rounded."""
    assert not run_cases(core, "6.5/27").problems


class StoresOnlyPrograms(ControllerCore):
    """The last chunk of a file that is not a program is refused (A-5-21)."""

    def _write(self, name: bytes, content: bytes) -> bool:
        try:
            parse(content)
        except ProgramError:
            return False
        return super()._write(name, content)


def test_only_programs_may_be_stored(run_cases: RunCases) -> None:
    """Cases that need other files are skipped, and the reason names it."""
    cases = run_cases(StoresOnlyPrograms, "4.10/11", "5.1/8", "5.4/7", "6.5/26", "3/30")
    assert not cases.problems
    assert "the subject stores only valid programs" in cases["5.1/8"].message


class AcceptsShortNames(ControllerCore):
    """A name has at most eight characters and an extension of three (A-5-20)."""

    def upload_name(self, request: Request) -> bool:
        stem, _, extension = request.value.partition(b".")
        return len(stem) <= 8 and len(extension) <= 3 and super().upload_name(request)


def test_names_of_the_suite_are_short(run_cases: RunCases) -> None:
    """Cases that do not judge the length of names need no more than eight characters."""
    assert not run_cases(AcceptsShortNames, "5.4/1", "6.5/19").problems
    files = OwnFiles(Journal(), lambda: "ab")
    assert [files.new_name(".rob") for _ in range(1000)][-1] == b"zsab1000.rob"
