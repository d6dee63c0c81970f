"""Faults of clause 4.21: setting the initial tool position."""

from abc import ABC, abstractmethod
from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies, Mends
from scaraspec.protocol.commands import Command, Pose
from scaraspec.protocol.fields import Diagnostics, Number
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_SET: Final = "set_initial_tool_position"
_FIELDS: Final = 6


class _SetsOtherwise(ControllerCore, ABC):
    """Another position is set than was sent."""

    @abstractmethod
    def wrong(self, pose: Pose) -> Pose:
        """What is set."""

    def set_initial_tool_position(self, request: Request) -> bool:
        """Set that."""
        return super().set_initial_tool_position(request) and self.save(
            initial_tool_position=tuple(self.wrong(request.value))
        )


@mutant("position-answered-in-words", "4.21/2")
class PositionAnsweredInWords(AltersReplies):
    """A new initial position is answered with a word."""

    opcode = 0x36

    def altered(self, data: bytes) -> bytes:
        """Say it in words."""
        return b"OK" if data == b"1" else data


@mutant("position-answered-with-zero", "4.21/2")
class PositionAnsweredWithZero(ControllerCore):
    """A new initial position is set, and the answer is 0."""

    def set_initial_tool_position(self, request: Request) -> bool:
        """Set it, and say the contrary."""
        super().set_initial_tool_position(request)
        return False


@mutant("every-position-is-refused", "4.21/2")
class EveryPositionIsRefused(ControllerCore):
    """An initial position is answered 0 wherever it is, and not set."""

    def set_initial_tool_position(self, request: Request) -> bool:  # noqa: ARG002 - whatever is asked
        """Refuse it."""
        return False


@mutant("position-is-forgotten", "4.21/3")
class PositionIsForgotten(ControllerCore):
    """A new initial position is answered 1 and not set."""

    def set_initial_tool_position(self, request: Request) -> bool:
        """Do nothing."""
        return request.value is not None


@mutant("rotation-of-the-position-is-forgotten", "4.21/3")
class RotationOfThePositionIsForgotten(_SetsOtherwise):
    """Of an initial position thetaX is not kept."""

    def wrong(self, pose: Pose) -> Pose:
        """Drop it."""
        return pose._replace(theta_x=0.0)


@mutant("position-in-whole-numbers", "4.21/3")
class PositionInWholeNumbers(_SetsOtherwise):
    """An initial position is rounded to whole numbers."""

    def wrong(self, pose: Pose) -> Pose:
        """Round it."""
        return Pose(*(float(round(value)) for value in pose))


@mutant("position-is-mixed-up", "4.21/3")
class PositionIsMixedUp(_SetsOtherwise):
    """y and z of an initial position are stored in each other's place."""

    def wrong(self, pose: Pose) -> Pose:
        """Swap them."""
        return pose._replace(y=pose.z, z=pose.y)


@mutant("angles-of-the-position-are-mixed-up", "4.21/3")
class AnglesOfThePositionAreMixedUp(_SetsOtherwise):
    """thetaX and thetaZ of an initial position are stored in each other's place."""

    def wrong(self, pose: Pose) -> Pose:
        """Swap them."""
        return pose._replace(theta_x=pose.theta_z, theta_z=pose.theta_x)


@mutant("position-moves-the-gripper-center", "4.21/3")
class PositionMovesTheGripperCenter(ControllerCore):
    """A new initial position is taken for a gripper centre, too."""

    def set_initial_tool_position(self, request: Request) -> bool:
        """Set both."""
        return super().set_initial_tool_position(request) and self.save(
            gripper_center=tuple(request.value[:3])
        )


@mutant("position-of-the-connection", "4.21/3", subtle=True)
class PositionOfTheConnection(ControllerCore):
    """Only the connection that has set an initial position is told it; others the former one."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._before = Pose(*self.store.settings.initial_tool_position)
        self._set_by = -1

    def set_initial_tool_position(self, request: Request) -> bool:
        """Keep the former one."""
        if request.session.connection != self._set_by:
            self._before = Pose(*self.store.settings.initial_tool_position)
            self._set_by = request.session.connection
        return super().set_initial_tool_position(request)

    def get_initial_tool_position(self, request: Request) -> Pose:
        """Look at who asks."""
        own = request.session.connection == self._set_by
        return super().get_initial_tool_position(request) if own else self._before


@mutant("four-numbers-are-enough", "4.21/4")
class FourNumbersAreEnough(Mends):
    """Angles that are missing are taken for 0."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Fill them up."""
        return data + b"|0" * max(_FIELDS - 1 - data.count(b"|"), 0) if b"|" in data else data


@mutant("seventh-number-is-overlooked", "4.21/4")
class SeventhNumberIsOverlooked(Mends):
    """What stands behind the sixth number is not looked at."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Drop it."""
        return b"|".join(data.split(b"|")[:_FIELDS])


@mutant("last-angles-are-not-read", "4.21/4")
class LastAnglesAreNotRead(Mends):
    """thetaY and thetaZ mean nothing, and may be anything."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Take them for 0."""
        fields = data.split(b"|")
        return b"|".join([*fields[:4], b"0", b"0"]) if len(fields) == _FIELDS else data


@mutant("commas-in-positions-are-points", "4.21/4")
class CommasInPositionsArePoints(Mends):
    """A decimal comma in a position is taken for a point."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Replace them."""
        return data.replace(b",", b".") if data.count(b"|") == _FIELDS - 1 else data


@mutant("numbers-end-where-they-end", "4.21/4")
class NumbersEndWhereTheyEnd(Mends):
    """Of each field of a position the number at its beginning is read, as by C's strtod."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Cut each."""
        return b"|".join(map(_beginning, data.split(b"|")))


def _beginning(field: bytes) -> bytes:
    """The longest number that a field begins with, or the field."""
    ends = range(len(field), 0, -1)
    return next(
        (field[:n] for n in ends if Number("").read(field[:n], Diagnostics()) is not None), field
    )


@mutant("position-is-forgotten-during-runs", "4.21/3", subtle=True)
class PositionIsForgottenDuringRuns(ControllerCore):
    """While a program runs a new position is answered 1 and not set."""

    def set_initial_tool_position(self, request: Request) -> bool:
        """Do nothing then."""
        return self.robot.task is not None or super().set_initial_tool_position(request)


@mutant("refused-position-is-set-in-part", "4.21/3")
class RefusedPositionIsSetInPart(ControllerCore):
    """Of an initial position that is refused for its last field the others are set."""

    def _value(self, command: Command, frame: Frame) -> Any:
        value = super()._value(command, frame)
        if command.name == _SET and value is None:
            fields = frame.data.split(b"|")[:-1]
            numbers = [Number("").read(field, Diagnostics()) for field in fields]
            if len(numbers) == _FIELDS - 1 and None not in numbers:
                self.save(initial_tool_position=(*numbers, 0.0))
        return value


@mutant("second-reset-turns-home", "4.21/3", subtle=True)
class SecondResetTurnsHome(ControllerCore):
    """The second reset, and each further one, turns the initial position by half a degree."""

    _count = 0

    def reset(self, request: Request) -> Acceptance:
        """Turn it."""
        answer: Acceptance = super().reset(request)
        self._count += answer.accepted
        if answer.accepted and self._count > 1:
            x, y, z, theta_x, *rest = self.store.settings.initial_tool_position
            self.save(initial_tool_position=(x, y, z, theta_x + 0.5, *rest))
        return answer
