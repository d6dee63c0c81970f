"""Faults of clause 4.24: moves to tool coordinates."""

import math
from dataclasses import replace

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.commands import BY_NAME, MoveTarget
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE
from scaraspec.virtual_controller.session import Request, Session

_FAR_MM = 10_000


def _is_far(request: Request) -> bool:
    target: MoveTarget | None = request.value
    return target is not None and max(map(abs, target[1:4])) > _FAR_MM


class _Retargeted(ControllerCore):
    """Goes somewhere else than it was told."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Go there."""
        if request.value is not None and not _is_far(request):
            request = replace(request, value=self.instead(request.value, request))
        return super().set_tool_coordinates(request)

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:  # noqa: ARG002 - for those that need it
        """Where it goes."""
        return target


@mutant("full-speed-overshoots", "4.24/8", subtle=True)
class FullSpeedOvershoots(_Retargeted):
    """A move at full speed goes a millimetre and a half too far along X."""

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:  # noqa: ARG002 - of all
        """Look at the speed."""
        return target._replace(x=target.x + 1.5) if target.speed >= 100 else target


@mutant("impossible-move-is-refused-like-aresult", "4.24/3")
class ImpossibleMoveIsRefusedLikeAResult(ControllerCore):
    """An impossible move is refused with "00|05"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 00 for 0."""
        if frame.opcode == 0x39 and frame.data == b"0|05":
            frame = frame._replace(data=b"00|05")
        super().emit(session, frame)


@mutant("impossible-move-is-refused-in-words", "4.24/3")
class ImpossibleMoveIsRefusedInWords(ControllerCore):
    """An impossible move is refused with "0|unreachable"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write it out."""
        if frame.opcode == 0x39 and frame.data == b"0|05":
            frame = frame._replace(data=b"0|unreachable")
        super().emit(session, frame)


@mutant("reads-comma-as-point", "4.24/3")
class ReadsCommaAsPoint(ControllerCore):
    """A comma in a number is taken for its point."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Understand it."""
        if frame.opcode == 0x39:
            frame = frame._replace(data=frame.data.replace(b",", b"."))
        super().handle(session, frame, now_s)


@mutant("missing-text-is-alittle", "4.24/3")
class MissingTextIsALittle(ControllerCore):
    """What is no number counts as one more than where the arm stands."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Make up a target."""
        if frame.opcode == 0x39 and b"abc" in frame.data:
            frame = frame._replace(data=b"10|301|0|250|0|0|0")
        super().handle(session, frame, now_s)


@mutant("refusal-has-the-printed-length", "4.24/4", "3/7")
class RefusalHasThePrintedLength(ControllerCore):
    """The length of the refusal of a move is 1, as its row prints it, with four bytes behind it."""

    def transmit(self, session: Session, data: bytes) -> None:
        """Overwrite the length."""
        if data.startswith(b"\xcc\x39\x04"):
            data = b"\xcc\x39\x01" + data[3:]
        super().transmit(session, data)


@mutant("refusal-counts-its-end", "4.24/4", "3/7")
class RefusalCountsItsEnd(ControllerCore):
    """The length of the refusal of a move counts the end byte too."""

    def transmit(self, session: Session, data: bytes) -> None:
        """Count one more."""
        if data.startswith(b"\xcc\x39\x04"):
            data = b"\xcc\x39\x05" + data[3:]
        super().transmit(session, data)


@mutant("every-speed-below-ten-is-refused", "4.24/5")
class EverySpeedBelowTenIsRefused(ControllerCore):
    """A move at less than ten percent is refused."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Look at the speed."""
        if self.robot.task is None and request.value is not None and request.value.speed < 10:
            return Acceptance(accepted=False, code="05")
        return super().set_tool_coordinates(request)


@mutant("full-speed-is-refused", "4.24/5", subtle=True)
class FullSpeedIsRefused(ControllerCore):
    """A move at a hundred percent is refused."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Compare with the wrong sign."""
        if self.robot.task is None and request.value is not None and request.value.speed >= 100:
            return Acceptance(accepted=False, code="05")
        return super().set_tool_coordinates(request)


@mutant("accepts-move-with-its-state", "4.24/5")
class AcceptsMoveWithItsState(ControllerCore):
    """The first reply to a move is "1|04"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add the state."""
        if frame.opcode == 0x39 and frame.data == b"1" and not frame.tagged:
            frame = frame._replace(data=b"1|04")
        super().emit(session, frame)


