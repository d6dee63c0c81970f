"""Faults of clause 4.23: the tool coordinates."""

from abc import ABC, abstractmethod
from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.commands import Pose
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_GET_POSE: Final = 0x38
_MOVE: Final = 0x39
_MANY: Final = 6
_CREEPS_S: Final = 2.0


class _TellsOtherwise(ControllerCore, ABC):
    """Other coordinates are told than the tool has."""

    @abstractmethod
    def wrong(self, pose: Pose, request: Request) -> Pose:
        """What is told."""

    def get_tool_coordinates(self, request: Request) -> Pose:
        """Tell that."""
        return self.wrong(super().get_tool_coordinates(request), request)


@mutant("coordinates-of-four-numbers", "4.23/2")
class CoordinatesOfFourNumbers(AltersReplies):
    """The coordinates are told without the angles that mean nothing."""

    opcode = _GET_POSE

    def altered(self, data: bytes) -> bytes:
        """Leave them away."""
        return b"|".join(data.split(b"|")[:4])


@mutant("coordinates-with-units", "4.23/2")
class CoordinatesWithUnits(AltersReplies):
    """Lengths bear their unit."""

    opcode = _GET_POSE

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        fields = data.split(b"|")
        return b"|".join([field + b"mm" for field in fields[:3]] + fields[3:])


@mutant("angles-are-not-numbers", "4.23/2")
class AnglesAreNotNumbers(AltersReplies):
    """The angles that mean nothing are told as nan."""

    opcode = _GET_POSE

    def altered(self, data: bytes) -> bytes:
        """Say so."""
        return b"|".join((*data.split(b"|")[:4], b"nan", b"nan"))


@mutant("coordinates-tremble", "4.23/5", subtle=True)
class CoordinatesTremble(_TellsOtherwise):
    """Every other reply is off by half a millimetre, though nothing moves."""

    _count = 0

    def wrong(self, pose: Pose, request: Request) -> Pose:  # noqa: ARG002 - whoever asks
        """Count."""
        self._count += 1
        return pose._replace(x=pose.x + 0.5 * (self._count % 2))


@mutant("coordinates-drift", "4.23/5")
class CoordinatesDrift(_TellsOtherwise):
    """The height sinks by a millimetre a second, as far as the coordinates say."""

    def wrong(self, pose: Pose, request: Request) -> Pose:
        """Sink."""
        return pose._replace(z=pose.z - request.now_s % 60)


@mutant("tool-creeps-behind-move", "4.23/5", subtle=True)
class ToolCreepsBehindMove(_TellsOtherwise):
    """For two seconds behind a move the height sinks by a third of a millimetre a second."""

    _has_ended = False
    _ended_s = float("-inf")

    def emit(self, session: Session, frame: Frame) -> None:
        """Note the end of a move."""
        self._has_ended = self._has_ended or (frame.tagged and frame.opcode == _MOVE)
        super().emit(session, frame)

    def wrong(self, pose: Pose, request: Request) -> Pose:
        """Creep from the first look behind it."""
        if self._has_ended:
            self._has_ended, self._ended_s = False, request.now_s
        behind_s = request.now_s - self._ended_s
        return pose._replace(z=pose.z - behind_s / 3) if behind_s < _CREEPS_S else pose


@mutant("late-coordinates-are-zero", "4.23/5", subtle=True)
class LateCoordinatesAreZero(_TellsOtherwise):
    """Every sixth reply tells zeros: nothing was measured."""

    _count = 0

    def wrong(self, pose: Pose, request: Request) -> Pose:  # noqa: ARG002 - whoever asks
        """Count."""
        self._count += 1
        return Pose(0, 0, 0, 0, 0, 0) if self._count % _MANY == 0 else pose


@mutant("coordinates-of-the-connection", "4.23/5", subtle=True)
class CoordinatesOfTheConnection(_TellsOtherwise):
    """Every other connection is told where the arm would stand with the other elbow."""

    def wrong(self, pose: Pose, request: Request) -> Pose:
        """Mirror it."""
        return pose._replace(y=-pose.y - 1) if request.session.connection % 2 else pose


@mutant("gripper-is-added-twice", "4.23/3")
class GripperIsAddedTwice(_TellsOtherwise):
    """The gripper centre is added to the coordinates twice."""

    def wrong(self, pose: Pose, request: Request) -> Pose:  # noqa: ARG002 - whoever asks
        """Add it."""
        x, y, z = self.store.settings.gripper_center
        return pose._replace(x=pose.x + 2 * x, y=pose.y + 2 * y, z=pose.z + 2 * z)


@mutant("gripper-turns-the-tool", "4.23/3")
class GripperTurnsTheTool(_TellsOtherwise):
    """The gripper centre changes the rotation that is told."""

    def wrong(self, pose: Pose, request: Request) -> Pose:  # noqa: ARG002 - whoever asks
        """Turn it."""
        return pose._replace(theta_x=pose.theta_x + self.store.settings.gripper_center[0])
