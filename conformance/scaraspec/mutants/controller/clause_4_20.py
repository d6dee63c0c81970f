"""Faults of clause 4.20: setting the gripper centre."""

from abc import ABC, abstractmethod
from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies, Mends
from scaraspec.protocol.commands import Command, Point
from scaraspec.protocol.fields import Diagnostics, Number
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller import arm, motion
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_SET: Final = "set_gripper_center"
_NUDGE_MM: Final = 3.0
_LATE_S: Final = 1.0
_MANY: Final = 30


class _SetsOtherwise(ControllerCore, ABC):
    """Another gripper centre is set than was sent."""

    @abstractmethod
    def wrong(self, point: Point) -> Point:
        """What is set."""

    def set_gripper_center(self, request: Request) -> bool:
        """Set that."""
        return super().set_gripper_center(request) and self.save(
            gripper_center=tuple(self.wrong(request.value))
        )


@mutant("gripper-answered-with-itself", "4.20/2")
class GripperAnsweredWithItself(AltersReplies):
    """A new gripper centre is answered with more than a flag."""

    opcode = 0x35

    def altered(self, data: bytes) -> bytes:
        """Add something."""
        return b"1|0|0|0" if data == b"1" else data


@mutant("gripper-answered-with-zero", "4.20/2")
class GripperAnsweredWithZero(ControllerCore):
    """A new gripper centre is set, and the answer is 0."""

    def set_gripper_center(self, request: Request) -> bool:
        """Set it, and say the contrary."""
        super().set_gripper_center(request)
        return False


@mutant("gripper-is-forgotten", "4.20/3")
class GripperIsForgotten(ControllerCore):
    """A new gripper centre is answered 1 and not set."""

    def set_gripper_center(self, request: Request) -> bool:
        """Do nothing."""
        return request.value is not None


@mutant("gripper-loses-its-sign", "4.20/3")
class GripperLosesItsSign(_SetsOtherwise):
    """Of the height of a gripper centre the sign is lost."""

    def wrong(self, point: Point) -> Point:
        """Drop it."""
        return point._replace(z=abs(point.z))


@mutant("gripper-in-whole-millimetres", "4.20/3")
class GripperInWholeMillimetres(_SetsOtherwise):
    """Decimals of a gripper centre are cut."""

    def wrong(self, point: Point) -> Point:
        """Cut them."""
        return Point(*(float(int(value)) for value in point))


@mutant("gripper-is-mixed-up", "4.20/3")
class GripperIsMixedUp(_SetsOtherwise):
    """x and y of a gripper centre are stored in each other's place."""

    def wrong(self, point: Point) -> Point:
        """Swap them."""
        return Point(point.y, point.x, point.z)


@mutant("gripper-in-steps", "4.20/3")
class GripperInSteps(_SetsOtherwise):
    """A gripper centre is kept in steps of 0.4 mm."""

    def wrong(self, point: Point) -> Point:
        """Round it."""
        return Point(*(round(value / 0.4) * 0.4 for value in point))


@mutant("small-negatives-lose-their-sign", "4.20/3", subtle=True)
class SmallNegativesLoseTheirSign(_SetsOtherwise):
    """Numbers between -1 and 0 lose their sign: it was kept with the whole part."""

    def wrong(self, point: Point) -> Point:
        """Drop it there."""
        return Point(*(abs(value) if -1 < value < 0 else value for value in point))


@mutant("gripper-comes-late", "4.20/3", subtle=True)
class GripperComesLate(ControllerCore):
    """A new gripper centre is told a second later: until then the former one is."""

    _before: tuple[float, Point] | None = None

    def set_gripper_center(self, request: Request) -> bool:
        """Keep the former one."""
        self._before = request.now_s, Point(*self.store.settings.gripper_center)
        return super().set_gripper_center(request)

    def get_gripper_center(self, request: Request) -> Point:
        """Tell that for a while."""
        if self._before is not None and request.now_s - self._before[0] < _LATE_S:
            return self._before[1]
        return super().get_gripper_center(request)


@mutant("late-grippers-are-forgotten", "4.20/3", subtle=True)
class LateGrippersAreForgotten(ControllerCore):
    """From the thirtieth new gripper centre on each is answered 1 and not set."""

    _count = 0

    def set_gripper_center(self, request: Request) -> bool:
        """Count."""
        self._count += 1
        return self._count >= _MANY or super().set_gripper_center(request)


@mutant("gripper-of-the-connection", "4.20/3", subtle=True)
class GripperOfTheConnection(ControllerCore):
    """A connection is told the gripper centre that it has set itself, else zeros."""

    def get_gripper_center(self, request: Request) -> Point:
        """Look at who asks."""
        own = request.session.connection == self._set_by
        return super().get_gripper_center(request) if own else Point(0, 0, 0)

    _set_by = -1

    def set_gripper_center(self, request: Request) -> bool:
        """Remember who it was."""
        self._set_by = request.session.connection
        return super().set_gripper_center(request)


