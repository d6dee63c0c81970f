"""Clause 2: over the network, no request is executed without a login (L83, L104; A-4-4).

Whether such a client gets no reply, a refusal or a closed connection is a reading; the cases only
require that nothing changes. The requests are chosen so that they do no harm if they are executed.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any, Final

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import PasswordChange, Point, PortValue
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance, JogDirection
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.controller.harness.controller_under_test import MOMENT_S, ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import shifted_time
from scaraspec.suite.controller.harness.requests.files import begin_upload, upload
from scaraspec.suite.controller.harness.requests.motion import (
    SLOWEST_PERCENT,
    joints_of,
    move_target,
    pose_of,
)
from scaraspec.suite.controller.harness.requests.passwords import rotated_password
from scaraspec.suite.controller.harness.requests.ports import (
    expect_outputs,
    outputs,
    outputs_preserved,
)
from scaraspec.suite.controller.harness.suite_passwords import PLAIN_PASSWORD
from scaraspec.suite.controller.harness.two_stage.commands import RUN, upload_wait_program
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import (
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    expect,
    expect_equal,
)
from scaraspec.suite.program_files.layout import short_program
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.traffic.events import FrameSeen

_CLOCK_SHIFT: Final = timedelta(days=3000)
_PAUSE_S: Final = 0.02
_CENTER: Final = Point(11.5, -7.5, 3.5)
_RUN_S: Final = 60

Requests = list[tuple[str, Any]]


class _UnauthenticatedClient:
    """A client that sends requests without a login, on a new connection if the old one is closed.

    Attributes:
        accepted_frames: The replies that accepted a request.
    """

    def __init__(self, subject: ControllerUnderTest, *, wrong_logins: int = 0) -> None:
        if not subject.access.needs_login:
            raise CaseSkipped("this link needs no login (L83)")
        self.accepted_frames: list[FrameSeen] = []
        self._subject, self._wrong_logins = subject, wrong_logins

    def ask(self, *requests: tuple[str, Any], closing: OutgoingConnection | None = None) -> None:
        """Connect, send requests, and collect replies for a moment.

        Args:
            requests: The requests, by command and value.
            closing: A connection that is closed before they are sent.
        """
        line = self._connect()
        if closing:
            closing.close()
            self._collect_replies(line, _PAUSE_S)
        for name, value in examples(requests):
            try:
                line.send(name, value)
            except NoReply:
                line = self._connect()
                line.send(name, value)
            self._collect_replies(line, _PAUSE_S)
            if line.ending is not None:
                line = self._connect()
        self._collect_replies(line, MOMENT_S)
        line.close()

    def _connect(self) -> OutgoingConnection:
        line = self._subject.open(login=False)
        wrong_logins, self._wrong_logins = self._wrong_logins, 0  # only these (A-4.1-2)
        for _ in range(wrong_logins):
            try:
                reply = line.ask("login", rotated_password(self._subject.password))
            except NoReply:
                if line.ending is None:
                    raise
                return self._subject.open(login=False)
            expect(reply.accepted is False, "a wrong password was accepted", requirement="4.1/3")
        return line

    def _collect_replies(self, line: OutgoingConnection, for_s: float) -> None:
        line.wait(for_s)
        self.accepted_frames += [
            received for received in line.inbox if _is_acceptance(received.value)
        ]
        line.inbox.clear()

    def expect_nothing_accepted(self) -> None:
        """Fail the case if any request was accepted.

        Raises:
            CaseFailed: A request was accepted.
        """
        for received in self.accepted_frames:
            expect(
                condition=False,
                message=UserMessage(
                    "{command} was accepted on a connection without a login", command=received.name
                ),
                expected="no reply, a refusal or the end of the connection",
                observed=f"{received.frame}",
            )


def _is_acceptance(value: Any) -> bool:
    return value is True or (isinstance(value, Acceptance) and value.accepted)


@contextmanager
def _unchanged(
    subject: ControllerUnderTest, *settings: tuple[str, str]
) -> Iterator[dict[str, Any]]:
    """Expect that settings keep their values; restore those that changed.

    Args:
        subject: The SUT.
        settings: For each value, the command that reads it and the command that sets it.
    """
    before = _read_values(subject, settings)
    yield before
    after = _read_values(subject, settings)
    line = subject.open()
    for name, setter in examples(settings):
        if after[name] != before[name]:
            line.ask(setter, before[name])
    line.close()
    expect_equal(after, before, "settings were changed without a login")


def _read_values(
    subject: ControllerUnderTest, settings: tuple[tuple[str, str], ...]
) -> dict[str, Any]:
    line = subject.open()
    values = {name: line.ask(name).value for name, _ in settings}
    line.close()
    if None in values.values():
        raise CaseInconclusive("the controller does not report its settings")
    return values


_GRIPPER: Final = ("get_gripper_center", "set_gripper_center")
_HOME: Final = ("get_initial_tool_position", "set_initial_tool_position")


@contextmanager
def _settings_unchanged(subject: ControllerUnderTest) -> Iterator[Requests]:
    """Yield requests that set positions, the clock and a file; expect that none takes effect."""
    name = subject.new_name()
    with _unchanged(subject, _GRIPPER, _HOME) as before, _clock_unchanged(subject) as clock:
        pose = before["get_initial_tool_position"]
        yield [
            ("set_gripper_center", _CENTER),
            ("set_initial_tool_position", pose._replace(z=pose.z + 1)),
            ("set_time", shifted_time(clock, _CLOCK_SHIFT)),
            ("upload_name", name),
            ("upload_chunk", Chunk(4, 0, 4, b"none")),
        ]
    exists = subject.open().ask("download_name", name).accepted
    expect(not exists, "a file was stored without a login", observed="1 to 0x54")


@case("2/11", hazards=(Hazard.STATE,))
def test_settings(subject: ControllerUnderTest) -> None:
    """Requests that set positions, the clock and files have no effect without a login."""
    client = _UnauthenticatedClient(subject)
    with _settings_unchanged(subject) as settings:
        client.ask(*settings)
    client.expect_nothing_accepted()


@contextmanager
def _clock_unchanged(subject: ControllerUnderTest) -> Iterator[datetime]:
    """Yield the controller's time; expect that the clock is not set, and restore it if it is."""
    line = subject.open()
    before: datetime | None = line.ask("get_time").value
    line.close()
    if before is None:
        raise CaseInconclusive("the controller does not report its time")
    yield before
    line = subject.open()
    after: datetime | None = line.ask("get_time").value
    was_set = after is not None and abs(after - before) > _CLOCK_SHIFT / 2
    if was_set:
        line.ask("set_time", before)
    line.close()
    expect(not was_set, "the clock was set without a login", observed=f"{after}")