@mutant("refuses-to-stand-still", "4.24/5")
class RefusesToStandStill(ControllerCore):
    """A move to where the arm stands is refused."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Look whether there is a way to go."""
        pose = self.get_tool_coordinates(request)
        there = request.value is not None and request.value[1:4]
        if there and math.dist(there, pose[:3]) < 0.001 and not self.robot.task:
            return Acceptance(accepted=False, code="06")
        return super().set_tool_coordinates(request)


@mutant("move-has-no-result", "4.24/6")
class MoveHasNoResult(ControllerCore):
    """A move that has been made sends no final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        if request.command.name != "set_tool_coordinates" or not outcome.done:
            super().send_result(request, outcome)


@mutant("move-ends-as-failure", "4.24/6")
class MoveEndsAsFailure(ControllerCore):
    """A move that has been made is told as a failure."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Miss the end."""
        if request.command.name == "set_tool_coordinates" and outcome.done:
            outcome = Outcome(done=False, code="05")
        super().send_result(request, outcome)


@mutant("move-ends-with-its-pose", "4.24/6")
class MoveEndsWithItsPose(ControllerCore):
    """The final result of a move is the pose."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write the pose."""
        if frame.opcode == 0x39 and frame.tagged and frame.data == b"11":
            frame = frame._replace(data=b"300|0|250|0|0|0")
        super().emit(session, frame)


@mutant("swaps-xand-y", "4.24/8")
class SwapsXAndY(_Retargeted):
    """A step along x is made along y."""

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:
        """Take one for the other."""
        here = self.get_tool_coordinates(request)
        return target._replace(x=here.x + target.y - here.y, y=here.y + target.x - here.x)


@mutant("turns-the-other-way", "4.24/8")
class TurnsTheOtherWay(_Retargeted):
    """ThetaX is taken with the other sign."""

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:  # noqa: ARG002 - the seam's form
        """Turn it round."""
        return target._replace(theta_x=-target.theta_x)


@mutant("forgets-z", "4.24/8")
class ForgetsZ(_Retargeted):
    """The height of a target is not taken."""

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:
        """Stay at the height."""
        return target._replace(z=self.get_tool_coordinates(request).z)


@mutant("takes-tenths-of-inches", "4.24/8")
class TakesTenthsOfInches(_Retargeted):
    """Along y the arm goes 2.54 times as far as it was told."""

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:
        """Scale the way."""
        here = self.get_tool_coordinates(request)
        return target._replace(y=here.y + (target.y - here.y) * 2.54)


@mutant("goes-by-whole-fives", "4.24/8")
class GoesByWholeFives(_Retargeted):
    """Targets are rounded to five millimetres in y."""

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:  # noqa: ARG002 - the seam's form
        """Round it."""
        return target._replace(y=round(target.y / 5) * 5)


@mutant("ends-half-way", "4.24/8")
class EndsHalfWay(ControllerCore):
    """A move is said to be done when half of the time has passed, and stops there."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Go half of the way."""
        here = self.get_tool_coordinates(request)
        target: MoveTarget | None = request.value
        if target is not None and not _is_far(request):
            half = MoveTarget(
                target.speed, *(p + (q - p) / 2 for p, q in zip(here, target[1:], strict=True))
            )
            request = replace(request, value=half)
        return super().set_tool_coordinates(request)


@mutant("drifts-with-every-move", "4.24/8", subtle=True)
class DriftsWithEveryMove(_Retargeted):
    """Every move misses its target by half a millimetre more than the one before."""

    _moves = 0

    def instead(self, target: MoveTarget, request: Request) -> MoveTarget:  # noqa: ARG002 - the seam's form
        """Add up the errors."""
        self._moves += 1
        return target._replace(x=target.x - 0.5 * min(self._moves, 20))


@mutant("goes-anywhere", "4.24/9", "4.24/3")
class GoesAnywhere(ControllerCore):
    """A target beyond all reach is accepted, and said to be reached."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Do not look."""
        if _is_far(request) and self.robot.task is None:
            self.send_result(request, DONE)
            return ACCEPTED
        return super().set_tool_coordinates(request)


@mutant("goes-anywhere-downwards", "4.24/9")
class GoesAnywhereDownwards(ControllerCore):
    """The lower end of Z is not checked: a target far below is said to be reached."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Check the upper end alone."""
        if request.value is not None and request.value.z < -_FAR_MM and self.robot.task is None:
            self.send_result(request, DONE)
            return ACCEPTED
        return super().set_tool_coordinates(request)


@mutant("blames-motor-for-the-reach", "4.24/9")
class BlamesMotorForTheReach(ControllerCore):
    """A target beyond all reach is refused with a motor's code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 12 for 05."""
        if frame.opcode == BY_NAME["set_tool_coordinates"].opcode and frame.data == b"0|05":
            frame = frame._replace(data=b"0|12")
        super().emit(session, frame)
