"""Mutants of clauses 4.25 and 4.26: releasing and locking the joints."""

from typing import Any

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, outcome
from scaraspec.mutants.operators.controller.requests import (
    after,
    completes,
    executing,
    on_request,
)
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, JogDirection, Outcome
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

row(
    "release-is-answered-released",
    "4.25/2 4/1",
    'The first reply to a release is "1|4", with the number of joints.',
    first_reply("release_joints", {b"1": b"1|4"}),
)
row(
    "release-is-refused",
    "4.25/2",
    "An idle robot refuses to release its joints.",
    on_request(
        "release_joints", lambda core, _: refused(core.robot.refusal_code(moves=False) or "05")
    ),
)


@mutant("second-release-is-answered-two", "4.25/2", "4/1")
class AnswersSecondReleaseWithTwo(ControllerCore):
    """A release that directly follows another release is answered 2."""

    _released = False

    def _reply(self, session: Session, command: Command, frame: Frame, answer: Any) -> None:
        releases = command.name == "release_joints"
        again, self._released = releases and self._released, releases
        if again:
            self.emit(session, frame._replace(direction=frame.direction.opposite, data=b"2"))
        else:
            super()._reply(session, command, frame, answer)


row(
    "release-has-no-result",
    "4.25/3",
    "A release has no final result, even when the joints are locked again.",
    outcome("release_joints", lambda *_: None),
)


@mutant("release-ends-as-lock", "4.25/3")
class EndsReleaseAsLock(ControllerCore):
    """The final result of a release has the opcode of the lock."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x3A and frame.tagged:
            frame = frame._replace(opcode=0x3B)
        super().emit(session, frame)


@mutant("second-release-fails", "4.25/3", subtle=True)
class FailsSecondRelease(ControllerCore):
    """From the second on, every release ends with a failure."""

    _releases = 0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name == "release_joints":
            self._releases += 1
            if self._releases > 1:
                outcome = Outcome(done=False, code="06")
        super().send_result(request, outcome)


row(
    "releases-during-run",
    "4.25/5 4/6",
    "A release is accepted while a program runs.",
    completes("release_joints", executing("run_program")),
)
row(
    "releases-during-simulation",
    "4.25/5 4/6",
    "A release is accepted while a program is simulated.",
    completes("release_joints", executing("simulate_program")),
)
row(
    "releases-during-reset",
    "4.25/5 4/6",
    "A release is accepted while the robot resets.",
    completes("release_joints", executing("reset")),
)
row(
    "releases-during-move",
    "4.25/5 4/6",
    "A release is accepted while the arm moves to a pose.",
    completes("release_joints", executing("set_tool_coordinates")),
)
row(
    "releases-during-jog",
    "4.25/5 4/6",
    "A release is accepted during a jog.",
    completes("release_joints", executing("jog")),
)
row(
    "lock-is-answered-twice",
    "4.26/2 4/1",
    'The first reply to a lock is "11".',
    first_reply("lock_joints", {b"1": b"11"}),
)


@mutant("lock-of-released-is-refused", "4.26/2")
class RefusesLockOfReleased(ControllerCore):
    """Released joints are locked, but the command is refused."""

    def lock_joints(self, request: Request) -> Acceptance:
        if not self.plant.locked and self.robot.task is None:
            self.plant.locked = True
            return refused("06")
        return super().lock_joints(request)


row(
    "lock-has-no-result",
    "4.26/3",
    "A lock has no final result.",
    outcome("lock_joints", lambda *_: None),
)


@mutant("lock-fails", "4.26/3")
class FailsLockOfReleased(ControllerCore):
    """A lock of released joints ends with a failure."""

    _released = False

    def lock_joints(self, request: Request) -> Acceptance:
        self._released = not self.plant.locked
        return super().lock_joints(request)

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name == "lock_joints" and self._released:
            outcome = Outcome(done=False, code="18")
        super().send_result(request, outcome)


@mutant("lock-leaves-them-loose", "4.26/3", "4.24/5")
class LocksNothing(ControllerCore):
    """A lock of released joints is reported as done, but they stay released."""

    def lock_joints(self, request: Request) -> Acceptance:
        released = not self.plant.locked
        reply = super().lock_joints(request)
        self.plant.locked = not released
        return reply


def _jog(core: ControllerCore, request: Request, reply: Acceptance) -> Acceptance:
    if reply.accepted:
        way = motion.jog(core.plant.joints(request.now_s), JogDirection.PLUS_Y)
        core.plant.start(way, request.now_s)
    return reply


row(
    "arm-sags-behind-lock",
    "4.26/5",
    "The arm moves for some time after a lock.",
    after("lock_joints", _jog),
)
