"""Clause 4.35: shut down the robot (0x60, L689-706). It is the last case of a run."""

from typing import Final

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import SILENCE_S, ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.two_stage.commands import RUN, require_command, try_request
from scaraspec.suite.controller.harness.two_stage.refusals import text_of
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    HookMissing,
    NoReply,
    expect,
)
from scaraspec.user_message import UserMessage

_HAZARDS = (Hazard.MOTION, Hazard.DESTRUCTIVE)
_SHUTDOWN: Final = "shutdown"
_RESTART_S: Final = 60.0
_POLL_S: Final = 0.5
_SHUTDOWN_S: Final = 1.0


@case("4.35/2", "4/15", name="busy", hazards=(*_HAZARDS, Hazard.STATE), last=True)
def test_not_while_a_program_runs(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A shutdown while a program runs is refused with "0|01", and the robot stays on."""
    require_command(subject, _SHUTDOWN)
    if subject.dialect["busy_reply"] == "queue":
        raise CaseSkipped("a robot that queues the request would shut down when the program ends")
    with executing_task(subject, line, RUN) as task:
        reply = try_request(line, _SHUTDOWN)
        task.require_executing()
        expect(
            reply is not None and reply.accepted is False and reply.code == "01",
            "the shutdown was not refused with 01 while a program ran",
            expected="0|01",
            observed=f"{reply}",
            requirement="4/15",
        )
        status = line.ask("get_status")
        expect(
            status.value == "01" or task.finished,
            "the running program ended after a refused shutdown",
            expected="01",
            observed=f"{status}",
        )
    line.wait(_SHUTDOWN_S)
    try:
        line.ask("get_status")
    except NoReply as error:
        message = "after the program the robot is off, although it refused to shut down"
        raise CaseFailed(message, expected="a reply", observed=error.observed) from None
    subject.settle()


@case("4.35/2", "4.35/5", hazards=_HAZARDS, attended=True, last=True)
def test_shutdown(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An idle robot answers a shutdown with a single "1" and then switches off."""
    require_command(subject, _SHUTDOWN)
    reply = line.ask(_SHUTDOWN)
    expect(
        reply.accepted and text_of(reply) == b"1",
        "an idle robot does not shut down",
        expected="1",
        observed=f"{reply}",
    )
    line.wait(SILENCE_S)
    tagged = [received for received in line.inbox if received.frame.tagged]
    expect(
        not tagged,
        "a final result follows the reply to the shutdown",
        expected="no tagged frame",
        observed=" ".join(f"{received.frame}" for received in tagged),
        requirement="4.35/5",
    )
    expect(
        _is_gone(subject, line),
        "the robot continues to serve although it accepted the shutdown",
        expected="the link ends, or requests are not answered",
        observed="get_status is answered",
    )
    _wait_for_restart(subject)


def _is_gone(subject: ControllerUnderTest, line: OutgoingConnection) -> bool:
    """Whether the controller soon ends the connection or stops replying."""
    deadline = Deadline(subject, subject.longest_s)
    while not deadline.expired:
        if line.ending is not None:
            return True
        try:
            line.ask("get_status")
        except NoReply:
            return True
        line.wait(_POLL_S)
    return False


def _wait_for_restart(subject: ControllerUnderTest) -> None:
    """Restart the controller if a hook or an operator can do it, and wait for it.

    Without a hook, one attempt is made after a pause: a controller that closes its connections
    before it switches off may accept a new one.

    Raises:
        CaseInconclusive: The controller was restarted and does not respond.
    """
    subject.close_lines()
    subject.off = True
    names = sorted(("start", "restart"), key=lambda name: name not in subject.ics.hooks)
    hook = next((name for name in names if subject.has_hook(name)), "")
    try:
        if hook:
            subject.hook(hook)
        else:
            subject.access.pause(_SHUTDOWN_S)
    except HookMissing:  # the operator skipped it
        hook = ""
    deadline = Deadline(subject, _RESTART_S)
    while not deadline.expired:
        try:
            line = subject.open()
            status = line.ask("get_status")
        except CaseFailed:
            subject.close_lines()
            if not hook:
                break
            subject.access.pause(_POLL_S)
            continue
        expect(
            status.value is not None,
            "the robot does not report its status after it was switched on",
            observed=f"{status}",
            requirement="4.8/2",
        )
        subject.close_lines()
        subject.off = False
        return
    if hook:
        raise CaseInconclusive(
            UserMessage(
                "the controller did not respond within {timeout_s:g} s after the hook {hook}",
                timeout_s=_RESTART_S,
                hook=hook,
            )
        )
    message = "the controller did not restart by itself: switch it on again"
    subject.tolerate("4.35/2", "A-4.35-2", "stays off", message)
