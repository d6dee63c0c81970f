"""Controllers that run programs and have ports in ways of their own, which are open.

No case of the suite may fail of them, nor may the judge that watches it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.arm import UPPER, Pose, UnreachableError, inverse
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, refused
from scaraspec.virtual_controller.behaviour.programs import NO_SUCH_PROGRAM
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run
from scaraspec.virtual_controller.plant import OUTPUTS, Plant
from scaraspec.virtual_controller.robot import BAD_ARGUMENT, Task
from scaraspec.virtual_controller.session import Request
from scaraspec.virtual_controller.store import Store

Try = Callable[..., Any]


class SwitchesOffAtAStop(ControllerCore):
    """An emergency stop switches off every output, of which some are on at first."""

    def __init__(self, plant: Plant, *others: Any) -> None:
        super().__init__(plant, *others)
        self._switch(on=True)

    def _switch(self, *, on: bool) -> None:
        for port in range(1, OUTPUTS + 1):
            self.plant.digital_outputs[port] = on

    def emergency_stop(self, request: Request) -> Acceptance:
        """Switch them off."""
        self._switch(on=False)
        return super().emergency_stop(request)


class SwitchesOffAtTheBeginning(SwitchesOffAtAStop):
    """So does a program that begins: it configures the ports (A-4.32-3)."""

    def run_program(self, request: Request) -> Acceptance:
        """Switch them off."""
        answer: Acceptance = super().run_program(request)
        if answer.accepted:
            self._switch(on=False)
        return answer


@pytest.mark.parametrize("core", [SwitchesOffAtAStop, SwitchesOffAtTheBeginning])
def test_outputs_that_are_not_set_may_be_off(tried: Try, core: type[ControllerCore]) -> None:
    """What a program does not set it may switch off as it begins, and a stop at any time."""
    only = ("4/15", "6.4/5", "6.5/9", "6.5/19", "6.5/21", "6.5/24", "6.5/26", "6.6a/14")
    assert not tried(core, *only, examples=20, handled=("set_input",)).alarms


class _Ticks(Run):
    """Begins a node at full quarters of a second only."""

    def _step(self, now_s: float) -> None:
        super()._step(now_s)
        if self.next_event_s < math.inf:
            self.next_event_s = math.ceil(max(self.next_event_s, now_s + 0.001) * 4) / 4


class Slow(ControllerCore):
    """A node takes a quarter of a second at least."""

    interpreter = _Ticks


def test_nodes_may_take_their_time(tried: Try) -> None:
    """Each wait may be late by half a second (6.5/20); how long other nodes take is open."""
    assert not tried(Slow, "6.5/20", "6.5/22", "6.5/23").alarms


class Converts(ControllerCore):
    """It has two analog inputs, of ten bits for ten volts, whose last bit is never still."""

    noise = 0

    def get_analog_input(self, request: Request) -> float | None:
        """Convert it."""
        value = super().get_analog_input(request)
        if value is None or request.value not in (1, 8):
            return None
        self.noise ^= 1
        return min(int(value * 102.3) + self.noise, 1023)


def test_analog_inputs_may_be_few_coarse_and_noisy(tried: Try) -> None:
    """In which unit they show what drives them is open (A-4.33-1), and how many there are."""
    assert not tried(Converts, "4.33/2", "6.5/9", handled=("set_analog",)).alarms


class HasSensors(ControllerCore):
    """Half of its inputs change by themselves, one of them quickly."""

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        for port in (2, 4, 6):
            self.plant.digital_inputs[port] = int(now_s / (0.1 * port)) % 2 == 1


def test_inputs_may_change_by_themselves(tried: Try) -> None:
    """Programs wait by those that are still."""
    assert not tried(HasSensors, "6.5/9", "6.5/21").alarms


class SetsItsConfiguration(ControllerCore):
    """A run sets the positions of its file for good (A-6.3-3), which must be ones that can be."""

    def run_program(self, request: Request) -> Acceptance:
        """Set them."""
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


def test_a_run_may_set_what_its_file_configures(tried: Try) -> None:
    """No program asks for what cannot be, and no reset relies on what was set before one."""
    assert not tried(SetsItsConfiguration, "4.15/5", "4.18/3", "4.8/4").alarms


class RunsShortPrograms(ControllerCore):
    """Runs programs of no more than 200 nodes and 16 variables (A-5-21)."""

    def run_program(self, request: Request) -> Acceptance:
        """Count them."""
        program = self._program(request.value)
        if program and (len(program.nodes) > 200 or len(program.variables) > 16):
            return refused(BAD_ARGUMENT)
        answer: Acceptance = super().run_program(request)
        return answer


def test_large_programs_may_be_refused(tried: Try) -> None:
    """How large a program may be is open; what is run of one is right."""
    assert not tried(RunsShortPrograms, "6.4/5", "6.5/26").alarms


class HasRoomForFew(ControllerCore):
    """It has room for eight programs."""

    def __init__(self, plant: Plant, store: Store, *others: Any) -> None:
        super().__init__(plant, store, *others)
        self.store = Store(max_files=8)


def test_there_may_be_room_for_few_programs(tried: Try) -> None:
    """No case fails because it stores more of them than there is room for (A-5-21)."""
    assert not tried(HasRoomForFew, "4.10/4", "6.5/28").alarms


@dataclass(frozen=True, slots=True)
class _Fails:
    """An act that ends after a tenth of a second, because the file is no program."""

    ends_s: float

    @property
    def next_event_s(self) -> float:
        """When it is found out."""
        return self.ends_s

    def advance(self, now_s: float) -> Outcome | None:
        """Say so."""
        return Outcome(done=False, code=BAD_ARGUMENT) if now_s >= self.ends_s else None


class ReadsAsItRuns(ControllerCore):
    """A file that is stored is accepted, whatever is in it; that it is damaged ends its run."""

    def _start(self, request: Request, state: str) -> Acceptance:
        accepted = super()._start(request, state)
        if accepted != refused(NO_SUCH_PROGRAM) or not self.is_program(request.value):
            return accepted
        act = _Fails(request.now_s + 0.1)
        self.robot.task = Task(request, state, act, program=request.value)
        return ACCEPTED


def test_a_damaged_file_may_fail_as_it_runs(tried: Try) -> None:
    """It is as good as a refusal (A-4.15-2), and nothing is waited for behind such an end."""
    outcomes = tried(ReadsAsItRuns, "6.5/28")
    assert not outcomes.alarms
    assert sum(case.duration_s for case in outcomes.values()) < 30
