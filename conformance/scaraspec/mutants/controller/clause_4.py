"""Faults of clause 4: what the two-stage commands share."""

from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE, Command
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_TWO_STAGE = frozenset(opcode for opcode, command in BY_OPCODE.items() if command.two_stage)


def _is_first_reply(frame: Frame) -> bool:
    return frame.opcode in _TWO_STAGE and not frame.tagged


# ---------------------------------------------------------------------- first replies


@mutant("says-eleven-first", "4/1")
class SaysElevenFirst(ControllerCore):
    """The first reply of acceptance has the form of the final result."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 11 for 1."""
        if _is_first_reply(frame) and frame.data == b"1":
            frame = frame._replace(data=b"11")
        super().emit(session, frame)


@mutant("says-ok", "4/1")
class SaysOk(ControllerCore):
    """A lock is accepted with a word."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write OK for 1."""
        if frame.opcode == 0x3B and frame.data == b"1":
            frame = frame._replace(data=b"OK")
        super().emit(session, frame)


@mutant("refuses-without-reason", "4/1")
class RefusesWithoutReason(ControllerCore):
    """A refusal is a bare 0, without its code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave the code away."""
        if _is_first_reply(frame) and frame.data.startswith(b"0|"):
            frame = frame._replace(data=b"0")
        super().emit(session, frame)


@mutant("refuses-without-bar", "4/1")
class RefusesWithoutBar(ControllerCore):
    """A refusal has no bar between the flag and the code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave the bar away."""
        if _is_first_reply(frame) and frame.data.startswith(b"0|"):
            frame = frame._replace(data=frame.data.replace(b"|", b""))
        super().emit(session, frame)


@mutant("refuses-in-form-of-result", "4/1")
class RefusesInFormOfResult(ControllerCore):
    """A refusal has the form of a failed final result."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 00 for 0."""
        if _is_first_reply(frame) and frame.data.startswith(b"0|"):
            frame = frame._replace(data=b"0" + frame.data)
        super().emit(session, frame)


@mutant("refuses-with-unlisted-code", "4/4", "8/2")
class RefusesWithUnlistedCode(ControllerCore):
    """A missing program is refused with 32, which is 20 in hexadecimal taken for a number."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write the code as a decimal number."""
        if _is_first_reply(frame) and frame.data == b"0|20":
            frame = frame._replace(data=b"0|32")
        super().emit(session, frame)


@mutant("blames-the-wrong-motor", "4/4", subtle=True)
class BlamesTheWrongMotor(ControllerCore):
    """A fault of the inner arm's motor refuses commands with the outer arm's code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Shift the code."""
        if _is_first_reply(frame) and frame.data == b"0|11":
            frame = frame._replace(data=b"0|12")
        super().emit(session, frame)


@mutant("overlooks-position-fault", "4/4")
class OverlooksPositionFault(ControllerCore):
    """A robot with the fault 05 still accepts a jog."""

    def jog(self, request: Request) -> Acceptance:
        """Refuse for other faults alone."""
        return ACCEPTED if self.plant.fault_code == "05" else super().jog(request)


@mutant("overlooks-angle-fault", "4/4")
class OverlooksAngleFault(ControllerCore):
    """A robot with the fault 06 still accepts a move."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Refuse for other faults alone."""
        if self.plant.fault_code == "06":
            return ACCEPTED
        return super().set_tool_coordinates(request)


@mutant("answers-run-at-its-end", "4/14")
class AnswersRunAtItsEnd(ControllerCore):
    """The first reply to a run comes together with its final result."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Keep the first reply back until the end."""
        if frame.opcode == 0x30 and frame.data == b"1" and not frame.tagged:
            return
        if frame.opcode == 0x30 and frame.tagged:
            super().emit(session, Frame(C2A, 0x30, b"1"))
        super().emit(session, frame)


