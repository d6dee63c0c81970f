"""Behaviour of the session, clock and settings commands: 4.1 to 4.8, 4.19 to 4.22, 4.35."""

from datetime import datetime
from typing import Final

from scaraspec.protocol.commands import Network, Point, Pose
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller import arm
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Base, are_coordinates, refused
from scaraspec.virtual_controller.session import Request

VERSION: Final = "1.0.0"
"""Software version of the virtual robot (L203)."""
PASSWORD_MAX_BYTES: Final = 127
"""Limit of a password: the old and the new one must fit in one request (A-4.1-3)."""


class Settings(Base):
    """The commands that read or change settings without motion."""

    def login(self, request: Request) -> bool:
        """4.1: valid for this connection (A-4.1-1); a wrong password changes nothing (A-4.1-2)."""
        correct = bool(request.value == self.store.settings.password)
        request.session.logged_in |= correct
        return correct

    def set_password(self, request: Request) -> bool:
        """4.2: applies to the next login; a logged-in client stays logged in (A-4.2-2)."""
        old, new = request.value
        if old != self.store.settings.password or len(new) > PASSWORD_MAX_BYTES:
            return False
        return self.is_text(new) and self.save(password=new)

    def get_network(self, _: Request) -> Network:
        """4.3: the stored network settings."""
        settings = self.store.settings
        return Network(settings.ip, settings.mask, settings.gateway)

    def set_network(self, request: Request) -> bool:
        """4.4: stored and reported; the server keeps its address (A-4.4-1)."""
        return self.save(**request.value._asdict())

    def set_time(self, request: Request) -> bool:
        """4.5: accepted at any time (A-4.5-2)."""
        self.plant.clock.set(request.value, request.now_s)
        return True

    def get_time(self, request: Request) -> datetime:
        """4.6: the time of the robot's clock."""
        return self.plant.clock.time(request.now_s)

    def get_version(self, _: Request) -> str:
        """4.7: the software version."""
        return VERSION

    def get_status(self, _: Request) -> str:
        """4.8: a fault, the state of the executing command, or idle."""
        return self.robot.status

    def get_gripper_center(self, _: Request) -> Point:
        """4.19: the stored gripper center."""
        return Point(*self.store.settings.gripper_center)

    def set_gripper_center(self, request: Request) -> bool:
        """4.20: not while a command executes (A-4.20-1)."""
        if self.robot.task is not None or not are_coordinates(request.value):
            return False
        return self.save(gripper_center=tuple(request.value))

    def get_initial_tool_position(self, _: Request) -> Pose:
        """4.22: the stored initial tool position."""
        return Pose(*self.store.settings.initial_tool_position)

    def set_initial_tool_position(self, request: Request) -> bool:
        """4.21: the pose must be reachable and no command may execute (A-4.21-2)."""
        pose: Pose = request.value
        if self.robot.task is not None or not self.accepts_thetas(pose.theta_y, pose.theta_z):
            return False
        try:
            arm.inverse(arm.Pose(*pose[:4]), self.plant.joints(request.now_s))
        except arm.UnreachableError:
            return False
        if self.dialect["theta_yz"] == "zero":
            pose = pose._replace(theta_y=0.0, theta_z=0.0)
        return are_coordinates(pose) and self.save(initial_tool_position=tuple(pose))

    def shutdown(self, _: Request) -> Acceptance:
        """4.35: not while a command executes; the core closes every link after the reply."""
        if self.robot.task is not None:
            return refused(self.robot.task.state)
        self.powered = False
        return ACCEPTED
