"""Mutants of clause 4.17: the emergency stop."""

from collections.abc import Callable
from typing import Any, Final

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import TWO_STAGE, first_reply, outcome
from scaraspec.mutants.operators.controller.requests import (
    Condition,
    answer,
    answer_when,
    executing,
    refuses,
)
from scaraspec.mutants.operators.controller.transfers import receiver_of, sender_of
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, JogDirection, Outcome
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE, SIMULATING, Task
from scaraspec.virtual_controller.session import Request, Session

_REFUSED: Final = Acceptance(accepted=False)


def _refused(when: Condition) -> Core:
    return answer_when("emergency_stop", when, _REFUSED)


def _has_just_begun(core: ControllerCore, request: Request) -> bool:
    task = core.robot.task
    return task is not None and bool(task.program) and request.now_s - task.request.now_s < 0.001


def _is_other_connection(core: ControllerCore, request: Request) -> bool:
    task = core.robot.task
    return task is not None and task.request.session is not request.session


def _stopped(act: Callable[[ControllerCore, Request, Task], None]) -> Core:
    """`act` is called with the task that a stop has ended."""

    class Stopped(ControllerCore):
        def emergency_stop(self, request: Request) -> Acceptance:
            task = self.robot.task
            reply = super().emergency_stop(request)
            if task is not None:
                act(self, request, task)
            return reply

    return Stopped


def _continue_if_downloading(core: ControllerCore, request: Request, task: Task) -> None:
    if sender_of(request.session):
        core.robot.task = task


def _continue_simulation(core: ControllerCore, _request: Request, task: Task) -> None:
    if task.state == SIMULATING:
        core.robot.task = task


def _continue_jog(core: ControllerCore, request: Request, task: Task) -> None:
    if task.request.command.name == "jog":
        _jog(core, request, task.request.value)


def _jog(core: ControllerCore, request: Request, direction: JogDirection) -> None:
    core.plant.start(motion.jog(core.plant.joints(request.now_s), direction), request.now_s)


def _creep(core: ControllerCore, request: Request, _task: Task) -> None:
    here = core.plant.joints(request.now_s)
    there = here._replace(inner_arm_deg=here.inner_arm_deg + 0.5)
    core.plant.start(motion.Motion((here, there), (0.0, 1.0), 1.0, smooth=False), request.now_s)


def _ends_as_done(command: str) -> Core:
    return outcome(command, lambda _core, _request, _ended: DONE)


row(
    "idle-stop-is-not-answered",
    "4.17/2",
    "A stop is not answered when no command executes.",
    answer("emergency_stop", lambda reply: reply if reply.accepted else SILENCE),
)
row(
    "idle-stop-is-answered-two",
    "4.17/2",
    "A stop is answered 2 when no command executes.",
    first_reply("emergency_stop", {b"0": b"2"}),
)


@mutant("second-idle-stop-is-lost", "4.17/2", "3/31", subtle=True)
class LosesSecondIdleStop(ControllerCore):
    """Every second stop is not answered when no command executes."""

    _idle = 0

    def emergency_stop(self, request: Request) -> Any:
        reply = super().emergency_stop(request)
        self._idle += not reply.accepted
        return reply if reply.accepted or self._idle % 2 else SILENCE


row(
    "run-is-not-stopped",
    "4.17/6 4.17/3",
    "A stop is refused while a program runs.",
    _refused(executing("run_program")),
)
row(
    "simulation-is-not-stopped",
    "4.17/6 4.17/3",
    "A stop is refused while a program is simulated.",
    _refused(executing("simulate_program")),
)
row(
    "reset-is-not-stopped",
    "4.17/6 4.17/3",
    "A stop is refused during a reset.",
    _refused(executing("reset")),
)
row(
    "move-is-not-stopped",
    "4.17/6 4.17/3",
    "A stop is refused during a move.",
    _refused(executing("set_tool_coordinates")),
)
row(
    "jog-is-not-stopped",
    "4.17/6 4.17/3",
    "A stop is refused during a jog.",
    _refused(executing("jog")),
)
row(
    "stop-comes-too-early",
    "4.17/6 4.17/3",
    "A stop within a millisecond after the start of a program is refused.",
    _refused(_has_just_begun),
    subtle=True,
)
row(
    "only-the-starter-stops",
    "4.17/6",
    "A stop is refused on every connection except the one that started the command.",
    _refused(_is_other_connection),
    subtle=True,
)
row(
    "stop-is-refused-in-uploads",
    "4.17/6 4.17/3",
    "A stop is refused on a connection with an upload in progress.",
    _refused(lambda _core, request: receiver_of(request.session) is not None),
    subtle=True,
)
row(
    "stop-in-downloads-stops-nothing",
    "4.17/4",
    "A stop on a connection with a download in progress is reported as done but stops nothing.",
    _stopped(_continue_if_downloading),
    subtle=True,
)


