"""The controller under test, as the cases use it.

It opens connections, knows what the controller claims and what was detected, and knows what must
be restored. It judges no requirement.
"""

import itertools
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Final

from scaraspec.protocol.commands import BY_NAME, BY_OPCODE, RunningProgram
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.access import Access
from scaraspec.suite.controller.harness.guard import EVERYTHING, Guard
from scaraspec.suite.controller.harness.other_clients import OtherClients
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.own_files import OwnFiles, random_token
from scaraspec.suite.controller.harness.places import RECONNECT_S, Places
from scaraspec.suite.controller.harness.settling import Settling
from scaraspec.suite.controller.harness.state_lag import StateLag
from scaraspec.suite.controller.harness.timeouts import ANSWERED, TimeoutPolicy
from scaraspec.suite.controller.harness.traits import ControllerTraits
from scaraspec.suite.engine.connection import Connection, ReceivedFrame, pump_all
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    HookMissing,
    NoReply,
    NotConnected,
    Unreadable,
)
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.operator import HookRunner, Operator
from scaraspec.suite.engine.system_under_test import StopFailure, ToleratedReading
from scaraspec.transports.link import Link, LinkError
from scaraspec.user_message import UserMessage

SILENCE_S: Final = 0.3
"""How long the suite waits, in seconds, before it concludes that nothing is sent."""

MOMENT_S: Final = 0.1
"""How long the suite waits for late frames, in seconds, after `sync` has shown that none is due."""

_READY: Final = "00"  # L209: idle
_RECONNECTS: Final = 20
_RETURN_S: Final = 30.0  # a crashed controller may restart by itself within this time
_RETURN_POLL_S: Final = 1.0
_REFUSAL_S: Final = 0.05  # a connection that is not served is closed within this time (A-2-2)
_CLOSED_LINES: Final = 8  # how many closed connections are remembered
_ALWAYS: Final = ("login",)
_DELETE, _RUNNING = "delete_program", "get_running_program"
_ALWAYS_WITH_STATE: Final = ("login", _DELETE)  # to delete the files of the suite
_REMEDIES: Final = ("lock_joints", "reset")  # for released joints; for everything else

_MAX_WRONG_PASSWORDS: Final = 5


