"""Mutants of clause 4: what the two-stage commands have in common."""

from collections.abc import Callable
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import (
    TWO_STAGE,
    early_result,
    final_result,
    first_reply,
    outcome,
)
from scaraspec.mutants.operators.controller.requests import (
    accepts,
    after,
    answer_when,
    executing,
    ignores,
)
from scaraspec.protocol.commands import BY_NAME, Command
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE
from scaraspec.virtual_controller.session import Request, Session


def _replies_at_end(command: str) -> Core:
    """The first reply that accepts a command is sent together with its final result."""
    opcode = BY_NAME[command].opcode

    class RepliesAtEnd(ControllerCore):
        def emit(self, session: Session, frame: Frame) -> None:
            if frame.opcode == opcode and frame.data == b"1" and not frame.tagged:
                return
            if frame.opcode == opcode and frame.tagged:
                super().emit(session, Frame(C2A, opcode, b"1"))
            super().emit(session, frame)

    return RepliesAtEnd


def _ends_refused(command: str, ending: Callable[[Acceptance], Outcome]) -> Core:
    """A refused command has a final result."""

    def conclude(core: ControllerCore, request: Request, answer: Acceptance) -> Acceptance:
        if not answer.accepted:
            core.send_result(request, ending(answer))
        return answer

    return after(command, conclude)


def _idle_during(command: str) -> Core:
    """The status is 00 while a command executes."""
    return answer_when("get_status", executing(command), "00")


def _lock_for_others(core: ControllerCore, request: Request, answer: Acceptance) -> Acceptance:
    task = core.robot.task
    if task is None or task.request.session is request.session:
        return answer
    core.send_result(request, DONE)
    return ACCEPTED


def _ends_soon(core: ControllerCore, request: Request) -> bool:
    task = core.robot.task
    return (
        task is not None and bool(task.program) and task.activity.next_event_s - request.now_s < 0.1
    )


# ---------------------------------------------------------------------- first replies

row(
    "says-eleven-first",
    "4/1",
    "The first reply of acceptance is 11, as in a final result.",
    first_reply(TWO_STAGE, {b"1": b"11"}),
)
row(
    "says-ok",
    "4/1",
    "The reply that accepts a lock is OK.",
    first_reply("lock_joints", {b"1": b"OK"}),
)
row(
    "refuses-without-reason",
    "4/1",
    "A refusal is 0 without a code.",
    first_reply(TWO_STAGE, lambda data: data.partition(b"|")[0]),
)
row(
    "refuses-without-bar",
    "4/1",
    "A refusal has no separator between the flag and the code.",
    first_reply(TWO_STAGE, lambda data: data.replace(b"|", b"")),
)
row(
    "refuses-in-form-of-result",
    "4/1",
    "A refusal begins with 00, as a failed final result.",
    first_reply(TWO_STAGE, lambda data: b"0" + data if data.startswith(b"0|") else data),
)
row(
    "refuses-with-unlisted-code",
    "4/4 8/2",
    "A missing program is refused with 32, which is hexadecimal 20 written in decimal.",
    first_reply(TWO_STAGE, {b"0|20": b"0|32"}),
)
row(
    "blames-the-wrong-motor",
    "4/4",
    "A fault of the inner arm's motor refuses commands with the outer arm's code.",
    first_reply(TWO_STAGE, {b"0|11": b"0|12"}),
    subtle=True,
)
row(
    "overlooks-position-fault",
    "4/4",
    "A robot with the fault 05 accepts a jog.",
    accepts("jog", lambda core, _request: core.plant.fault_code == "05"),
)
row(
    "overlooks-angle-fault",
    "4/4",
    "A robot with the fault 06 accepts a move.",
    accepts("set_tool_coordinates", lambda core, _request: core.plant.fault_code == "06"),
)
row(
    "answers-run-at-its-end",
    "4/14",
    "The first reply to a run is sent together with its final result.",
    _replies_at_end("run_program"),
)
row(
    "answers-simulation-at-its-end",
    "4/14",
    "The first reply to a simulation is sent together with its final result.",
    _replies_at_end("simulate_program"),
)
row(
    "answers-move-at-its-end",
    "4/14",
    "The first reply to a move is sent together with its final result.",
    _replies_at_end("set_tool_coordinates"),
)
row(
    "answers-reset-at-its-end",
    "4/14",
    "The first reply to a reset is sent together with its final result.",
    _replies_at_end("reset"),
)

# ---------------------------------------------------------------------- final results

