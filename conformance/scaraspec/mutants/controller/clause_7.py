"""Mutants of clause 7: the tool, the gripper centre and the six values of a pose."""

from collections.abc import Callable

from scaraspec.mutants.controller import Core, row
from scaraspec.mutants.operators.controller.requests import after, decoded
from scaraspec.protocol.commands import MoveTarget, Pose
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request


def _target(change: Callable[[MoveTarget], MoveTarget]) -> Core:
    """The target of a move is changed."""
    return decoded("set_tool_coordinates", lambda _core, _frame, target: target and change(target))


def _add_center_twice(core: ControllerCore, _request: Request, pose: Pose) -> Pose:
    x, y, z = core.store.settings.gripper_center
    return pose._replace(x=pose.x + 2 * x, y=pose.y + 2 * y, z=pose.z + 2 * z)


def _add_height_twice(core: ControllerCore, _request: Request, pose: Pose) -> Pose:
    return pose._replace(z=pose.z + 2 * core.store.settings.gripper_center[2])


row(
    "gripper-counts-twice",
    "7/1",
    "The tool coordinates are shifted by twice the gripper centre.",
    after("get_tool_coordinates", _add_center_twice),
)
row(
    "gripper-counts-in-height",
    "7/1",
    "Twice the height of the gripper centre is added to the tool coordinates.",
    after("get_tool_coordinates", _add_height_twice),
)
row(
    "each-connection-has-its-point",
    "7/1",
    "The tool coordinates differ by the number of the connection.",
    after(
        "get_tool_coordinates",
        lambda _core, request, pose: pose._replace(x=pose.x + request.session.connection % 7),
    ),
    subtle=True,
)
row(
    "theta-yturns-the-tool",
    "7/2",
    "ThetaY of a move is added to thetaX.",
    _target(lambda target: target._replace(theta_x=target.theta_x + target.theta_y)),
)
row(
    "theta-zturns-the-tool",
    "7/2",
    "A thetaZ other than zero is the rotation of a move, as with other robots.",
    _target(lambda target: target._replace(theta_x=target.theta_z or target.theta_x)),
)