class ControllerUnderTest:
    """The controller under test.

    Args:
        access: The access to the controller.
        ics: Its implementation conformance statement.
        password: Its password.
        observer: Observes the traffic.
        allowed: The hazards that the user allows.
        journal: Records what the run may change, before it is changed.
        draw_token: Creates the token in the names of the run's files.
        say: Shows a sentence to the user at once.
        operator: Replaces hooks that the ICS does not define; None without an operator.

    Attributes:
        dialect: The readings that it follows: claimed, detected, or the defaults.
        tolerated: The listed readings that the running case has observed.
        moved: A motion may be in progress.
        off: It was shut down and has not come back.
        traits: What was detected once for the whole run.
        timeout_policy: The timeouts for replies that have never come.
        lag: How much later than the state its replies report it.
        settling: How long it is busy after a final result.
        places: Knows when it may refuse a client because another one has just left.
        unanswered: The commands that it never answered before the running case.
        files: The files on the controller that the suite has created.
        others: Detects other clients.
        guard: Checks every frame before it is sent.
        hooks: Operates it with the hooks of the ICS, or asks the operator.
        notices: Sentences at the head of the results.
    """

    def __init__(  # noqa: PLR0913 - the collaborators of a run
        self,
        access: Access,
        ics: Ics,
        password: bytes,
        observer: Observer,
        allowed: frozenset[Hazard],
        *,
        journal: Journal,
        draw_token: Callable[[], str] = random_token,
        say: Callable[[str], None] = lambda _: None,
        operator: Operator | None = None,
    ) -> None:
        self.access, self.ics, self.password = access, ics, password
        self.observer, self.allowed = observer, allowed
        self.dialect = ics.dialect
        self.tolerated: list[ToleratedReading] = []
        self.detected_readings: dict[str, str] = {}
        self.served: dict[str, bool] = {}
        self.traits = ControllerTraits()
        self.timeout_policy = TimeoutPolicy()
        self.lag = StateLag()
        self.settling = Settling()
        self.places = Places(self)
        self.unanswered: frozenset[str] = frozenset()
        self.survival_requirement = ANSWERED
        self.complaints = ""
        self.moved = False
        self.off = False
        self.notices: list[str] = []
        self._say = say
        self.hooks = HookRunner(ics, operator, observer, lambda: self.now_ns, self.pause)
        self.journal = journal
        self.files = OwnFiles(journal, draw_token)
        self.others = OtherClients(self)
        self.guard = Guard(journal, self.files, password, ics.reply_s, self.others)
        self._lines: list[OutgoingConnection] = []
        self._closed_lines: list[OutgoingConnection] = []
        self._connections = itertools.count(1)

    # ------------------------------------------------------------------ time

    @property
    def now_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""
        return self.access.now_ns

    @property
    def reply_s(self) -> float:
        """The reply timeout in seconds."""
        return self.ics.reply_s

    @property
    def transfer_s(self) -> float:
        """The silence after which it aborts a transfer, in seconds."""
        return self.ics.transfer_s

    @property
    def longest_s(self) -> float:
        """The timeout for a final result, in seconds: not less than the reply timeout."""
        return max(self.ics.motion.longest_s / max(self.ics.time_scale, 1.0), self.reply_s)

    # ------------------------------------------------------------------ connections

    @property
    def stop_failure(self) -> StopFailure | None:
        """The failure of the emergency stop; None if none was observed."""
        return self.guard.stop.failure

    def report_stop_failure(self, requirement: str, message: str) -> None:
        """Note that a case has shown that the emergency stop does not work."""
        self.guard.stop.fail(requirement, message, "", "")

    @property
    def withheld(self) -> str:
        """Why a request of the running case was not sent; empty if all were sent."""
        return self.guard.stop.withheld

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that forgets what is detected from now on.

        What has happened to the robot, such as a latched emergency stop, is not forgotten.
        """
        readings, dialect = dict(self.detected_readings), self.dialect
        traits, timeout_policy = self.traits.copy(), self.timeout_policy.copy()

        def restore() -> None:
            self.detected_readings, self.dialect = readings, dialect
            self.traits, self.timeout_policy = traits.with_history_of(self.traits), timeout_policy

        return restore

    def begin_case(self) -> None:
        """Reset the tolerated readings and the withheld requests for the next case."""
        self.tolerated.clear()
        self.guard.stop.withheld = ""

    @property
    def no_verdict_reason(self) -> str:
        """Empty: a case that raises nothing has a verdict."""
        return ""

    def open(
        self, *, login: bool = True, password: bytes | None = None, judged: bool = True
    ) -> OutgoingConnection:
        """Open a connection, and log in.

        Args:
            login: Whether to log in.
            password: The password; None for the one of the run.
            judged: False for a connection that will carry invalid bytes: the judge cannot decide
                about the bytes after them.

        Raises:
            CaseFailed: The login was refused.
            NoReply: The controller cannot be reached, or does not answer.
        """
        until_ns = self.places.may_refuse_until_ns(self._recent_lines, login=login)
        refusals: list[NoReply] = []
        while True:
            line = self._open(judged=judged)
            refusal = self._refusal(line, password, login=login, retries=until_ns > 0)
            if refusal is None:
                if refusals:
                    self.places.note_refusals(self._recent_lines, refusals)
                return line
            if self.now_ns >= until_ns:
                if login:
                    raise refusal
                return line
            refusals.append(refusal)
            self._lines.remove(line)  # a connection that is not served takes no place
            self.access.pause(RECONNECT_S)

    def _refusal(
        self, line: OutgoingConnection, password: bytes | None, *, login: bool, retries: bool
    ) -> NoReply | None:
        """Log in; return the error if it closes the connection instead, as without a free place."""
        if login and self.access.needs_login:
            try:
                self.log_in(line, password)
            except CaseFailed as error:
                line.close()
                if not isinstance(error, NoReply) or line.ending is None:
                    raise
                return error
        elif retries and line.ends(within_s=_REFUSAL_S) is not None:
            return NotConnected("the subject closes the connection")
        return None

    @property
    def _recent_lines(self) -> list[OutgoingConnection]:
        return [*self._closed_lines, *self._lines]

    def _open(self, *, judged: bool) -> OutgoingConnection:
        attempts = 1 if self.off else _RECONNECTS  # the caller retries
        for attempt in range(attempts):
            try:
                link = self.access.connect()
            except LinkError as error:
                if attempt == attempts - 1:
                    raise NotConnected(
                        UserMessage("the subject accepts no connection: {error}", error=error)
                    ) from None
                self.access.pause(RECONNECT_S)
                continue
            break
        line = OutgoingConnection(str(next(self._connections)), link, self, judged=judged)
        self._lines.append(line)
        return line

    def log_in(self, line: OutgoingConnection, password: bytes | None = None) -> ReceivedFrame:
        """Log in on a connection.

        Raises:
            CaseFailed: The controller refuses the login.
        """
        answer = line.ask("login", self.password if password is None else password)
        if not answer.accepted:
            raise CaseFailed(
                "the login was refused", expected="1", observed=f"{answer}", requirement="4.1/2"
            )
        self._drop_greeting(line)
        return answer

    def _drop_greeting(self, line: OutgoingConnection) -> None:
        """Drop unsolicited frames that every connection begins with: the judge warns (A-3-16)."""
        if self.traits.greeting_opcodes is None:
            self.traits.greeting_opcodes = frozenset(seen.frame.opcode for seen in line.inbox)
        opcodes = self.traits.greeting_opcodes
        line.inbox[:] = [s for s in line.inbox if s.frame.tagged or s.frame.opcode not in opcodes]

    def pump_others(self, line: Connection, /) -> list[Link]:
        """Receive on the other connections. Return the links that may receive more."""
        return pump_all(self._lines, line)

    def close_lines(self) -> None:
        """Close every connection."""
        for line in self._lines:
            line.close()
        self._closed_lines = [*self._closed_lines, *self._lines][-_CLOSED_LINES:]
        self._lines = []

    def pause(self, for_s: float) -> None:
        """Wait for a time, in seconds, and keep receiving on every connection."""
        for line in self._lines:
            if not line.closed and line.ending is None:
                line.wait(for_s)
                return
        self.access.pause(for_s)

    def is_case_about(self, requirement: str) -> bool:
        """Whether this is the first requirement of the running case."""
        case = self.observer.case
        return case == requirement or case.startswith(f"{requirement}.")

    # ------------------------------------------------------------------ what it can do

    def require_permitted(self, opcode: int) -> None:
        """Raise an error if the user has not allowed the hazard of a command.

        Raises:
            RuntimeError: The suite is defective: the case does not declare the hazard.
        """
        command = BY_OPCODE.get(opcode)
        always = _ALWAYS_WITH_STATE if Hazard.STATE in self.allowed else _ALWAYS
        if command and command.name not in always and command.hazard not in self.allowed:
            raise RuntimeError(
                f"{command.name} is not allowed: the case does not declare its hazard"
            )

    @property
    def supports_multiple_connections(self) -> bool:
        """Whether several clients can be served at once, each like the only one."""
        equal = not (self.traits.displaces_first_client or self.traits.only_first_client_commands)
        return self.access.multiple_connections and self.dialect["max_clients"] == "many" and equal

    def require_multiple_connections(self) -> None:
        """Require that several clients can be served at once, each like the only one.

        Raises:
            CaseSkipped: Only one client is served, or only one may command.
        """
        if not self.access.multiple_connections:
            raise CaseSkipped("this link carries one connection at a time")
        if self.dialect["max_clients"] != "many":
            raise CaseSkipped("the subject serves one client at a time (max_clients)")
        if self.traits.only_first_client_commands:
            raise CaseSkipped("the subject accepts commands only of its first client (A-2-2)")
        if not self.supports_multiple_connections:
            raise CaseSkipped("the subject closes a connection when another one opens (A-2-2)")

    def require_close_detection(self) -> None:
        """Require that the controller notices the end of a connection.

        Raises:
            CaseSkipped: The controller does not notice it.
        """
        if not self.access.detects_close:
            raise CaseSkipped("the subject does not notice the end of this link")

    def has_hook(self, name: str) -> bool:
        """Whether the ICS names this hook, or an operator replaces it in the running case."""
        return self.hooks.has(name)

    def hook(self, name: str, **values: object) -> None:
        """Run a hook.

        Raises:
            HookMissing: The ICS does not name this hook, and no operator replaces it.
            CaseInconclusive: The hook failed.
        """
        self.hook_each(name, values)

    def hook_each(self, name: str, *each: Mapping[str, object]) -> None:
        """Run a hook once for each set of values; see `hook`. An operator is asked once."""
        self.guard.note_change(EVERYTHING)
        self.guard.stop.forget()
        alive = [line for line in self._lines if line.ending is None]
        self.hooks.run(name, *each)
        if self.hooks.asks(name) and any(line.ending is not None for line in alive):
            raise CaseInconclusive("a connection ended during a request to the operator")
        self.lag.changed(self.now_ns)

    def notify(self, sentence: str) -> None:
        """Show a sentence to the user now and at the head of the results."""
        self.notices.append(sentence)
        self._say(sentence)

    def tolerate(self, requirement: str, key: str, option: str, message: str) -> None:
        """Note that the controller follows a listed reading, or causes only a warning."""
        self.tolerated.append(ToleratedReading(requirement, key, option, message))

    def set_reading(self, key: str, option: str) -> None:
        """Note a detected reading. The suite uses it from now on."""
        self.detected_readings[key] = option
        self.dialect = self.dialect.replace(**{key: option})

    # ------------------------------------------------------------------ state

    @property
    def transfers_outlive(self) -> bool:
        """Whether a transfer continues until its timeout when its connection ends (5.4/5)."""
        return not self.access.detects_close or bool(self.traits.transfers_outlive_connection)

    @property
    def may_transfer(self) -> bool:
        """Whether a file transfer may be active on a connection."""
        return any(line.may_transfer for line in self._lines)

    def note_accepted_stop(self) -> None:
        """Note that an emergency stop was accepted and may have latched the robot (A-4.17-2)."""
        if self.traits.may_be_latched is None:
            self.traits.may_be_latched = True

    def may_try_wrong_password(self) -> bool:
        """Count a wrong password of a sequence. Return whether it may be tried.

        The number is limited because the controller may lock the suite out (A-4.1-2): one attempt
        per run, five if destructive cases are allowed.
        """
        tried = self.traits.wrong_passwords_tried
        self.traits.wrong_passwords_tried += 1
        return tried < (_MAX_WRONG_PASSWORDS if Hazard.DESTRUCTIVE in self.allowed else 1)

    def new_name(self, stem: str = "", *, lead: str = "") -> bytes:
        """Return a file name that is not in use.

        Args:
            stem: The text after the number.
            lead: The text before the number; ends with a letter.
        """
        extension = {".txt": ".txt"}.get(self.dialect["prog_ext"], ".rob")
        return self.files.new_name(extension, stem, lead=lead)

    def wait_until_idle(self, line: OutgoingConnection, *, within_s: float | None = None) -> None:
        """Wait until the status is 00.

        Raises:
            Unreadable: The reply contains no status.
            CaseInconclusive: The status does not become 00 in time.
        """
        full_s = (
            self.timeout_policy.rest_timeout_s(self.longest_s) if within_s is None else within_s
        )
        deadline = Deadline(self, full_s)
        while (status := line.ask("get_status").value) != _READY:
            if deadline.expired:
                if within_s is None:
                    self.timeout_policy.note_rest(full_s, rests=False)
                if status is None:
                    raise Unreadable("the reply of the subject to get_status contains no status")
                raise CaseInconclusive(
                    UserMessage(
                        "the subject's status stays {status} and does not become 00", status=status
                    )
                )
            line.wait(deadline.poll_s)
        self.timeout_policy.note_rest(full_s - deadline.remaining_s, rests=True)

    def settle(self) -> None:
        """Bring the robot to rest and delete the files of the case.

        Raises:
            NoReply: The controller does not answer any more.
            CaseFailed: The controller refuses a login.
            Unreadable: It is unknown whether the robot is at rest; it is not moved again.
            CaseInconclusive: The robot does not come to rest.
        """
        self.close_lines()
        self.unanswered = self.timeout_policy.unanswered()
        line = self.open()
        unresponsive = self.moved and self.traits.unresponsive_while_executing
        status = None if unresponsive else line.ask("get_status").value
        if self.moved and (status != _READY or self._runs_own_program(line)):
            if line.ask("emergency_stop").accepted:
                with suppress(NoReply):  # the cases check for a missing result
                    line.result("emergency_stop", within_s=self.reply_s)
            for remedy in _REMEDIES:
                if line.ask("get_status").value == _READY:
                    break
                if self.guard.stop.withholds(BY_NAME[remedy].opcode):
                    continue
                if remedy not in self.ics.unsupported and line.ask(remedy).accepted:
                    with suppress(NoReply):
                        line.result(remedy, within_s=self.reply_s)
        if self.moved:
            try:
                self.wait_until_idle(line)
            except Unreadable:
                self.moved = False
                raise
        self.delete_own_files(line)
        self.moved = False
        if self.journal.changes.motion:
            self.journal.confirm("rest")
        self.close_lines()

    def delete_own_files(self, line: OutgoingConnection) -> None:
        """Delete the complete and incomplete files of the case: space may be scarce (A-5-21).

        Raises:
            NoReply: The controller does not answer any more.
        """
        if Hazard.STATE not in self.allowed or _DELETE in self.unanswered:
            return
        try:
            for name in reversed(self.files.stored):
                line.ask(_DELETE, data=name)
                self.files.note_deleted(name)
        except NoReply as error:
            error.requirement = ANSWERED
            raise

    def _runs_own_program(self, line: OutgoingConnection) -> bool:
        """Whether it runs a program of the suite, although its status may be idle."""
        if _RUNNING in self.ics.unsupported | self.unanswered:
            return False
        with suppress(NoReply):
            running = line.ask(_RUNNING).value
            return isinstance(running, RunningProgram) and running.name.startswith(
                self.files.prefix
            )
        return False

    def revive(self) -> None:
        """Restart it with the hook or by the operator, or wait for a watchdog of the device.

        Raises:
            CaseInconclusive: The hook failed.
        """
        self.close_lines()
        if "restart" in self.ics.hooks:
            self.hook("restart")
            return
        with suppress(HookMissing):  # skipped
            if self.hooks.ask("restart", {}):
                return
        deadline = Deadline(self, _RETURN_S)
        while not deadline.expired:
            try:
                self.open()
            except NoReply:
                self.pause(_RETURN_POLL_S)
            except CaseFailed:
                return  # it responds; further logins may lock the suite out (A-4.1-2)
            else:
                return