@mutant("answers-simulation-at-its-end", "4/14")
class AnswersSimulationAtItsEnd(ControllerCore):
    """The first reply to a simulation comes together with its final result."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Keep the first reply back until the end."""
        if frame.opcode == 0x31 and frame.data == b"1" and not frame.tagged:
            return
        if frame.opcode == 0x31 and frame.tagged:
            super().emit(session, Frame(C2A, 0x31, b"1"))
        super().emit(session, frame)


@mutant("answers-move-at-its-end", "4/14")
class AnswersMoveAtItsEnd(ControllerCore):
    """The first reply to a move comes together with its final result."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Keep the first reply back until the end."""
        if frame.opcode == 0x39 and frame.data == b"1" and not frame.tagged:
            return
        if frame.opcode == 0x39 and frame.tagged:
            super().emit(session, Frame(C2A, 0x39, b"1"))
        super().emit(session, frame)


@mutant("answers-reset-at-its-end", "4/14")
class AnswersResetAtItsEnd(ControllerCore):
    """The first reply to a reset comes together with its final result."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Keep the first reply back until the end."""
        if frame.opcode == 0x33 and frame.data == b"1" and not frame.tagged:
            return
        if frame.opcode == 0x33 and frame.tagged:
            super().emit(session, Frame(C2A, 0x33, b"1"))
        super().emit(session, frame)


# ---------------------------------------------------------------------- final results


@mutant("ends-with-one", "4/2")
class EndsWithOne(ControllerCore):
    """A final result that tells of success has one digit."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 1 for 11."""
        if frame.tagged and frame.data == b"11":
            frame = frame._replace(data=b"1")
        super().emit(session, frame)


@mutant("ends-with-code", "4/2")
class EndsWithCode(ControllerCore):
    """A final result that tells of success bears a code too."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add the code of an idle robot."""
        if frame.tagged and frame.data == b"11":
            frame = frame._replace(data=b"11|00")
        super().emit(session, frame)


@mutant("locks-with-one", "4/2")
class LocksWithOne(ControllerCore):
    """Of all commands the lock alone ends with one digit."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 1 for 11."""
        if frame.tagged and frame.opcode == 0x3B:
            frame = frame._replace(data=b"1")
        super().emit(session, frame)


@mutant("loses-results-in-transfers", "4/2", subtle=True)
class LosesResultsInTransfers(ControllerCore):
    """What ends while its client sends a file or fetches one is never told."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Tell it to nobody."""
        if request.session.transfer is None:
            super().send_result(request, outcome)


@mutant("fails-without-code", "4/3")
class FailsWithoutCode(ControllerCore):
    """A failed final result has no code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave the code away."""
        if frame.tagged and frame.data.startswith(b"00"):
            frame = frame._replace(data=b"00")
        super().emit(session, frame)


@mutant("fails-of-four-bytes", "4/3")
class FailsOfFourBytes(ControllerCore):
    """A failed final result has the form of a refusal."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 0 for 00."""
        if frame.tagged and frame.data.startswith(b"00"):
            frame = frame._replace(data=frame.data[1:])
        super().emit(session, frame)


@mutant("fault-ends-as-done", "4/3", "4.15/6")
class FaultEndsAsDone(ControllerCore):
    """A run during which a motor fails is said to be done."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Take no notice of faults."""
        if request.command.name == "run_program" and self.plant.fault_code:
            outcome = Outcome(done=True)
        super().send_result(request, outcome)


@mutant("fails-with-unlisted-code", "4/5", "8/2")
class FailsWithUnlistedCode(ControllerCore):
    """What a stop interrupts fails with a code that table 8-1 does not have."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write FF for 00."""
        if frame.tagged and frame.data == b"00|00":
            frame = frame._replace(data=b"00|FF")
        super().emit(session, frame)


@mutant("fails-with-mirrored-code", "4/5")
class FailsWithMirroredCode(ControllerCore):
    """A failed final result names the motors in the order of another bit mask."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write the outer arm as the wrist."""
        if frame.tagged and frame.data == b"00|12":
            frame = frame._replace(data=b"00|14")
        super().emit(session, frame)