@mutant("stops-ten-times", "4.17/6", "4.17/3", subtle=True)
class StopsTenTimes(ControllerCore):
    """After ten stops every further one is refused."""

    _stops = 0

    def emergency_stop(self, request: Request) -> Acceptance:
        if self._stops >= 10:
            return _REFUSED
        reply = super().emergency_stop(request)
        self._stops += reply.accepted
        return reply


row(
    "stop-is-answered-with-code",
    "4.17/3",
    "The first reply to a stop is 1|00.",
    first_reply("emergency_stop", {b"1": b"1|00"}),
)
row(
    "stop-has-no-result",
    "4.17/4",
    "A stop sends no final result.",
    outcome("emergency_stop", lambda _core, _request, _ended: None),
)


@mutant("stop-ends-under-the-stopped", "4.17/4")
class EndsStopAsStoppedCommand(ControllerCore):
    """The final result of a stop has the opcode of the stopped command."""

    _opcode = 0x32

    def emergency_stop(self, request: Request) -> Acceptance:
        task = self.robot.task
        self._opcode = task.request.frame.opcode if task else 0x32
        return super().emergency_stop(request)

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x32 and frame.tagged:
            frame = frame._replace(opcode=self._opcode)
        super().emit(session, frame)


row(
    "stop-fails",
    "4.17/4",
    "A completed stop is reported as failed.",
    outcome("emergency_stop", lambda _core, _request, _ended: Outcome(done=False, code="11")),
)


@mutant("second-stop-has-no-result", "4.17/4", subtle=True)
class AcceptsSecondStop(ControllerCore):
    """A second stop within 10 ms of the first is accepted but has no final result."""

    _stopped_s = -1.0

    def emergency_stop(self, request: Request) -> Acceptance:
        reply = super().emergency_stop(request)
        if reply.accepted:
            self._stopped_s = request.now_s
        elif request.now_s - self._stopped_s < 0.01:
            self._stopped_s = -1.0
            return ACCEPTED
        return reply


row(
    "stopped-program-goes-on",
    "4.17/4 4.8/3",
    "A stopped simulation is reported as interrupted but continues.",
    _stopped(_continue_simulation),
)


@mutant("arm-coasts-on", "4.17/7")
class CoastsOn(ControllerCore):
    """From the second stopped move on, the arm continues slowly in +y after the stop."""

    _stopped_moves = 0

    def emergency_stop(self, request: Request) -> Acceptance:
        is_move = executing("set_tool_coordinates")(self, request)
        reply = super().emergency_stop(request)
        self._stopped_moves += is_move
        if is_move and self._stopped_moves > 1:
            _jog(self, request, JogDirection.PLUS_Y)
        return reply


row(
    "jog-goes-on",
    "4.17/7",
    "A jog continues after a stop.",
    _stopped(_continue_jog),
)
row(
    "stopped-arm-creeps",
    "4.17/7",
    "After a stop the inner arm moves by half a degree within a second.",
    _stopped(_creep),
    subtle=True,
)
row(
    "stopped-run-is-done",
    "4.17/8",
    "A stopped run is reported as done.",
    _ends_as_done("run_program"),
)
row(
    "stopped-simulation-is-done",
    "4.17/8",
    "A stopped simulation is reported as done.",
    _ends_as_done("simulate_program"),
)
row(
    "stopped-move-is-done",
    "4.17/8",
    "A stopped move is reported as done.",
    _ends_as_done("set_tool_coordinates"),
)
row(
    "stopped-reset-is-done",
    "4.17/8",
    "A stopped reset is reported as done.",
    _ends_as_done("reset"),
)


class Latches(ControllerCore):
    """Keeps in `latched` whether a stop was accepted since the last reset."""

    latched = False

    def emergency_stop(self, request: Request) -> Acceptance:
        reply = super().emergency_stop(request)
        self.latched |= reply.accepted
        return reply

    def reset(self, request: Request) -> Acceptance:
        self.latched = False
        return super().reset(request)


def _is_latched(core: ControllerCore, _request: Request) -> bool:
    return isinstance(core, Latches) and core.latched


row(
    "busy-until-reset-after-stops",
    "4/15",
    "After a stop the status is 00, but every command is refused with 01 until a reset.",
    Latches,
    *(
        refuses(name, _is_latched, "01")
        for name in TWO_STAGE
        if name not in ("emergency_stop", "reset")
    ),
)
