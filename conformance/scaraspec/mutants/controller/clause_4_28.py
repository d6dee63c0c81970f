"""Faults of clause 4.28: jogs."""

from dataclasses import replace
from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, JogDirection, Outcome
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import MOVING, Movement, Task
from scaraspec.virtual_controller.session import Request, Session


class _Otherwise(ControllerCore):
    """Jogs another way than it was told."""

    instead: dict[JogDirection, JogDirection] = {}  # noqa: RUF012 - read alone

    def jog(self, request: Request) -> Acceptance:
        """Go there."""
        if request.value is not None:
            request = replace(request, value=self.instead.get(request.value, request.value))
        return super().jog(request)


@mutant("jog-swaps-axes", "4.28/3")
class JogSwapsAxes(_Otherwise):
    """1 and 2 jog along X, 3 and 4 along Y."""

    instead = {  # noqa: RUF012 - read alone
        JogDirection.PLUS_Y: JogDirection.PLUS_X,
        JogDirection.MINUS_Y: JogDirection.MINUS_X,
        JogDirection.PLUS_X: JogDirection.PLUS_Y,
        JogDirection.MINUS_X: JogDirection.MINUS_Y,
    }


@mutant("jog-swaps-signs", "4.28/3")
class JogSwapsSigns(_Otherwise):
    """1 and 2 jog the other way."""

    instead = {  # noqa: RUF012 - read alone
        JogDirection.PLUS_Y: JogDirection.MINUS_Y,
        JogDirection.MINUS_Y: JogDirection.PLUS_Y,
    }


@mutant("jog-four-is-three", "4.28/3")
class JogFourIsThree(_Otherwise):
    """4 jogs like 3."""

    instead = {JogDirection.MINUS_X: JogDirection.PLUS_X}  # noqa: RUF012 - read alone


@mutant("jog-two-is-one", "4.28/3")
class JogTwoIsOne(_Otherwise):
    """2 jogs like 1."""

    instead = {JogDirection.MINUS_Y: JogDirection.PLUS_Y}  # noqa: RUF012 - read alone


@mutant("jog-by-binary-two-is-one", "4.28/3", "4.28/4", subtle=True)
class JogByBinaryTwoIsOne(_Otherwise):
    """2 as a binary byte jogs like 1, which no client does that sends digits."""

    instead = {JogDirection.MINUS_Y: JogDirection.PLUS_Y}  # noqa: RUF012 - read alone

    def jog(self, request: Request) -> Acceptance:
        """Look at the notation."""
        return (
            super().jog(request) if request.frame.data < b"0" else ControllerCore.jog(self, request)
        )


@mutant("jog-is-answered-with-its-direction", "4.28/4", "4/1")
class JogIsAnsweredWithItsDirection(ControllerCore):
    """The first reply to a jog repeats the direction behind the 1."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add it."""
        if frame.opcode == 0x3D and frame.data == b"1" and not frame.tagged:
            frame = frame._replace(data=b"1|1")
        super().emit(session, frame)


@mutant("jog-is-refused", "4.28/4")
class JogIsRefused(ControllerCore):
    """An idle robot refuses every jog."""

    def jog(self, request: Request) -> Acceptance:  # noqa: ARG002 - the seam's form
        """Refuse."""
        return Acceptance(accepted=False, code=self.robot.refusal_code() or "05")


@mutant("fourth-jog-is-refused", "4.28/4")
class FourthJogIsRefused(ControllerCore):
    """4 is taken for a value beyond the last."""

    def jog(self, request: Request) -> Acceptance:
        """Compare with the wrong sign."""
        if request.value is JogDirection.MINUS_X and self.robot.task is None:
            return Acceptance(accepted=False, code="0B")
        return super().jog(request)

    def _reply(self, session: Session, command: Any, frame: Frame, answer: Any) -> None:
        if isinstance(answer, Acceptance) and answer.code == "0B":
            self.emit(session, frame._replace(direction=frame.direction.opposite, data=b"05"))
            return
        super()._reply(session, command, frame, answer)


