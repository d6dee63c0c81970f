"""Mutants of clause 4.27: the angles of the joints."""

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, length_byte
from scaraspec.mutants.operators.controller.requests import after, answer
from scaraspec.protocol.commands import JointValues
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_ANGLES = "get_joint_angles"

row(
    "three-joints",
    "4.27/2",
    "The rotation is missing.",
    first_reply(_ANGLES, lambda data: data.rpartition(b"|")[0]),
)
row(
    "five-joints",
    "4.27/2",
    "A fifth number is sent for the gripper.",
    first_reply(_ANGLES, lambda data: data + b"|0"),
)
row(
    "angles-with-commas",
    "4.27/2",
    "While the arm moves, the angles have decimal commas.",
    first_reply(
        _ANGLES,
        lambda data: data.replace(b".", b","),
        when=lambda core: core.robot.task is not None,
    ),
    subtle=True,
)
row(
    "angles-with-units",
    "4.27/2",
    "A degree sign follows each angle except the last.",
    first_reply(_ANGLES, lambda data: data.replace(b"|", "°|".encode())),
)
row(
    "angles-have-the-printed-length",
    "4.27/3 3/7",
    "The length byte of the angles is always 17, as the document prints it.",
    length_byte(_ANGLES, lambda _: 17),
)


@mutant("angles-of-moving-arm-miscount", "4.27/3", "3/7", subtle=True)
class DoesNotCountSigns(ControllerCore):
    """While the arm moves, the length byte of the angles does not count minus signs."""

    def transmit(self, session: Session, data: bytes) -> None:
        if data.startswith(b"\xcc\x3c") and self.robot.task is not None:
            data = data[:2] + bytes([data[2] - data.count(b"-")]) + data[3:]
        super().transmit(session, data)


@mutant("angles-tremble", "4.27/4")
class AddsNoise(ControllerCore):
    """Every second reply has an angle that is half a degree larger, while the arm stands still."""

    _requests = 0

    def get_joint_angles(self, request: Request) -> JointValues:
        self._requests += 1
        joints = super().get_joint_angles(request)
        return joints._replace(outer_arm=joints.outer_arm + 0.5 * (self._requests % 2))


row(
    "angles-creep",
    "4.27/4",
    "The rotation grows by one degree per second while the arm stands still.",
    after(
        _ANGLES,
        lambda _, request, joints: joints._replace(rotation=joints.rotation + request.now_s % 300),
    ),
)


@mutant("angles-stand-still", "4.27/6", "7/5")
class RepeatsFirstAngles(ControllerCore):
    """Every reply has the angles of the first reply, even after the arm has moved."""

    _first: JointValues | None = None

    def get_joint_angles(self, request: Request) -> JointValues:
        self._first = self._first or super().get_joint_angles(request)
        return self._first


row(
    "wrist-stands-still",
    "4.27/6 7/5",
    "The value of the wrist does not follow the height of the tool.",
    answer(_ANGLES, lambda joints: joints._replace(wrist=250.0)),
)
row(
    "rotation-stands-still",
    "4.27/6 7/5",
    "The rotation does not follow thetaX.",
    answer(_ANGLES, lambda joints: joints._replace(rotation=-joints.inner_arm - joints.outer_arm)),
)
