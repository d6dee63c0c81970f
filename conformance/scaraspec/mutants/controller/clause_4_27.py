"""Faults of clause 4.27: the angles of the joints."""

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.commands import JointValues
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


@mutant("three-joints", "4.27/2")
class ThreeJoints(ControllerCore):
    """The rotation is missing."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave the last number away."""
        if frame.opcode == 0x3C:
            frame = frame._replace(data=frame.data.rpartition(b"|")[0])
        super().emit(session, frame)


@mutant("five-joints", "4.27/2")
class FiveJoints(ControllerCore):
    """A fifth number is sent for the gripper."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add it."""
        if frame.opcode == 0x3C:
            frame = frame._replace(data=frame.data + b"|0")
        super().emit(session, frame)


@mutant("angles-with-commas", "4.27/2", subtle=True)
class AnglesWithCommas(ControllerCore):
    """While the arm moves the angles have decimal commas."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Use another locale."""
        if frame.opcode == 0x3C and self.robot.task is not None:
            frame = frame._replace(data=frame.data.replace(b".", b","))
        super().emit(session, frame)


@mutant("angles-with-units", "4.27/2")
class AnglesWithUnits(ControllerCore):
    """The angles bear a sign for degrees."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add it."""
        if frame.opcode == 0x3C:
            frame = frame._replace(data=frame.data.replace(b"|", "°|".encode()))
        super().emit(session, frame)


@mutant("angles-have-the-printed-length", "4.27/3", "3/7")
class AnglesHaveThePrintedLength(ControllerCore):
    """The length of the angles is 17, as the row prints it, whatever is sent."""

    def transmit(self, session: Session, data: bytes) -> None:
        """Overwrite the length."""
        if data.startswith(b"\xcc\x3c"):
            data = data[:2] + bytes([17]) + data[3:]
        super().transmit(session, data)


@mutant("angles-of-moving-arm-miscount", "4.27/3", "3/7", subtle=True)
class AnglesOfMovingArmMiscount(ControllerCore):
    """While the arm moves the length of the angles does not count their signs."""

    def transmit(self, session: Session, data: bytes) -> None:
        """Leave them out."""
        if data.startswith(b"\xcc\x3c") and self.robot.task is not None:
            data = data[:2] + bytes([data[2] - data.count(b"-")]) + data[3:]
        super().transmit(session, data)


@mutant("angles-tremble", "4.27/4")
class AnglesTremble(ControllerCore):
    """The angles of an arm that stands still differ by half a degree every other time."""

    _asked = 0

    def get_joint_angles(self, request: Request) -> JointValues:
        """Add noise."""
        self._asked += 1
        joints = super().get_joint_angles(request)
        return joints._replace(outer_arm=joints.outer_arm + 0.5 * (self._asked % 2))


@mutant("angles-creep", "4.27/4")
class AnglesCreep(ControllerCore):
    """The angles of an arm that stands still grow by a degree a second."""

    def get_joint_angles(self, request: Request) -> JointValues:
        """Integrate an offset."""
        joints = super().get_joint_angles(request)
        return joints._replace(rotation=joints.rotation + request.now_s % 300)


@mutant("angles-stand-still", "4.27/6", "7/5")
class AnglesStandStill(ControllerCore):
    """The angles are those of the first time they were asked for, however the arm moves."""

    _first: JointValues | None = None

    def get_joint_angles(self, request: Request) -> JointValues:
        """Keep them."""
        self._first = self._first or super().get_joint_angles(request)
        return self._first


@mutant("wrist-stands-still", "4.27/6", "7/5")
class WristStandsStill(ControllerCore):
    """The wrist's value does not follow the height of the tool."""

    def get_joint_angles(self, request: Request) -> JointValues:
        """Leave it where it was."""
        return super().get_joint_angles(request)._replace(wrist=250.0)


@mutant("rotation-stands-still", "4.27/6", "7/5")
class RotationStandsStill(ControllerCore):
    """The rotation does not follow thetaX."""

    def get_joint_angles(self, request: Request) -> JointValues:
        """Compute it from the arms alone."""
        joints = super().get_joint_angles(request)
        return joints._replace(rotation=-joints.inner_arm - joints.outer_arm)
