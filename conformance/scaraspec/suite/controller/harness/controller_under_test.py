"""Subject: the controller under test, as the cases meet it.

It opens connections, knows what the subject claims and what was found out about it, and remembers
what has to be put right again. No requirement is judged here.
"""

import itertools
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from scaraspec.protocol.commands import BY_NAME, BY_OPCODE, RunningProgram
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.access import Access
from scaraspec.suite.controller.harness.guard import EVERYTHING, Guard
from scaraspec.suite.controller.harness.other_clients import OtherClients
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.own_files import OwnFiles, random_token
from scaraspec.suite.controller.harness.timeouts import ANSWERED, TimeoutPolicy
from scaraspec.suite.controller.harness.traits import ControllerTraits
from scaraspec.suite.engine.connection import Connection, ReceivedFrame, pump_all
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    Unreadable,
)
from scaraspec.suite.engine.hooks import HookError
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.system_under_test import StopFailure, ToleratedReading
from scaraspec.transports.link import Link, LinkError
from scaraspec.user_message import UserMessage

SILENCE_S: Final = 0.3
"""For how long silence is listened to where no fence can show it."""

MOMENT_S: Final = 0.1
"""For how long silence is listened to where a fence has shown it, too: for what comes late."""

_READY: Final = "00"  # L209: idle
_RECONNECTS: Final = 20
_RECONNECT_S: Final = 0.1  # within which it may not have seen yet that the last one left
_RETURN_S: Final = 30.0  # within which a crashed subject may restart by itself
_RETURN_POLL_S: Final = 1.0
_REFUSAL_S: Final = 0.05  # within which one that is not served is ended (A-2-2)
_FEW: Final = 2  # clients, beyond which a robot may serve no more
_REMEMBERED: Final = 8  # connections, that have ended
_POLL_S: Final = 0.05
_ALWAYS: Final = ("login",)
_DELETE, _RUNNING = "delete_program", "get_running_program"
_FILES_TOO: Final = ("login", _DELETE)  # of what the suite itself has stored
_REMEDIES: Final = ("lock_joints", "reset")  # of joints that were left loose; of all else

_MAX_WRONG_PASSWORDS: Final = 5


