"""Mutants of clause 4.35: the shutdown."""

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import accepts, after, on_request
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


def _stay_on(core: ControllerCore, _request: Request, reply: Acceptance) -> Acceptance:
    core.powered = True
    return reply


def _stop_if_refused(core: ControllerCore, request: Request, reply: Acceptance) -> Acceptance:
    if not reply.accepted:
        core.robot.stop(request.now_s)
    return reply


row(
    "stays-on",
    "4.35/2",
    "The shutdown is accepted but not executed.",
    after("shutdown", _stay_on),
)


@mutant("goes-behind-the-run", "4.35/2", subtle=True)
class ShutsDownAfterRun(ControllerCore):
    """A shutdown that is refused while a program runs is executed after the program has ended."""

    _due = False

    def shutdown(self, request: Request) -> Acceptance:
        reply = super().shutdown(request)
        self._due = not reply.accepted
        return reply

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        if self._due and self.robot.task is None:
            self.powered = self._due = False
            for session in list(self.sessions.values()):
                self._end(session, now_s)


@mutant("goes-without-reply", "4.35/2")
class ShutsDownWithoutReply(ControllerCore):
    """The robot shuts down without a reply."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode != 0x60 or frame.data != b"1":
            super().emit(session, frame)


row(
    "shutdown-is-refused",
    "4.35/2",
    "An idle robot refuses to shut down.",
    on_request("shutdown", lambda core, _: refused(core.robot.refusal_code() or "05")),
)
row(
    "shutdown-is-answered-with-time",
    "4.35/2",
    "The reply to the shutdown also contains a number of seconds.",
    first_reply("shutdown", {b"1": b"1|3"}),
)


@mutant("shutdown-has-result", "4.35/5")
class SendsResultOfShutdown(ControllerCore):
    """A tagged final result follows the reply to the shutdown."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame)
        if frame.opcode == 0x60 and frame.data == b"1":
            super().emit(session, Frame(C2A, 0x60, b"11", tagged=True))


row(
    "shutdown-is-accepted-during-run",
    "4/15 4.35/4",
    "While a program runs, the shutdown is accepted but not executed.",
    accepts("shutdown", lambda core, _: core.robot.task is not None),
)
row(
    "shutdown-is-refused-as-moving",
    "4/15 4.35/4",
    "While a program runs, the shutdown is refused with 04.",
    first_reply("shutdown", {b"0|01": b"0|04"}),
)
row(
    "refused-shutdown-ends-the-run",
    "4.35/2",
    "While a program runs, the shutdown is refused, but the program ends.",
    after("shutdown", _stop_if_refused),
)