@mutant("ends-before-it-begins", "3/16", "4/1")
class EndsBeforeItBegins(ControllerCore):
    """A lock's final result comes ahead of its first reply."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Send a lock's result at once."""
        if request.command.name != "lock_joints":
            super().send_result(request, outcome)
            return
        data = request.command.result.encode(outcome) if request.command.result else b""
        self.emit(request.session, Frame(C2A, request.frame.opcode, data, tagged=True))


@mutant("ends-what-it-refused", "3/17")
class EndsWhatItRefused(ControllerCore):
    """A refused run is followed by a failed final result."""

    def run_program(self, request: Request) -> Acceptance:
        """Conclude the refusal."""
        answer = super().run_program(request)
        if not answer.accepted:
            self.send_result(request, Outcome(done=False, code=answer.code))
        return answer


@mutant("ends-stop-that-was-not-needed", "3/17")
class EndsStopThatWasNotNeeded(ControllerCore):
    """A stop of an idle robot is answered 0, and then 11."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Conclude it all the same."""
        answer = super().emergency_stop(request)
        if not answer.accepted:
            self.send_result(request, Outcome(done=True))
        return answer


@mutant("ends-twice", "3/18")
class EndsTwice(ControllerCore):
    """The final result of a simulation is sent twice."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Conclude once more."""
        super().send_result(request, outcome)
        if request.command.name == "simulate_program":
            super().send_result(request, outcome)


@mutant("repeats-the-last-result", "3/18", subtle=True)
class RepeatsTheLastResult(ControllerCore):
    """The reply to the first query behind a run's result is followed by that result again."""

    _kept: Frame | None = None

    def emit(self, session: Session, frame: Frame) -> None:
        """Keep the result, and send it behind the next reply."""
        kept, self._kept = self._kept, None
        super().emit(session, frame)
        if kept is not None:
            super().emit(session, kept)
        if frame.tagged and frame.opcode == 0x30:
            self._kept = frame


@mutant("forgets-the-fortieth-result", "3/18", "4.15/5", subtle=True)
class ForgetsTheFortiethResult(ControllerCore):
    """The fortieth run has no final result."""

    _ended = 0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Count the runs."""
        self._ended += request.command.name == "run_program" and outcome.done
        if self._ended != 40:
            super().send_result(request, outcome)
        else:
            self._ended += 1


@mutant("loses-result-between-replies", "3/18", "4.15/5", subtle=True)
class LosesResultBetweenReplies(ControllerCore):
    """A run that ends less than a tenth of a second behind a query has no final result."""

    _asked_s = -1.0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Note when a query came."""
        if frame.opcode == 0x07:
            self._asked_s = now_s
        super().handle(session, frame, now_s)

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Drop the result of a run that ends soon behind one."""
        long_s = self._asked_s - request.now_s
        if request.command.name != "run_program" or long_s < 0.5:
            super().send_result(request, outcome)


# ---------------------------------------------------------------------- a busy robot


class _Forgetful(ControllerCore):
    """Forgets for one command that another one executes."""

    forgets = ""
    meanwhile = ""

    def _reply(self, session: Session, command: Command, frame: Frame, answer: Any) -> None:
        task = self.robot.task
        if (
            command.name == self.forgets
            and isinstance(answer, Acceptance)
            and not answer.accepted
            and task is not None
            and task.request.command.name == self.meanwhile
        ):
            answer = ACCEPTED
        super()._reply(session, command, frame, answer)


@mutant("moves-during-run", "4/6")
class MovesDuringRun(_Forgetful):
    """A move is accepted while a program runs."""

    forgets, meanwhile = "set_tool_coordinates", "run_program"


@mutant("runs-during-simulation", "4/6")
class RunsDuringSimulation(_Forgetful):
    """A run is accepted while a program is simulated."""

    forgets, meanwhile = "run_program", "simulate_program"


@mutant("locks-during-move", "4/6")
class LocksDuringMove(_Forgetful):
    """A lock is accepted while the arm moves."""

    forgets, meanwhile = "lock_joints", "set_tool_coordinates"


@mutant("moves-during-reset", "4/6")
class MovesDuringReset(_Forgetful):
    """A move is accepted while the robot resets."""

    forgets, meanwhile = "set_tool_coordinates", "reset"


@mutant("simulates-during-jog", "4/6")
class SimulatesDuringJog(_Forgetful):
    """A simulation is accepted during a jog."""

    forgets, meanwhile = "simulate_program", "jog"


@mutant("starts-later", "4/6")
class StartsLater(ControllerCore):
    """A busy robot says nothing to a move, and begins it once it is free."""

    def _defer_while_busy(self, session: Session, command: Command, frame: Frame) -> bool:
        if command.name == "set_tool_coordinates" and self.robot.task is not None:
            self._queue.append((session, frame))
            return True
        return super()._defer_while_busy(session, command, frame)


@mutant("moves-after-refusal", "4/6", subtle=True)
class MovesAfterRefusal(ControllerCore):
    """A move that a running program has kept from is made behind it, without a word."""

    _words = 0  # that are still said of it, and kept back

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Put it off."""
        answer = super().set_tool_coordinates(request)
        task = self.robot.task
        if task is not None and task.state == "01":
            self._queue.append((request.session, request.frame))
            self._words = 3  # the refusal, which is said, and what is not
        return answer

    def emit(self, session: Session, frame: Frame) -> None:
        """Say the first word alone."""
        if frame.opcode == BY_NAME["set_tool_coordinates"].opcode and self._words:
            self._words -= 1
            if self._words < 2:
                return
        super().emit(session, frame)