class ControllerUnderTest:
    """The controller under test.

    Args:
        access: The way to it.
        ics: What it claims.
        password: What opens it.
        observer: Watches everything.
        allowed: The hazards that the tester permits.
        journal: Where what the run may change is written down first.
        draw_token: Makes the token in the names of the run's files.
        say: Shows a sentence to the user at once.

    Attributes:
        dialect: The readings that it follows, as far as they were claimed or found out.
        tolerated: The listed readings that the running case has observed.
        moved: Motion may be under way.
        off: It was shut down, and has not come back.
        traits: What was detected once for the whole run.
        patience: How long to wait for what never came.
        unanswered: Commands that it never answered before the running case.
        files: Which files on the controller are the suite's own.
        others: What other clients do to it.
        guard: Checks every frame before it is sent.
        notices: What the reader of the results must know first.
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
    ) -> None:
        self.access, self.ics, self.password = access, ics, password
        self.observer, self.allowed = observer, allowed
        self.dialect = ics.dialect
        self.tolerated: list[ToleratedReading] = []
        self.detected_readings: dict[str, str] = {}
        self.traits = ControllerTraits()
        self.patience = TimeoutPolicy()
        self.unanswered: frozenset[str] = frozenset()
        self.survival_requirement = ANSWERED
        self.complaints = ""
        self.moved = False
        self.off = False
        self.notices: list[str] = []
        self._say = say
        self.journal = journal
        self.files = OwnFiles(journal, draw_token)
        self.others = OtherClients(self)
        self.guard = Guard(journal, self.files, password, ics.reply_s, self.others)
        self._lines: list[OutgoingConnection] = []
        self._left: list[OutgoingConnection] = []
        self._connections = itertools.count(1)

    # ------------------------------------------------------------------ time

    @property
    def now_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""
        return self.access.now_ns

    @property
    def reply_s(self) -> float:
        """For how long a reply is waited for."""
        return self.ics.reply_s

    @property
    def transfer_s(self) -> float:
        """After what silence it abandons a transfer."""
        return self.ics.transfer_s

    @property
    def longest_s(self) -> float:
        """For how long a final result is waited for."""
        return self.ics.motion.longest_s

    # ------------------------------------------------------------------ connections

    @property
    def stop_failure(self) -> StopFailure | None:
        """What is wrong with the emergency stop."""
        return self.guard.stop.failure

    def report_stop_failure(self, requirement: str, message: str) -> None:
        """A case has found that the emergency stop does not work."""
        self.guard.stop.fail(requirement, message, "", "")

    @property
    def withheld(self) -> str:
        """Why a request of the running case was not sent; empty if all were."""
        return self.guard.stop.withheld

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that forgets what is detected from now on.

        What has happened to the robot, such as a latched emergency stop, is not forgotten.
        """
        readings, dialect = dict(self.detected_readings), self.dialect
        traits, patience = self.traits.copy(), self.patience.copy()

        def restore() -> None:
            self.detected_readings, self.dialect = readings, dialect
            self.traits, self.patience = traits.with_history_of(self.traits), patience

        return restore

    def begin_case(self) -> None:
        """A case begins: nothing was tolerated or withheld in it."""
        self.tolerated.clear()
        self.guard.stop.withheld = ""

    @property
    def no_verdict_reason(self) -> str:
        """Nothing: whatever a case asks of a controller finds something out."""
        return ""

    def open(self, *, login: bool = True, judged: bool = True) -> OutgoingConnection:
        """Open a connection, and log in.

        Args:
            login: Whether to log in.
            judged: False for a connection that is to carry what is no protocol: bytes that are no
                frame make what follows them undecidable for the judge.

        Raises:
            CaseFailed: The login was refused.
            NoReply: The subject cannot be reached, or does not answer.
        """
        attempts = self._attempts(login=login)
        while True:
            line = self._open(judged=judged)
            attempts -= 1
            if login and self.access.needs_login:
                try:
                    self.log_in(line)
                except CaseFailed as error:
                    refused = isinstance(error, NoReply) and line.ending is not None
                    line.close()  # a connection that is not served takes no place
                    if not refused or not attempts:
                        raise
                    self.traits.closes_late = True
                else:
                    return line
            elif not attempts or line.ends(within_s=_REFUSAL_S) is None:
                return line
            self.access.pause(_RECONNECT_S)

    def _attempts(self, *, login: bool) -> int:
        """How often to come where one is sent away: a client that left may still have its place.

        Of a robot that is known to serve several, the places must be taken by who is there and who
        has just left, and once only: from then on its time is waited for.
        """
        if not self.access.detects_close:
            return 1
        there = sum(not line.ended for line in self._lines)
        if self._may_serve_one and not there:
            return _RECONNECTS
        since_ns = self.now_ns - round(_RECONNECT_S * 1e9)
        left = sum(line.closed_ns > since_ns for line in (*self._left, *self._lines))
        if not left or there + left < _FEW:
            return 1
        if self.traits.closes_late:
            self.pause(_RECONNECT_S)
            return 1
        return 2 if login else 1

    @property
    def _may_serve_one(self) -> bool:
        """Whether it serves one client at a time, or this is not known yet (A-2-2)."""
        known = {*self.detected_readings, *self.ics.claimed}
        return self.dialect["max_clients"] == "one" or "max_clients" not in known

    def _open(self, *, judged: bool) -> OutgoingConnection:
        attempts = 1 if self.off else _RECONNECTS  # who waits for it tries again by himself
        for attempt in range(attempts):
            try:
                link = self.access.connect()
            except LinkError as error:
                if attempt == attempts - 1:
                    raise NoReply(
                        UserMessage("the subject takes no connection: {error}", error=error)
                    ) from None
                self.access.pause(_RECONNECT_S)
                continue
            break
        line = OutgoingConnection(str(next(self._connections)), link, self, judged=judged)
        self._lines.append(line)
        return line

    def log_in(self, line: OutgoingConnection, password: bytes | None = None) -> ReceivedFrame:
        """Log in on a connection.

        Raises:
            CaseFailed: The subject refuses.
        """
        answer = line.ask("login", self.password if password is None else password)
        if not answer.accepted:
            raise CaseFailed(
                "the login was refused", expected="1", observed=f"{answer}", requirement="4.1/2"
            )
        self._overlook_greeting(line)
        return answer

    def _overlook_greeting(self, line: OutgoingConnection) -> None:
        """Drop what a subject sends unasked on every connection: the judge warns of it (A-3-16)."""
        if self.traits.greeting_opcodes is None:
            self.traits.greeting_opcodes = frozenset(seen.frame.opcode for seen in line.inbox)
        opcodes = self.traits.greeting_opcodes
        line.inbox[:] = [s for s in line.inbox if s.frame.tagged or s.frame.opcode not in opcodes]

    def pump_others(self, line: Connection, /) -> list[Link]:
        """Take what came on the other connections; give the links on which more may come."""
        return pump_all(self._lines, line)

    def close_lines(self) -> None:
        """End every connection."""
        for line in self._lines:
            line.close()
        self._left = [*self._left, *self._lines][-_REMEMBERED:]
        self._lines = []

    def pause(self, for_s: float) -> None:
        """Let time pass, listening on every connection."""
        for line in self._lines:
            if not line.closed and line.ending is None:
                line.wait(for_s)
                return
        self.access.pause(for_s)

    def is_case_about(self, requirement: str) -> bool:
        """Whether the running case is about this requirement."""
        case = self.observer.case
        return case == requirement or case.startswith(f"{requirement}.")

    # ------------------------------------------------------------------ what it can do

    def require_permitted(self, opcode: int) -> None:
        """Stop our own mistakes: no command is sent that the tester does not allow.

        Raises:
            RuntimeError: It is not allowed, and the case that would send it is not marked for it.
        """
        command = BY_OPCODE.get(opcode)
        ours = _FILES_TOO if Hazard.STATE in self.allowed else _ALWAYS
        if command and command.name not in ours and command.hazard not in self.allowed:
            raise RuntimeError(f"{command.name} is not allowed: the case is not marked for it")

    @property
    def supports_multiple_connections(self) -> bool:
        """Whether several connections can be open at once, and none displaces another."""
        many = self.dialect["max_clients"] == "many" and not self.traits.displaces_first_client
        return self.access.multiple_connections and many

    def require_multiple_connections(self) -> None:
        """Go on only where several connections can be open at once.

        Raises:
            CaseSkipped: They cannot.
        """
        if not self.access.multiple_connections:
            raise CaseSkipped("this link carries one connection at a time")
        if self.dialect["max_clients"] != "many":
            raise CaseSkipped("the subject serves one client at a time (max_clients)")
        if not self.supports_multiple_connections:
            raise CaseSkipped("the subject sends a client away when a further one comes (A-2-2)")

    def require_close_detection(self) -> None:
        """Go on only where the subject notices that a client is gone.

        Raises:
            CaseSkipped: It does not.
        """
        if not self.access.detects_close:
            raise CaseSkipped("this link ends without its subject's notice")

    def has_hook(self, name: str) -> bool:
        """Whether the statement of conformance names this hook."""
        return name in self.ics.hooks

    def hook(self, name: str, **values: object) -> None:
        """Handle the subject.

        Raises:
            CaseSkipped: The statement of conformance names no such hook.
            CaseInconclusive: The hook failed.
        """
        hook = self.ics.hooks.get(name)
        if hook is None:
            raise CaseSkipped(
                UserMessage(
                    "it needs the hook {name} in [hooks] of the statement of conformance", name=name
                )
            )
        self.guard.note_change(EVERYTHING)
        self.guard.stop.forget()
        try:
            hook.run(**values)
        except HookError as error:
            raise CaseInconclusive(str(error)) from None

    def notify(self, sentence: str) -> None:
        """Say what the user must know first, now and at the head of the results."""
        self.notices.append(sentence)
        self._say(sentence)

    def tolerate(self, requirement: str, key: str, option: str, message: str) -> None:
        """The subject follows a listed reading, or does what the register only warns of."""
        self.tolerated.append(ToleratedReading(requirement, key, option, message))

    def set_reading(self, key: str, option: str) -> None:
        """It was found out which reading the subject follows; from now on it is spoken to so."""
        self.detected_readings[key] = option
        self.dialect = self.dialect.replace(**{key: option})

    # ------------------------------------------------------------------ state

    @property
    def transfers_outlive(self) -> bool:
        """Whether a transfer goes on until its time-out when its connection ends (5.4/5)."""
        return not self.access.detects_close or bool(self.traits.transfers_outlive_connection)

    def note_accepted_stop(self) -> None:
        """An emergency stop was granted: perhaps the robot is latched (A-4.17-2)."""
        if self.traits.may_be_latched is None:
            self.traits.may_be_latched = True

    def may_try_wrong_password(self) -> bool:
        """Whether a sequence may try a wrong password: few do, so that the suite is not locked out.

        One in a run that may only change state, five where things may be lost (A-4.1-2).
        """
        tried = self.traits.wrong_passwords_tried
        self.traits.wrong_passwords_tried += 1
        return tried < (_MAX_WRONG_PASSWORDS if Hazard.DESTRUCTIVE in self.allowed else 1)

    def new_name(self, stem: str = "", *, lead: str = "") -> bytes:
        """A file name that is not in use.

        Args:
            stem: Follows its number.
            lead: Stands before its number, and ends with a letter: what many names begin with.
        """
        extension = {".txt": ".txt"}.get(self.dialect["prog_ext"], ".rob")
        return self.files.new_name(extension, stem, lead=lead)

    def wait_until_idle(self, line: OutgoingConnection, *, within_s: float | None = None) -> None:
        """Wait until the status is 00.

        Raises:
            Unreadable: It is none at all.
            CaseInconclusive: It does not become so.
        """
        full_s = self.patience.rest_timeout_s(self.longest_s) if within_s is None else within_s
        left_s = full_s
        while (status := line.ask("get_status").value) != _READY:
            if left_s <= 0:
                if within_s is None:
                    self.patience.note_rest(full_s, rests=False)
                if status is None:
                    raise Unreadable("what the subject tells of its status is no status")
                raise CaseInconclusive(
                    UserMessage(
                        "the subject's status stays {status} and does not become 00", status=status
                    )
                )
            line.wait(_POLL_S)
            left_s -= _POLL_S
        self.patience.note_rest(full_s - left_s, rests=True)

    def settle(self) -> None:
        """Bring the subject back to rest, and take away what the case has made.

        Raises:
            NoReply: It does not answer any more.
            CaseFailed: It refuses a login.
            Unreadable: Whether it has come to rest is unknown; it is not moved again.
            CaseInconclusive: It does not come to rest.
        """
        self.close_lines()
        self.unanswered = self.patience.unanswered()
        line = self.open()
        busy_and_deaf = self.moved and self.traits.unresponsive_while_executing
        status = None if busy_and_deaf else line.ask("get_status").value
        if self.moved and (status != _READY or self._runs_ours(line)):
            if line.ask("emergency_stop").accepted:
                with suppress(NoReply):  # what is missing the cases find
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
        """Delete what the case has stored, whole or not: there may be room for little (A-5-21).

        Raises:
            NoReply: It does not answer any more.
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

    def _runs_ours(self, line: OutgoingConnection) -> bool:
        """Whether it runs what a case has stored, though its status may say that it is idle."""
        if _RUNNING in self.ics.unsupported | self.unanswered:
            return False
        with suppress(NoReply):
            told = line.ask(_RUNNING).value
            return isinstance(told, RunningProgram) and told.name.startswith(self.files.prefix)
        return False

    def revive(self) -> None:
        """Restart it with the hook; without it, a watchdog of the device may restart it.

        Raises:
            CaseInconclusive: The hook failed.
        """
        self.close_lines()
        if self.has_hook("restart"):
            self.hook("restart")
            return
        deadline_ns = self.now_ns + round(_RETURN_S * 1e9)
        while self.now_ns < deadline_ns:
            try:
                self.open()
            except NoReply:
                self.pause(_RETURN_POLL_S)
            except CaseFailed:
                return  # it is there: asked over and over it may lock us out (A-4.1-2)
            else:
                return
