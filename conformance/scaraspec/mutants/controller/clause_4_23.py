"""Mutants of clause 4.23: the tool coordinates."""

from collections.abc import Callable

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import after
from scaraspec.protocol.commands import Pose
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


def _fields(change: Callable[[list[bytes]], list[bytes]]) -> Core:
    """The fields of the reply are changed."""
    return first_reply("get_tool_coordinates", lambda data: b"|".join(change(data.split(b"|"))))


def _pose(change: Callable[[ControllerCore, Request, Pose], Pose]) -> Core:
    """The reported coordinates are changed."""
    return after("get_tool_coordinates", change)


def _with_gripper_twice(core: ControllerCore, _request: Request, pose: Pose) -> Pose:
    x, y, z = core.store.settings.gripper_center
    return pose._replace(x=pose.x + 2 * x, y=pose.y + 2 * y, z=pose.z + 2 * z)


row(
    "coordinates-of-four-numbers",
    "4.23/2",
    "The coordinates have no thetaY and thetaZ.",
    _fields(lambda fields: fields[:4]),
)
row(
    "coordinates-with-units",
    "4.23/2",
    "x, y and z have a unit.",
    _fields(lambda fields: [field + b"mm" for field in fields[:3]] + fields[3:]),
)
row(
    "angles-are-not-numbers",
    "4.23/2",
    "thetaY and thetaZ are nan.",
    _fields(lambda fields: [*fields[:4], b"nan", b"nan"]),
)


@mutant("coordinates-tremble", "4.23/5", subtle=True)
class ReportsTrembling(ControllerCore):
    """Every second reply has an x that is 0.5 mm too high."""

    _count = 0

    def get_tool_coordinates(self, request: Request) -> Pose:
        self._count += 1
        pose = super().get_tool_coordinates(request)
        return pose._replace(x=pose.x + 0.5 * (self._count % 2))


row(
    "coordinates-drift",
    "4.23/5",
    "The reported height decreases by one millimetre per second.",
    _pose(lambda _core, request, pose: pose._replace(z=pose.z - request.now_s % 60)),
)


@mutant("tool-creeps-behind-move", "4.23/5", subtle=True)
class ReportsCreepingAfterMove(ControllerCore):
    """For 2 s after a move the reported height decreases by a third of a millimetre per second."""

    _has_ended = False
    _ended_s = float("-inf")

    def emit(self, session: Session, frame: Frame) -> None:
        self._has_ended |= frame.tagged and frame.opcode == 0x39
        super().emit(session, frame)

    def get_tool_coordinates(self, request: Request) -> Pose:
        if self._has_ended:
            self._has_ended, self._ended_s = False, request.now_s
        pose = super().get_tool_coordinates(request)
        since_s = request.now_s - self._ended_s
        return pose._replace(z=pose.z - since_s / 3) if since_s < 2.0 else pose


@mutant("late-coordinates-are-zero", "4.23/5", subtle=True)
class ReportsZerosEverySixthTime(ControllerCore):
    """Every sixth reply contains zeros."""

    _count = 0

    def get_tool_coordinates(self, request: Request) -> Pose:
        self._count += 1
        pose = super().get_tool_coordinates(request)
        return pose if self._count % 6 else Pose(0, 0, 0, 0, 0, 0)


row(
    "coordinates-of-the-connection",
    "4.23/5",
    "On every second connection y is negated and 1 mm too low.",
    _pose(
        lambda _core, request, pose: (
            pose._replace(y=-pose.y - 1) if request.session.connection % 2 else pose
        )
    ),
    subtle=True,
)
row(
    "gripper-is-added-twice",
    "4.23/3",
    "The gripper center is added to the coordinates twice.",
    _pose(_with_gripper_twice),
)
row(
    "gripper-turns-the-tool",
    "4.23/3",
    "x of the gripper center is added to the reported thetaX.",
    _pose(
        lambda core, _request, pose: pose._replace(
            theta_x=pose.theta_x + core.store.settings.gripper_center[0]
        )
    ),
)