@case("2/11", "4.1/3", name="wrong-login", hazards=(Hazard.STATE,))
def test_wrong_login(subject: ControllerUnderTest) -> None:
    """Settings have no effect after a wrong password.

    If destructive cases are allowed, a second wrong password is sent before them (A-4.1-2).
    """
    destructive = Hazard.DESTRUCTIVE in subject.allowed
    client = _UnauthenticatedClient(subject, wrong_logins=2 if destructive else 1)
    with _settings_unchanged(subject) as settings:
        client.ask(*settings)
    client.expect_nothing_accepted()


@case("2/11", name="beside", hazards=(Hazard.STATE,))
def test_second_client_without_login(subject: ControllerUnderTest) -> None:
    """Settings of a client without a login have no effect while another client is logged in.

    They also have none after that client, which connected earlier, has left.
    """
    subject.require_multiple_connections()
    other = subject.open()
    client = _UnauthenticatedClient(subject)
    with _settings_unchanged(subject) as settings:
        client.ask(*settings)
        client.ask(*settings, closing=other)
    client.expect_nothing_accepted()


@case("2/11", name="behind", hazards=(Hazard.STATE,))
def test_connection_after_a_lost_one(subject: ControllerUnderTest) -> None:
    """Without a login, a setting has no effect after another client's upload was interrupted."""
    client = _UnauthenticatedClient(subject)
    with _unchanged(subject, _GRIPPER):
        for reset in examples((False, True)):
            line = subject.open()
            begin_upload(line, subject.new_name())
            line.reset() if reset else line.close()
            client.ask(("set_gripper_center", _CENTER))
    client.expect_nothing_accepted()