@mutant("other-clients-may-move", "4/6", subtle=True)
class OtherClientsMayMove(ControllerCore):
    """Whether the robot is busy is asked for each connection, not for the robot."""

    def lock_joints(self, request: Request) -> Acceptance:
        """Look at one's own commands alone."""
        task = self.robot.task
        if task is not None and task.request.session is not request.session:
            self.send_result(request, Outcome(done=True))
            return ACCEPTED
        return super().lock_joints(request)


@mutant("busy-is-always-one", "4/15")
class BusyIsAlwaysOne(ControllerCore):
    """Every busy refusal bears 01, whatever executes."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 01 for all states."""
        if _is_first_reply(frame) and frame.data in (b"0|02", b"0|03", b"0|04"):
            frame = frame._replace(data=b"0|01")
        super().emit(session, frame)


@mutant("busy-is-always-moving", "4/15")
class BusyIsAlwaysMoving(ControllerCore):
    """A busy refusal during a run bears 04."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 04 for 01."""
        if _is_first_reply(frame) and frame.data == b"0|01":
            frame = frame._replace(data=b"0|04")
        super().emit(session, frame)


@mutant("busy-after-refusal", "4/15", "4.15/4", subtle=True)
class BusyAfterRefusal(ControllerCore):
    """A robot that has refused a missing program refuses the next run as busy."""

    _stuck = False

    def run_program(self, request: Request) -> Acceptance:
        """Forget to let the robot go on the way out."""
        if self._stuck:
            self._stuck = False
            return Acceptance(accepted=False, code="01")
        answer = super().run_program(request)
        self._stuck = answer.code == "20"
        return answer


@mutant("busy-after-lost-client", "4/15", "4.15/4", subtle=True)
class BusyAfterLostClient(ControllerCore):
    """A program whose client was lost leaves the robot busy for runs."""

    _stuck = False

    def close(self, connection: int, now_s: float) -> list[Any]:
        """Note that a client went while its program ran."""
        task = self.robot.task
        if task is not None and task.program and task.request.session.connection == connection:
            self._stuck = True
        return super().close(connection, now_s)

    def run_program(self, request: Request) -> Acceptance:
        """Refuse ever after."""
        if self._stuck:
            return Acceptance(accepted=False, code="01")
        return super().run_program(request)