row(
    "ends-with-one",
    "4/2",
    "A successful final result is 1 in place of 11.",
    final_result(TWO_STAGE, {b"11": b"1"}),
)
row(
    "ends-with-code",
    "4/2",
    "A successful final result has a code, too.",
    final_result(TWO_STAGE, {b"11": b"11|00"}),
)
row(
    "locks-with-one",
    "4/2",
    "The final result of a lock is 1 in place of 11.",
    final_result("lock_joints", lambda _data: b"1"),
)
row(
    "loses-results-in-transfers",
    "4/2",
    "A command that ends during a file transfer of its client has no final result.",
    outcome(TWO_STAGE, lambda _core, request, ended: None if request.session.transfer else ended),
    subtle=True,
)
row(
    "fails-without-code",
    "4/3",
    "A failed final result has no code.",
    final_result(TWO_STAGE, lambda data: data.partition(b"|")[0]),
)
row(
    "fails-of-four-bytes",
    "4/3",
    "A failed final result begins with one 0, as a refusal.",
    final_result(TWO_STAGE, lambda data: data.removeprefix(b"0")),
)
row(
    "fault-ends-as-done",
    "4/3 4.15/6",
    "A run during which a motor fails ends with success.",
    outcome("run_program", lambda core, _request, ended: DONE if core.plant.fault_code else ended),
)
row(
    "fails-with-unlisted-code",
    "4/5 8/2",
    "A command that a stop interrupts fails with the code FF, which table 8-1 does not contain.",
    final_result(TWO_STAGE, {b"00|00": b"00|FF"}),
)
row(
    "fails-with-mirrored-code",
    "4/5",
    "A failed final result reports the wrist's motor when the outer arm's motor fails.",
    final_result(TWO_STAGE, {b"00|12": b"00|14"}),
)
row(
    "ends-before-it-begins",
    "3/16 4/1",
    "The final result of a lock is sent before its first reply.",
    early_result("lock_joints"),
)
row(
    "ends-what-it-refused",
    "3/17",
    "A refused run has a failed final result.",
    _ends_refused("run_program", lambda answer: Outcome(done=False, code=answer.code)),
)
row(
    "ends-stop-that-was-not-needed",
    "3/17",
    "An emergency stop of an idle robot is answered 0 and then 11.",
    _ends_refused("emergency_stop", lambda _answer: DONE),
)