@case("2/11", name="motion", hazards=(Hazard.MOTION, Hazard.STATE))
def test_motion(subject: ControllerUnderTest) -> None:
    """Motion commands and an output have no effect without a login.

    An output is also tried while a program of another client runs.
    """
    subject.moved = True
    line = subject.open()
    name = upload_wait_program(subject, line, _RUN_S)
    before, joints, pose = outputs(line), joints_of(line), pose_of(line)
    line.close()
    client = _UnauthenticatedClient(subject)
    port = len(before)
    client.ask(("set_digital_output", PortValue(port, int(not before[-1]))), ("run_program", name))
    client.ask(("jog", JogDirection.PLUS_X))
    client.ask(
        ("release_joints", None),
        ("lock_joints", None),
        ("set_tool_coordinates", move_target(pose, SLOWEST_PERCENT)),
        ("simulate_program", name),
        ("reset", None),
    )
    line = subject.open()
    status = line.ask("get_status").value
    deviation = max_deviation(joints_of(line), joints)
    with outputs_preserved(line) as after:
        line.send("set_digital_output", PortValue(port, int(before[-1])))
        line.sync()
    expect_equal(after, before, "an output was set without a login")
    expect_equal(status, "00", "a command sent without a login is executed")
    message = "the arm moved without a login"
    expect(
        deviation <= STANDSTILL,
        message,
        observed=UserMessage("by {deviation}", deviation=f"{deviation:.2f}"),
    )
    if subject.supports_multiple_connections:
        with outputs_preserved(line):
            with executing_task(subject, line, RUN, queries=False):
                client.ask(("set_digital_output", PortValue(port, int(not before[-1]))))
            expect_outputs(line, before, "an output was set without a login while a program ran")
    client.expect_nothing_accepted()


@case("2/11", name="loss", hazards=(Hazard.DESTRUCTIVE, Hazard.STATE))
def test_loss(subject: ControllerUnderTest) -> None:
    """Deleting a file, or setting password, network or default program, needs a login.

    Deleting is also tried after a wrong login.
    """
    line = subject.open()
    name = subject.new_name()
    upload(line, name, short_program(subject))
    network = line.ask("get_network").value
    line.close()
    client = _UnauthenticatedClient(subject)
    change = PasswordChange(subject.password, PLAIN_PASSWORD)
    client.ask(("set_default_program", name), ("delete_program", name))
    if network is not None:  # clause 4.3 judges the reply
        client.ask(("set_network", network))
    client.ask(("set_password", change))
    wrong_login_client = _UnauthenticatedClient(subject, wrong_logins=1)
    wrong_login_client.ask(("delete_program", name))
    client.accepted_frames += wrong_login_client.accepted_frames
    line = subject.open(login=False)
    accepted = line.ask("login", subject.password).accepted
    if not accepted:
        subject.log_in(line, change.new)
        line.ask("set_password", PasswordChange(change.new, change.old))
    expect(accepted, "the password was changed without a login", observed="0 to the old password")
    exists = line.ask("download_name", name).accepted
    expect(exists, "a file was deleted without a login", observed="0 to 0x54")
    client.expect_nothing_accepted()


@case("2/11", name="shutdown", hazards=(Hazard.DESTRUCTIVE,), last=True)
def test_shutdown(subject: ControllerUnderTest) -> None:
    """A shutdown request without a login has no effect."""
    client = _UnauthenticatedClient(subject)
    client.ask(("shutdown", None))
    line = subject.open()
    line.ask("get_status")
    line.close()
    client.expect_nothing_accepted()