@mutant("reset-clears-the-centre", "4.20/3", subtle=True)
class ResetClearsTheCentre(ControllerCore):
    """A reset sets the gripper centre to zeros."""

    def reset(self, request: Request) -> Acceptance:
        """Clear it."""
        answer: Acceptance = super().reset(request)
        if answer.accepted:
            self.save(gripper_center=(0.0, 0.0, 0.0))
        return answer


@mutant("missing-height-is-zero", "4.20/4")
class MissingHeightIsZero(Mends):
    """A gripper centre of two numbers gets the height 0."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Fill it up."""
        return data + b"|0" if data.count(b"|") == 1 else data


@mutant("further-numbers-are-overlooked", "4.20/4")
class FurtherNumbersAreOverlooked(Mends):
    """What stands behind the third number is not looked at."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Drop it."""
        return b"|".join(data.split(b"|")[:3])


class _MendsNumbers(Mends, ABC):
    """Fields that are no numbers are taken for some."""

    command = _SET

    @abstractmethod
    def number(self, text: bytes) -> bytes:
        """What a field is taken for."""

    def mended(self, data: bytes) -> bytes:
        """Mend each."""
        return b"|".join(map(self.number, data.split(b"|")))


@mutant("empty-fields-are-zero", "4.20/4")
class EmptyFieldsAreZero(_MendsNumbers):
    """An empty field is taken for 0."""

    def number(self, text: bytes) -> bytes:
        """Take it for that."""
        return text or b"0"


@mutant("commas-are-decimal-points", "4.20/4")
class CommasAreDecimalPoints(_MendsNumbers):
    """A decimal comma is taken for a point."""

    def number(self, text: bytes) -> bytes:
        """Replace it."""
        return text.replace(b",", b".", 1)


@mutant("words-are-zero", "4.20/4")
class WordsAreZero(_MendsNumbers):
    """What is no number is taken for 0, as by C's atof."""

    def number(self, text: bytes) -> bytes:
        """Read it so."""
        return text if Number("").read(text, Diagnostics()) is not None else b"0"


@mutant("nan-is-number", "4.20/4")
class NanIsNumber(_MendsNumbers):
    """The word nan is taken for a number."""

    def number(self, text: bytes) -> bytes:
        """Take it."""
        return b"0" if text == b"nan" else text


@mutant("infinity-is-number", "4.20/4")
class InfinityIsNumber(_MendsNumbers):
    """The word inf is taken for a number."""

    def number(self, text: bytes) -> bytes:
        """Take it."""
        return b"1000" if text == b"inf" else text


@mutant("letters-behind-numbers-are-overlooked", "4.20/4")
class LettersBehindNumbersAreOverlooked(_MendsNumbers):
    """What stands behind a number is not looked at."""

    def number(self, text: bytes) -> bytes:
        """Drop it."""
        return text.rstrip(b"abcdefghijklmnopqrstuvwxyz")


@mutant("blanks-separate-numbers", "4.20/4")
class BlanksSeparateNumbers(Mends):
    """Blanks separate numbers as bars do."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Replace them."""
        return data if b"|" in data else data.replace(b" ", b"|")


@mutant("semicolons-separate-numbers", "4.20/4")
class SemicolonsSeparateNumbers(Mends):
    """Semicolons separate numbers as bars do."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Replace them."""
        return data if b"|" in data else data.replace(b";", b"|")


@mutant("third-number-is-not-checked", "4.20/4")
class ThirdNumberIsNotChecked(Mends):
    """Only the first two numbers are looked at; the third is taken for 0 where it is none."""

    command = _SET

    def mended(self, data: bytes) -> bytes:
        """Replace it."""
        head, bar, last = data.rpartition(b"|")
        good = head.count(b"|") != 1 or Number("").read(last, Diagnostics()) is not None
        return data if good else head + bar + b"0"


@mutant("refused-gripper-is-set-in-part", "4.20/3")
class RefusedGripperIsSetInPart(ControllerCore):
    """Of a gripper centre that is refused for its other fields the first number is set."""

    def _value(self, command: Command, frame: Frame) -> Any:
        value = super()._value(command, frame)
        if command.name == _SET and value is None:
            x = Number("").read(frame.data.partition(b"|")[0], Diagnostics())
            if x is not None and abs(x) < 1000:
                self.save(gripper_center=(x, *self.store.settings.gripper_center[1:]))
        return value


@mutant("gripper-is-forgotten-during-runs", "4.20/3", subtle=True)
class GripperIsForgottenDuringRuns(ControllerCore):
    """While a program runs a new gripper centre is answered 1 and not set."""

    def set_gripper_center(self, request: Request) -> bool:
        """Do nothing then."""
        return self.robot.task is not None or super().set_gripper_center(request)


@mutant("setting-the-gripper-moves-the-arm", "4.20/5")
class SettingTheGripperMovesTheArm(ControllerCore):
    """A new gripper centre sets the arm in motion, up by some millimetres."""

    def set_gripper_center(self, request: Request) -> bool:
        """Move it."""
        joints = self.plant.joints(request.now_s)
        pose = arm.forward(joints)
        up = arm.inverse(pose._replace(z_mm=pose.z_mm + _NUDGE_MM), near=joints)
        self.plant.start(motion.move(joints, up, 100), request.now_s)
        return super().set_gripper_center(request)
