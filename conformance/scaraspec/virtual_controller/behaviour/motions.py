"""Behaviour of the motion commands: 4.14, 4.17, 4.18, 4.23 to 4.28."""

from typing import Final

from scaraspec.protocol.commands import JointValues, MoveTarget, Pose
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller import arm, motion
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Base, are_coordinates, refused
from scaraspec.virtual_controller.robot import BAD_ARGUMENT, DONE, MOVING, RESETTING
from scaraspec.virtual_controller.session import Request

RESET_SPEED_PERCENT: Final = 50
"""Speed of a reset; 4.18 gives no speed."""


class Motions(Base):
    """The commands that move or stop the arm, or read its position."""

    def get_motor_temperatures(self, request: Request) -> JointValues:
        """4.14: whole degrees Celsius (A-4.14-2)."""
        return JointValues(*map(round, self.plant.temperatures_c(request.now_s)))

    def get_joint_angles(self, request: Request) -> JointValues:
        """4.27: degrees, the wrist in mm (A-4.27-3)."""
        return JointValues(*self.plant.joints(request.now_s))

    def get_tool_coordinates(self, request: Request) -> Pose:
        """4.23: of the lower end of the screw (7.1), or of the gripper center (A-4.23-1)."""
        pose = arm.forward(self.plant.joints(request.now_s))
        if self.dialect["pose_point"] == "gripper":
            pose = arm.gripper_point(pose, arm.Offset(*self.store.settings.gripper_center))
        return Pose(*pose, theta_y=0.0, theta_z=0.0)

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """4.24: a joint-interpolated move that keeps the elbow (A-4.24-5)."""
        if code := self.robot.refusal_code():
            return refused(code)
        target: MoveTarget | None = request.value
        if (
            target is None
            or not are_coordinates(target)
            or not self.accepts_thetas(target.theta_y, target.theta_z)
        ):
            return refused(BAD_ARGUMENT)
        pose = arm.Pose(target.x, target.y, target.z, target.theta_x)
        if self.dialect["pose_point"] == "gripper":
            back = (-value for value in self.store.settings.gripper_center)
            pose = arm.gripper_point(pose, arm.Offset(*back))
        try:
            planned = self._plan_move(pose, target.speed, request.now_s)
        except arm.UnreachableError as error:
            return refused(error.code)
        self.robot.move(request, MOVING, planned)
        return ACCEPTED

    def reset(self, request: Request) -> Acceptance:
        """4.18: clear the faults without a lasting cause, then move to the initial tool position.

        The faults are cleared first, so that the state during the motion is 03 (L1020; A-4.18-3).
        A robot in error accepts the command; the result is a failure if a fault remains or the
        robot cannot move (L411-419).
        """
        fault, code = self.plant.fault_code, self.robot.refusal_code()
        if code is not None and (code != fault or self.dialect["reset_from_error"] == "idle-only"):
            return refused(code)
        self.plant.clear_faults()
        code = self.robot.refusal_code()
        if code is None:
            pose = arm.Pose(*self.store.settings.initial_tool_position[:4])
            try:
                planned = self._plan_move(pose, RESET_SPEED_PERCENT, request.now_s)
            except arm.UnreachableError as error:
                code = error.code
            else:
                self.robot.move(request, RESETTING, planned)
                return ACCEPTED
        if fault is None:
            return refused(code)
        self.send_result(request, Outcome(done=False, code=code))
        return ACCEPTED

    def _plan_move(self, pose: arm.Pose, speed_percent: int, now_s: float) -> motion.Motion:
        joints = self.plant.joints(now_s)
        return motion.move(joints, arm.inverse(pose, near=joints), speed_percent)

    def jog(self, request: Request) -> Acceptance:
        """4.28: moves until an emergency stop, a limit, or the loss of the link (A-4.28-3)."""
        if code := self.robot.refusal_code():
            return refused(code)
        if request.value is None:
            return refused(BAD_ARGUMENT)
        planned = motion.jog(self.plant.joints(request.now_s), request.value)
        self.robot.move(request, MOVING, planned, jogging=True)
        return ACCEPTED

    def emergency_stop(self, request: Request) -> Acceptance:
        """4.17: accepted while a command executes (A-4.17-1); does not latch (A-4.17-2)."""
        task = self.robot.stop(request.now_s)
        if task is None:
            return Acceptance(accepted=False)
        results = [(task.request, task.outcome_if_stopped), (request, DONE)]
        match self.dialect["estop_interrupted"]:
            case "after":
                results.reverse()
            case "none":
                del results[0]
        for ended_request, outcome in results:
            self.send_result(ended_request, outcome)
        return ACCEPTED

    def release_joints(self, request: Request) -> Acceptance:
        """4.25: ends at once (A-4.25-2), also if the joints are already released (A-4.25-3)."""
        return self._set_locked(request, locked=False)

    def lock_joints(self, request: Request) -> Acceptance:
        """4.26: ends at once, also if the joints are already locked."""
        return self._set_locked(request, locked=True)

    def _set_locked(self, request: Request, *, locked: bool) -> Acceptance:
        if code := self.robot.refusal_code(moves=False):
            return refused(code)
        self.plant.locked = locked
        self.send_result(request, DONE)
        return ACCEPTED