@mutant("jog-has-no-result", "4.28/5")
class JogHasNoResult(ControllerCore):
    """A jog that ends at the limit sends no final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        task = self.robot.task
        ended = request.command.name == "jog" and task is None and self.plant.motion_ends_s > 1
        if not ended or not self._at_limit(request):
            super().send_result(request, outcome)

    def _at_limit(self, request: Request) -> bool:
        pose = self.get_tool_coordinates(replace(request, now_s=self.plant.motion_ends_s))
        return pose.x > 399


@mutant("stopped-jog-is-told", "4.28/5")
class StoppedJogIsTold(ControllerCore):
    """The final result of a jog that was stopped is "1"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 1 for 11."""
        if frame.opcode == 0x3D and frame.tagged:
            frame = frame._replace(data=b"1")
        super().emit(session, frame)


@mutant("jog-fails-with-motor", "4.28/5")
class JogFailsWithMotor(ControllerCore):
    """A jog that ends at the limit fails with a motor's code."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Blame the outer arm."""
        if request.command.name == "jog" and request.value is JogDirection.PLUS_X:
            pose = self.get_tool_coordinates(replace(request, now_s=self.plant.motion_ends_s))
            outcome = Outcome(done=False, code="12") if pose.x > 399 else outcome
        super().send_result(request, outcome)


@mutant("jog-of-lost-client-goes-on", "4.28/5", "4.17/6", subtle=True)
class JogOfLostClientGoesOn(ControllerCore):
    """A jog whose client is gone goes on, and no other client can stop it."""

    def close(self, connection: int, now_s: float) -> list[Any]:
        """Keep the jog."""
        task = self.robot.task
        actions = super().close(connection, now_s)
        if task is not None and task.ends_with_link and self.robot.task is None:
            way = motion.jog(self.plant.joints(now_s), task.request.value)
            self.plant.start(way, now_s)
            act = Movement(self.plant)
            self.robot.task = Task(
                task.request, MOVING, act, outcome_if_stopped=task.outcome_if_stopped
            )
        return actions

    def emergency_stop(self, request: Request) -> Acceptance:
        """Refuse where its client is gone."""
        task = self.robot.task
        if task is not None and task.request.session.connection not in self.sessions:
            return Acceptance(accepted=False)
        return super().emergency_stop(request)


@mutant("jog-takes-the-low-bits", "4.28/7")
class JogTakesTheLowBits(ControllerCore):
    """Of the direction the lowest three bits alone are looked at."""

    def jog(self, request: Request) -> Acceptance:
        """Take any byte."""
        data = request.frame.data
        if request.value is None and data and 1 <= data[0] & 7 <= 4:
            request = replace(request, value=JogDirection(data[0] & 7))
        return super().jog(request)


@mutant("jog-takes-five-for-four", "4.28/7")
class JogTakesFiveForFour(ControllerCore):
    """A direction above 4 is taken for 4."""

    def jog(self, request: Request) -> Acceptance:
        """Clamp it."""
        if request.value is None and request.frame.data in (b"5", b"\5"):
            request = replace(request, value=JogDirection.MINUS_X)
        return super().jog(request)


@mutant("jog-takes-the-first-of-two", "4.28/7")
class JogTakesTheFirstOfTwo(ControllerCore):
    """Of two bytes the first is taken for the direction."""

    def jog(self, request: Request) -> Acceptance:
        """Overlook the rest."""
        first = request.frame.data[:1]
        if request.value is None and len(request.frame.data) > 1 and first in b"1234":
            request = replace(request, value=JogDirection(int(first)))
        return super().jog(request)


@mutant("jog-takes-zero", "4.28/7")
class JogTakesZero(ControllerCore):
    """A direction 0 is accepted, and moves nothing."""

    def jog(self, request: Request) -> Acceptance:
        """Accept it."""
        if request.frame.data == b"0" and self.robot.task is None:
            self.send_result(request, Outcome(done=True))
            return ACCEPTED
        return super().jog(request)


@mutant("jog-moves-what-it-refuses", "4.28/7")
class JogMovesWhatItRefuses(ControllerCore):
    """A direction that is none is refused, and the arm moves along the last axis all the same."""

    def jog(self, request: Request) -> Acceptance:
        """Start before looking."""
        if request.value is None and self.robot.task is None:
            way = motion.jog(self.plant.joints(request.now_s), JogDirection.PLUS_Y)
            self.plant.start(way, request.now_s)
        return super().jog(request)