@mutant("tires-after-forty-runs", "4/15", "4.15/5", subtle=True)
class TiresAfterFortyRuns(ControllerCore):
    """After forty runs every further one is refused as busy."""

    _runs = 0

    def run_program(self, request: Request) -> Acceptance:
        """Run out of places for tasks."""
        self._runs += 1
        if self._runs > 40:
            return Acceptance(accepted=False, code="01")
        return super().run_program(request)


# ---------------------------------------------------------------------- the status


@mutant("status-lags", "4/7", subtle=True)
class StatusLags(ControllerCore):
    """The first status behind a final result is still that of the command which has ended."""

    _last = "00"

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Keep the state of what ended with success."""
        states = {0x30: "01", 0x31: "02", 0x33: "03", 0x39: "04", 0x3D: "04"}
        if outcome.done:
            self._last = states.get(request.frame.opcode, "04")
        super().send_result(request, outcome)

    def get_status(self, request: Request) -> str:
        """Tell the last state once."""
        last, self._last = self._last, "00"
        now = super().get_status(request)
        return last if now == "00" else now


@mutant("simulation-never-ends", "4/7", subtle=True)
class SimulationNeverEnds(ControllerCore):
    """Behind a simulation the status stays 02 until something else executes."""

    _simulated = False

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Note what ended last."""
        self._simulated = request.command.name == "simulate_program"
        super().send_result(request, outcome)

    def get_status(self, request: Request) -> str:
        """Tell of the simulation."""
        now = super().get_status(request)
        return "02" if self._simulated and now == "00" else now


class _IdleDuring(ControllerCore):
    """The status does not tell of one command."""

    during = 0

    def get_status(self, request: Request) -> str:
        """Forget one command."""
        task = self.robot.task
        if task is not None and task.request.frame.opcode == self.during:
            return "00"
        return super().get_status(request)


@mutant("idle-during-run", "4/8")
class IdleDuringRun(_IdleDuring):
    """The status is 00 while a program runs."""

    during = 0x30


@mutant("idle-during-simulation", "4/8")
class IdleDuringSimulation(_IdleDuring):
    """The status is 00 while a program is simulated."""

    during = 0x31


@mutant("idle-during-reset", "4/8")
class IdleDuringReset(_IdleDuring):
    """The status is 00 while the robot resets."""

    during = 0x33


@mutant("idle-during-move", "4/8")
class IdleDuringMove(_IdleDuring):
    """The status is 00 while the arm moves to a pose."""

    during = 0x39


@mutant("idle-during-jog", "4/8")
class IdleDuringJog(_IdleDuring):
    """The status is 00 during a jog."""

    during = 0x3D


@mutant("flickers-idle", "4/8", "4.8/4", subtle=True)
class FlickersIdle(ControllerCore):
    """Every tenth status during a run is 00."""

    _asked = 0

    def get_status(self, request: Request) -> str:
        """Count."""
        self._asked += 1
        now = super().get_status(request)
        return "00" if now == "01" and self._asked % 10 == 0 else now


@mutant("idle-before-the-result", "4/8", "4.8/4", subtle=True)
class IdleBeforeTheResult(ControllerCore):
    """The status is 00 for the last tenth of a second of a program, ahead of its result."""

    def get_status(self, request: Request) -> str:
        """Look at the clock a little too early."""
        task = self.robot.task
        if task is not None and task.program and task.activity.next_event_s - request.now_s < 0.1:
            return "00"
        return super().get_status(request)


@mutant("deaf-for-the-version", "3/31", subtle=True)
class DeafForTheVersion(ControllerCore):
    """While a program runs the version is not told."""

    def get_version(self, request: Request) -> Any:
        """Say nothing."""
        return SILENCE if self.robot.task is not None else super().get_version(request)
