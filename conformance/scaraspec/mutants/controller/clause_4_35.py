"""Faults of clause 4.35: the shutdown."""

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


@mutant("stays-on", "4.35/2")
class StaysOn(ControllerCore):
    """The shutdown is accepted, and does not happen."""

    def shutdown(self, request: Request) -> Acceptance:
        """Say yes."""
        answer = super().shutdown(request)
        self.powered = True
        return answer


@mutant("goes-behind-the-run", "4.35/2", subtle=True)
class GoesBehindTheRun(ControllerCore):
    """A shutdown that is refused because a program runs happens when it has ended."""

    _due = False

    def shutdown(self, request: Request) -> Acceptance:
        """Put it off."""
        answer = super().shutdown(request)
        self._due = not answer.accepted
        return answer

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        if self._due and self.robot.task is None:
            self.powered = self._due = False
            for session in list(self.sessions.values()):
                self._end(session, now_s)


@mutant("goes-without-reply", "4.35/2")
class GoesWithoutReply(ControllerCore):
    """The robot is gone before it has answered."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send nothing."""
        if frame.opcode != 0x60 or frame.data != b"1":
            super().emit(session, frame)


@mutant("shutdown-is-refused", "4.35/2")
class ShutdownIsRefused(ControllerCore):
    """An idle robot refuses to shut down."""

    def shutdown(self, request: Request) -> Acceptance:  # noqa: ARG002 - the seam's form
        """Refuse."""
        return Acceptance(accepted=False, code=self.robot.refusal_code() or "05")


@mutant("shutdown-is-answered-with-time", "4.35/2")
class ShutdownIsAnsweredWithTime(ControllerCore):
    """The reply to the shutdown tells in how many seconds it will be."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add it."""
        if frame.opcode == 0x60 and frame.data == b"1":
            frame = frame._replace(data=b"1|3")
        super().emit(session, frame)


@mutant("shutdown-has-result", "4.35/5")
class ShutdownHasResult(ControllerCore):
    """The reply to the shutdown is followed by a tagged result."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send one more."""
        super().emit(session, frame)
        if frame.opcode == 0x60 and frame.data == b"1":
            super().emit(session, Frame(C2A, 0x60, b"11", tagged=True))


@mutant("shutdown-is-accepted-during-run", "4/15", "4.35/4")
class ShutdownIsAcceptedDuringRun(ControllerCore):
    """The shutdown is accepted while a program runs."""

    def shutdown(self, request: Request) -> Acceptance:
        """Say yes; the robot stays on for the sake of the program."""
        if self.robot.task is not None:
            return ACCEPTED
        return super().shutdown(request)


@mutant("shutdown-is-refused-as-moving", "4/15", "4.35/4")
class ShutdownIsRefusedAsMoving(ControllerCore):
    """The shutdown is refused with 04 while a program runs."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 04 for 01."""
        if frame.opcode == 0x60 and frame.data == b"0|01":
            frame = frame._replace(data=b"0|04")
        super().emit(session, frame)


@mutant("refused-shutdown-ends-the-run", "4.35/2")
class RefusedShutdownEndsTheRun(ControllerCore):
    """The shutdown is refused while a program runs, and the program ends all the same."""

    def shutdown(self, request: Request) -> Acceptance:
        """Stop the program behind the refusal."""
        answer = super().shutdown(request)
        if not answer.accepted:
            self.robot.stop(request.now_s)
        return answer
