"""Faults of clause 7: the tool, the gripper's centre and the six values of a pose."""

from dataclasses import replace

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.commands import Pose
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request


@mutant("gripper-counts-twice", "7/1")
class GripperCountsTwice(ControllerCore):
    """The tool coordinates are shifted by twice the gripper's centre."""

    def get_tool_coordinates(self, request: Request) -> Pose:
        """Add it twice."""
        pose = super().get_tool_coordinates(request)
        x, y, z = self.store.settings.gripper_center
        return pose._replace(x=pose.x + 2 * x, y=pose.y + 2 * y, z=pose.z + 2 * z)


@mutant("gripper-counts-in-height", "7/1")
class GripperCountsInHeight(ControllerCore):
    """Of the gripper's centre the height alone is added to the tool coordinates, and doubled."""

    def get_tool_coordinates(self, request: Request) -> Pose:
        """Add the height."""
        pose = super().get_tool_coordinates(request)
        return pose._replace(z=pose.z + 2 * self.store.settings.gripper_center[2])


@mutant("each-connection-has-its-point", "7/1", subtle=True)
class EachConnectionHasItsPoint(ControllerCore):
    """The tool coordinates differ by the number of the connection."""

    def get_tool_coordinates(self, request: Request) -> Pose:
        """Add an offset of an array that is indexed wrongly."""
        pose = super().get_tool_coordinates(request)
        return pose._replace(x=pose.x + request.session.connection % 7)


@mutant("theta-yturns-the-tool", "7/2")
class ThetaYTurnsTheTool(ControllerCore):
    """ThetaY of a move is added to thetaX."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Mix them up."""
        if request.value is not None:
            target = request.value
            turned = target._replace(theta_x=target.theta_x + target.theta_y)
            request = replace(request, value=turned)
        return super().set_tool_coordinates(request)


@mutant("theta-zturns-the-tool", "7/2")
class ThetaZTurnsTheTool(ControllerCore):
    """ThetaZ of a move is taken for the rotation, as everywhere else in the world."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Take the other one."""
        if request.value is not None and request.value.theta_z:
            request = replace(request, value=request.value._replace(theta_x=request.value.theta_z))
        return super().set_tool_coordinates(request)