@mutant("ends-twice", "3/18")
class EndsSimulationsTwice(ControllerCore):
    """The final result of a simulation is sent twice."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        super().send_result(request, outcome)
        if request.command.name == "simulate_program":
            super().send_result(request, outcome)


@mutant("repeats-the-last-result", "3/18", subtle=True)
class RepeatsLastResult(ControllerCore):
    """The first reply after the result of a run is followed by that result again."""

    _kept: Frame | None = None

    def emit(self, session: Session, frame: Frame) -> None:
        kept, self._kept = self._kept, None
        super().emit(session, frame)
        if kept is not None:
            super().emit(session, kept)
        if frame.tagged and frame.opcode == 0x30:
            self._kept = frame


@mutant("forgets-the-fortieth-result", "3/18", "4.15/5", subtle=True)
class LosesFortiethResult(ControllerCore):
    """Every fortieth run has no final result."""

    _ended = 0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        ended = request.command.name == "run_program" and outcome.done
        self._ended += ended
        if not ended or self._ended % 40:
            super().send_result(request, outcome)


@mutant("loses-result-between-replies", "3/18", "4.15/5", subtle=True)
class LosesResultAfterQuery(ControllerCore):
    """A run in which the time was requested after half a second has no final result."""

    _requested_s = -1.0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x07:
            self._requested_s = now_s
        super().handle(session, frame, now_s)

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name != "run_program" or self._requested_s - request.now_s < 0.5:
            super().send_result(request, outcome)


# ---------------------------------------------------------------------- a busy robot

row(
    "moves-during-run",
    "4/6",
    "A move is accepted while a program runs.",
    accepts("set_tool_coordinates", executing("run_program")),
)
row(
    "runs-during-simulation",
    "4/6",
    "A run is accepted while a program is simulated.",
    accepts("run_program", executing("simulate_program")),
)
row(
    "locks-during-move",
    "4/6",
    "A lock is accepted while the arm moves.",
    accepts("lock_joints", executing("set_tool_coordinates")),
)
row(
    "moves-during-reset",
    "4/6",
    "A move is accepted while the robot resets.",
    accepts("set_tool_coordinates", executing("reset")),
)
row(
    "simulates-during-jog",
    "4/6",
    "A simulation is accepted during a jog.",
    accepts("simulate_program", executing("jog")),
)


@mutant("starts-later", "4/6")
class QueuesMoves(ControllerCore):
    """A busy robot does not answer a move and starts it when it is free."""

    def _defer_while_busy(self, session: Session, command: Command, frame: Frame) -> bool:
        if command.name == "set_tool_coordinates" and self.robot.task is not None:
            self._queue.append((session, frame))
            return True
        return super()._defer_while_busy(session, command, frame)


@mutant("moves-after-refusal", "4/6", subtle=True)
class MovesAfterRefusal(ControllerCore):
    """A move that was refused during a run starts after it, without any reply."""

    _frames = 0  # that are still made for the move: the refusal is sent, the others are not

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        answer = super().set_tool_coordinates(request)
        task = self.robot.task
        if task is not None and task.state == "01":
            self._queue.append((request.session, request.frame))
            self._frames = 3
        return answer

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x39 and self._frames:
            self._frames -= 1
            if self._frames < 2:
                return
        super().emit(session, frame)


row(
    "other-clients-may-move",
    "4/6",
    "A lock is refused only while a command of the same connection executes.",
    after("lock_joints", _lock_for_others),
    subtle=True,
)
row(
    "busy-is-always-one",
    "4/15",
    "Every refusal of a busy robot has the code 01.",
    first_reply(TWO_STAGE, dict.fromkeys((b"0|02", b"0|03", b"0|04"), b"0|01")),
)
row(
    "busy-is-always-moving",
    "4/15",
    "A refusal during a run has the code 04.",
    first_reply(TWO_STAGE, {b"0|01": b"0|04"}),
)


@mutant("busy-after-refusal", "4/15", "4.15/4", subtle=True)
class BusyAfterRefusal(ControllerCore):
    """A robot that has refused a missing program refuses the next run as busy."""

    _stuck = False

    def run_program(self, request: Request) -> Acceptance:
        if self._stuck:
            self._stuck = False
            return refused("01")
        answer = super().run_program(request)
        self._stuck = answer.code == "20"
        return answer


@mutant("busy-after-lost-client", "4/15", "4.15/4", subtle=True)
class BusyAfterLostClient(ControllerCore):
    """After a client disconnects during its run, every run is refused as busy."""

    _stuck = False

    def close(self, connection: int, now_s: float) -> list[Any]:
        task = self.robot.task
        if task is not None and task.program and task.request.session.connection == connection:
            self._stuck = True
        return super().close(connection, now_s)

    def run_program(self, request: Request) -> Acceptance:
        return refused("01") if self._stuck else super().run_program(request)


@mutant("tires-after-forty-runs", "4/15", "4.15/5", subtle=True)
class BusyAfterFortyRuns(ControllerCore):
    """After forty runs every further one is refused as busy."""

    _runs = 0

    def run_program(self, request: Request) -> Acceptance:
        self._runs += 1
        return refused("01") if self._runs > 40 else super().run_program(request)


# ---------------------------------------------------------------------- the status


@mutant("status-lags", "4/7", subtle=True)
class ReportsEndedState(ControllerCore):
    """The first status after a final result is still that of the command that has ended."""

    _last = "00"

    def send_result(self, request: Request, outcome: Outcome) -> None:
        states = {0x30: "01", 0x31: "02", 0x33: "03", 0x39: "04", 0x3D: "04"}
        if outcome.done:
            self._last = states.get(request.frame.opcode, "04")
        super().send_result(request, outcome)

    def get_status(self, request: Request) -> str:
        last, self._last = self._last, "00"
        now = super().get_status(request)
        return last if now == "00" else now


@mutant("simulation-never-ends", "4/7", subtle=True)
class ReportsEndedSimulation(ControllerCore):
    """The status stays 02 after a simulation until another command executes."""

    _simulated = False

    def send_result(self, request: Request, outcome: Outcome) -> None:
        self._simulated = request.command.name == "simulate_program"
        super().send_result(request, outcome)

    def get_status(self, request: Request) -> str:
        now = super().get_status(request)
        return "02" if self._simulated and now == "00" else now


row(
    "idle-during-run",
    "4/8",
    "The status is 00 while a program runs.",
    _idle_during("run_program"),
)
row(
    "idle-during-simulation",
    "4/8",
    "The status is 00 while a program is simulated.",
    _idle_during("simulate_program"),
)
row(
    "idle-during-reset",
    "4/8",
    "The status is 00 while the robot resets.",
    _idle_during("reset"),
)
row(
    "idle-during-move",
    "4/8",
    "The status is 00 while the arm moves to a pose.",
    _idle_during("set_tool_coordinates"),
)
row(
    "idle-during-jog",
    "4/8",
    "The status is 00 during a jog.",
    _idle_during("jog"),
)


@mutant("flickers-idle", "4/8", "4.8/4", subtle=True)
class ReportsIdleSometimes(ControllerCore):
    """Every tenth status is 00 even if a program runs."""

    _queries = 0

    def get_status(self, request: Request) -> str:
        self._queries += 1
        now = super().get_status(request)
        return "00" if now == "01" and self._queries % 10 == 0 else now


row(
    "idle-before-the-result",
    "4/8 4.8/4",
    "The status is 00 in the last tenth of a second of a program, before its result.",
    answer_when("get_status", _ends_soon, "00"),
    subtle=True,
)
row(
    "deaf-for-the-version",
    "3/31",
    "A version request is not answered while a command executes.",
    ignores("get_version", lambda core, _request: core.robot.task is not None),
    subtle=True,
)
