"""Subject: the client under test, as the cases meet it.

It is ordered about, connects to us, and says what came of its operations. No requirement is judged
here but by the checks that cases call.
"""

import itertools
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.suite.client.harness.access import Access
from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.driver import DriverEndedError, DriverError
from scaraspec.suite.client.harness.driver_values import matches, to_display_text
from scaraspec.suite.client.harness.incoming_connection import PASSWORD, IncomingConnection
from scaraspec.suite.engine.connection import Connection, pump
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    OperationRefused,
    expect,
)
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.system_under_test import Interference
from scaraspec.traffic.events import FrameSeen
from scaraspec.transports.link import Link
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.protocol.frames import Frame

_SILENCE_S: Final = 0.3
_SLICE_S: Final = 0.02  # for how long a connection may wait while others speak
_CONCURRENT_S: Final = 2.0
_DECLINED: Final = "declined"
_TRANSFERS: Final = frozenset({"upload", "download"})
_TWICE: Final = 2
_IDLE: Final = "00"
_SHORT_WAIT_S: Final = 1.0
_IMMEDIATE_S: Final = 4.0  # who waits for a reply in vain gives up after 5 s (A-3-15)


class ClientUnderTest:
    """The client under test.

    Args:
        access: The way to it.
        ics: What it claims.
        observer: Watches everything.

    Attributes:
        dialect: The readings that we speak to it.
        tolerated: What the running case saw of listed readings: requirement, key, option, sentence.
        found: The readings that were found out, by key.
        known: What cases found out once for all of the run, by a name of their own.
        idle: What it says of an idle robot; anything but 00 has failed, and stands for it since.
        polled: The requests that it has sent of its own accord.
        survival: No requirement of its own: see `party.SystemUnderTest`.
        off: Never: a client stays.
    """

    def __init__(self, access: Access, ics: Ics, observer: Observer) -> None:
        self.access, self.ics, self.observer = access, ics, observer
        self.dialect = ics.dialect
        self.tolerated: list[tuple[str, str, str, str]] = []
        self.found: dict[str, str] = {}
        self.discoveries: dict[str, Any] = {}
        self.idle_status: Any = None
        self.polled: set[Frame] = set()
        self.survival = ""
        self.off = False
        self.notices: list[str] = []
        self.others = Interference()
        self._lines: list[IncomingConnection] = []
        self._connections = itertools.count(1)
        self._files = itertools.count(1)
        self._expected: Call | None = None
        self._was_connected = False
        self._calls: list[Call] = []
        self._silences: Counter[str] = Counter()

    # ------------------------------------------------------------------ time

    @property
    def now_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""
        return self.access.now_ns

    @property
    def complaints(self) -> str:
        """The end of what its driver wrote to stderr."""
        return self.access.complaints

    @property
    def answer_timeout_s(self) -> float:
        """For how long it may think about an order."""
        return self.access.answer_timeout_s

    @property
    def silence_s(self) -> float:
        """For how long silence is listened to."""
        return _SILENCE_S

    @property
    def transfer_s(self) -> float:
        """After what silence it abandons a transfer (5.4, L795)."""
        return self.ics.transfer_s

    def pause(self, for_s: float) -> None:
        """Let time pass, listening to everything."""
        deadline_s = self.access.now_s + for_s
        while (remaining_s := deadline_s - self.access.now_s) > 0:
            line = self._open_line()
            if line is None:
                self._wait(deadline_s)
            else:
                line.wait(remaining_s)

    # ------------------------------------------------------------------ connections

    def open(self, *, judged: bool = True, requirement: str = "") -> IncomingConnection:
        """Let it connect and log in.

        Args:
            judged: False for a connection that is to carry what is no protocol.
            requirement: What it violates if it says that a login that was granted has failed.

        Raises:
            CaseFailed: It does not.
            CaseInconclusive: It waits on a further connection.
            CaseSkipped: It cannot.
        """
        if self.access.attended:
            if (kept := self._open_line()) and kept.auto_responder.at_rest:
                kept.inbox.clear()
                kept.auto_responder.renew()
                return kept
            self.close_lines()  # a case was skipped in the midst of something
        line, call = self.begin_connect(judged=judged)
        try:
            line.log_in(call)
        except NoReply:
            if (other := self._next(line, judged=judged)) is None:
                raise
            line = other
            line.log_in(call)
        try:
            self.expect_done(call, requirement=requirement)
        except CaseFailed:
            self.require_single_connection()
            raise
        self._calls.remove(call)  # it is none of the case
        return line

    def begin_connect(
        self, *, judged: bool = True, **values: Any
    ) -> tuple[IncomingConnection, Call]:
        """Let it connect, up to the connection itself.

        Args:
            judged: False for a connection that is to carry what is no protocol.
            values: What to order in place of our address and the password; None leaves one out.

        Returns:
            The connection, and the order that its login will settle.

        Raises:
            CaseFailed: It does not.
            CaseSkipped: It cannot.
        """
        if self._was_connected:  # it need not know yet that we have ended the one before
            self._disconnect()
        while self._close_extra_connection(self.access.now_s):
            pass
        arguments = {
            "host": self.access.host,
            "port": self.access.port,
            "password": PASSWORD.decode(),
        }
        arguments = {k: v for k, v in (arguments | values).items() if v is not None}
        call = self.begin("connect", **arguments)
        deadline_s = self.access.now_s + self.answer_timeout_s
        with self.expecting(call):
            while (link := self.access.accept(self._slice(deadline_s))) is None:
                self._pump_all()
                if self.access.now_s >= deadline_s:
                    if self.access.attended:
                        raise CaseSkipped(
                            UserMessage(
                                "the operator did not do it in {answer_timeout_s:g} s",
                                answer_timeout_s=self.answer_timeout_s,
                            )
                        )
                    raise NoReply("connect was ordered, and no connection came")
        return self._connected(link, judged=judged), call

    def _connected(self, link: Link, *, judged: bool) -> IncomingConnection:
        line = IncomingConnection(str(next(self._connections)), link, self, judged=judged)
        self._lines.append(line)
        return line

    def _next(self, line: IncomingConnection, *, judged: bool) -> IncomingConnection | None:
        """Another connection, if one follows on one that was only to show that somebody listens."""
        silent = line.over and not (line.inbox or line.invalid_bytes)
        link = self.access.accept(self.access.now_s + _SHORT_WAIT_S) if silent else None
        return None if link is None else self._connected(link, judged=judged)

    def require_single_connection(self) -> None:
        """Go on only where it has opened no further connection: but one is served (A-2-2).

        Raises:
            CaseInconclusive: What is missing may be there.
        """
        if self._close_extra_connection(self.access.now_s):
            raise CaseInconclusive(
                "the client has opened a further connection; one is served (A-2-2)"
            )

    def _open_line(self) -> IncomingConnection | None:
        return next((line for line in self._lines if not line.over), None)

    def pump_others(self, line: Connection, /) -> list[Link]:
        """Take what came elsewhere; give the links on which more may come."""
        self._pump()
        return pump(self._lines, line)

    def close_lines(self) -> None:
        """End every connection."""
        for line in self._lines:
            line.close()
        self._lines.clear()

    # ------------------------------------------------------------------ orders

    def begin(self, name: str, /, **values: Any) -> Call:
        """Order an operation, named and given its values as in the driver protocol.

        Raises:
            CaseFailed: The client has crashed.
            CaseInconclusive: Its driver does not keep to its protocol.
        """
        with _driver_errors():
            call = self.access.begin(name, **values)
        call.begun_ns = self.now_ns
        if name in ("connect", "disconnect"):
            self._was_connected = name == "connect"
        self._calls.append(call)
        return call

    @contextmanager
    def allow_refusal(self) -> Iterator[None]:
        """Order what it may decline by itself, at once: the rest is left out, and that is told."""
        try:
            yield
        except OperationRefused as refusal:
            if refusal.after_s > _IMMEDIATE_S and not self.access.attended:
                raise
            self.tolerate("", _DECLINED, refusal.observed, str(refusal))

    @property
    def stop_failure(self) -> None:
        """Nothing: a client has no emergency stop."""
        return

    @property
    def withheld(self) -> str:
        """Nothing: whatever a case sends is sent."""
        return ""

    def stop_has_failed(self, requirement: str, message: str) -> None:
        """Nothing: a client has no emergency stop."""

    def notify(self, sentence: str) -> None:
        """Say what the reader of the results must know first."""
        self.notices.append(sentence)

    def begin_case(self) -> None:
        """A case begins: nothing was tolerated in it."""
        self.tolerated.clear()

    @property
    def untried(self) -> str:
        """Why the running case has found out nothing: whatever it ordered was declined."""
        declined = any(key == _DECLINED for _, key, _, _ in self.tolerated)
        if not declined or any(call.request_seen for call in self._calls):
            return ""
        return "the client declines by itself whatever is ordered here"

    @property
    def programs(self) -> dict[bytes, bool]:
        """The programs that orders in hand are about, and whether the controller has them."""
        had = {}
        for call in self._calls:
            name = call.values.get("remote") or call.values.get("name")
            if name and call.answer is None:
                brought = call.request_seen or call.name != "upload"
                deleted = call.request_seen and call.name == "delete_program"
                had[name.encode(errors="surrogateescape")] = brought and not deleted
        return had

    def is_expected(self, seen: FrameSeen) -> bool:
        """Whether this may be the request of an order whose own has not come yet."""
        return any(
            call.name == seen.name
            and not call.request_seen
            and not call.failed
            and not self.is_repeated_poll(seen, call)
            for call in self._calls
        )

    def is_repeated_poll(self, seen: FrameSeen, call: Call | None) -> bool:
        """Whether this asks what the client has asked by itself before, and not what was ordered.

        Such are polls of one port while another one is ordered.
        """
        return (
            call is not None
            and bool(call.values)
            and seen.frame in self.polled
            and seen.value not in call.values.values()
        )

    def note_request(self, name: str, call: Call | None) -> None:
        """The request of this order has come, or else of the oldest one of this name."""
        waiting = (each for each in self._calls if each.name == name and not each.request_seen)
        call = call or next(waiting, None)
        if call is not None:
            call.request_seen = True

    @contextmanager
    def expecting(self, call: Call | None) -> Iterator[None]:
        """As long as this lasts, an answer to that order comes too early."""
        self._expected = call
        try:
            yield
        finally:
            self._expected = None

    def wait_for_answer(self, call: Call, *, within_s: float | None = None) -> Call:
        """Wait for what it says of an order.

        Where it was silent twice in a row about such orders it is not waited for so long again.

        Raises:
            CaseFailed: It says nothing, or has crashed.
            CaseSkipped: It lacks the operation.
        """
        limit_s = full_s = self.answer_timeout_s if within_s is None else within_s
        if self._silences[call.name] >= _TWICE and not self.access.attended:
            limit_s = min(full_s, _SHORT_WAIT_S)
        if not self.answers_within(call, limit_s):
            self._silences[call.name] += full_s >= self.answer_timeout_s
            raise CaseFailed(
                UserMessage(
                    "the client does not say in {limit_s:g} s what came of {call}",
                    limit_s=limit_s,
                    call=call.name,
                ),
                expected="an answer of its driver",
                observed=self._describe_silence(),
            )
        if call.ok:
            self._silences[call.name] = 0
        _require_implemented(call)
        return call

    def _describe_silence(self) -> str:
        """What there is in place of an answer, and what it may wait for that nobody ordered."""
        unserved = (seen for line in self._lines for seen in line.inbox)
        sent = dict.fromkeys(seen.name or f"{seen.frame}" for seen in unserved)
        return f"silence; it has sent by itself {', '.join(sent)}" if sent else "silence"

    def answers_within(self, call: Call, within_s: float) -> bool:
        """Wait for what it says of an order; whether it says anything.

        Raises:
            CaseFailed: It has crashed.
        """
        deadline_s = self.access.now_s + within_s
        while not self._answered(call):
            if self.access.now_s >= deadline_s:
                return False
            if call.name == "disconnect":
                self._close_extra_connection(
                    deadline_s
                )  # who connects by himself first would wait there
            else:
                self._wait(deadline_s)
        return True

    def _answered(self, call: Call) -> bool:
        """Take what has come; whether the order has been answered."""
        self._pump_all()
        return call.answer is not None

    def _pump_all(self) -> None:
        for line in self._lines:
            line.pump()
        self._pump()

    def _wait(self, deadline_s: float) -> None:
        with _driver_errors():
            self.access.wait(self._slice(deadline_s))
        self._pump()

    def _slice(self, deadline_s: float) -> float:
        """Until when to wait for something else than what may come on an open connection."""
        if self._open_line() is None:
            return deadline_s
        return min(deadline_s, self.access.now_s + _SLICE_S)

    def _pump(self) -> None:
        with _driver_errors():
            self.access.pump()
        call = self._expected
        if call is not None and call.answer is not None:
            _require_implemented(call)
            if call.failed and not call.request_seen:
                message = UserMessage("the client declines {call} by itself", call=call.name)
                raise OperationRefused(message, expected="it is sent", observed=f"{call}")
            if call.failed:
                self.require_timely(call)
            raise CaseFailed(
                UserMessage("the client says that {call} is over before it can be", call=call.name),
                expected="the operation goes on",
                observed=f"{call}",
            )

    def require_timely(self, call: Call) -> None:
        """Hold no transfer against it that was given up because this machine was too slow.

        Raises:
            CaseInconclusive: So it may have been.
        """
        if call.name in _TRANSFERS:
            for line in self._lines:
                line.require_timely(call.begun_ns)

    # ------------------------------------------------------------------ what it says

    def confirm_with_operator(self, sentence: str, call: Call | None = None) -> bool | None:
        """Whether an operator says that the client shows this; None where nobody is asked.

        Args:
            sentence: What it should show.
            call: The order in question; nobody is asked about one that has been answered.
        """
        if call is not None and call.answer is not None:
            return None
        question = self.access.ask_operator(sentence)
        if question is None:
            return None
        while not self.answers_within(question, self.answer_timeout_s):
            pass  # he may be away
        return question.ok

    def expect_done(
        self, call: Call, *, requirement: str = "", within_s: float | None = None
    ) -> Any:
        """What came of an order, which has to have been done.

        Raises:
            CaseFailed: The client says that it was not, or says nothing.
        """
        confirmed = self.confirm_with_operator(UserMessage("{call} was done", call=call.name), call)
        if confirmed is None:
            confirmed = self.wait_for_answer(call, within_s=within_s).ok
        if not confirmed:
            self.require_timely(call)
            raise CaseFailed(
                UserMessage(
                    "{call} was answered well, and the client says that it failed", call=call.name
                ),
                expected="done",
                observed=f"{call}",
                requirement=requirement,
            )
        return call.result

    def expect_result(self, call: Call, expected: Any, *, requirement: str = "") -> None:
        """What came of an order has to be this.

        Raises:
            CaseFailed: It is something else.
        """
        confirmed = self.confirm_with_operator(
            UserMessage(
                "{call} gave {expected}", call=call.name, expected=to_display_text(expected)
            ),
            call,
        )
        if confirmed is None:
            result = self.expect_done(call, requirement=requirement)
            known = self.idle_status is not None and (call.name, expected) == ("get_status", _IDLE)
            expect(
                matches(result, expected) or (known and matches(result, self.idle_status)),
                UserMessage("what the client says of {call}", call=call.name),
                expected=f"{expected}",
                observed=f"{result}",
                requirement=requirement,
            )
        elif not confirmed:
            raise CaseFailed(
                UserMessage("the client does not show what came of {call}", call=call.name),
                expected=f"{expected}",
                observed="something else",
                requirement=requirement,
            )

    def expect_failure(
        self, call: Call, *, requirement: str = "", within_s: float | None = None
    ) -> None:
        """An order has to have failed; of a two-stage one a refusal or a bad outcome will do.

        Raises:
            CaseFailed: The client says that it was done, or says nothing.
        """
        failed = self.confirm_with_operator(UserMessage("{call} failed", call=call.name), call)
        if failed is None:
            self.wait_for_answer(call, within_s=within_s)
            failed = call.failed
        if not failed:
            raise CaseFailed(
                UserMessage("{call} failed, and the client says that it was done", call=call.name),
                expected="an error",
                observed=f"{call}",
                requirement=requirement,
            )

    def expect_pending(self, call: Call, message: str, *, requirement: str = "") -> None:
        """An order must not be over yet.

        Raises:
            CaseFailed: The client says that it is.
        """
        self._pump()
        if call.answer is not None:
            _require_implemented(call)
            raise CaseFailed(
                message, expected="no answer yet", observed=f"{call}", requirement=requirement
            )

    def tolerate(self, requirement: str, key: str, option: str, message: str) -> None:
        """The client follows a listed reading, or does what the register only warns of."""
        self.tolerated.append((requirement, key, option, message))

    # ------------------------------------------------------------------ what it can do

    def require_concurrency(self, line: IncomingConnection) -> None:
        """Go on only where it does a second thing while a first one lasts.

        Raises:
            CaseSkipped: It, or its driver, does one thing at a time.
        """
        if "concurrent" not in self.discoveries:
            one, other = self.prefer_unpolled(
                "get_version", "get_status", "get_time", "get_joint_angles"
            )
            first = self.begin(one)
            line.request(one, first)
            second, came = self.begin(other), False
            with suppress(NoReply):
                line.request(other, within_s=_CONCURRENT_S)
                came = True
            line.reply(one, data=REPLIES[one])
            if not came:
                line.request(other, second)
            line.reply(other, data=REPLIES[other])
            self.wait_for_answer(first)
            self.wait_for_answer(second)
            self.discoveries["concurrent"] = (
                came and first.ok
            )  # or it came as the first was given up
        if not self.discoveries["concurrent"]:
            raise CaseSkipped("the client does one thing at a time")

    def prefer_unpolled(self, *names: str) -> tuple[str, str]:
        """The first two of these queries that it does not make by itself, if there are any."""
        one, other, *_ = sorted(names, key=self.has_polled)
        return one, other

    def has_polled(self, name: str) -> bool:
        """Whether it has made this query by itself."""
        return any(frame.opcode == BY_NAME[name].opcode for frame in self.polled)

    def lacks_operation(self, name: str) -> bool:
        """Whether it says that it lacks this operation."""
        call = self.begin(name)
        with suppress(CaseSkipped):
            self.wait_for_answer(call)
        return call.unimplemented

    def make_file(self, content: bytes) -> str:
        """Make a file for it to send; its path."""
        path = self.access.folder / f"zs{next(self._files)}.rob"
        path.write_bytes(content)
        return str(path)

    def missing_file(self) -> str:
        """The path of a file that does not exist."""
        return str(self.access.folder / f"zs{next(self._files)}.rob")

    # ------------------------------------------------------------------ rest

    def settle(self) -> None:
        """Let it hang up, and show that it is alive.

        Raises:
            CaseFailed: It is not.
            CaseInconclusive: Its driver does not keep to its protocol.
        """
        self._calls.clear()
        if self.access.attended:
            return  # he would be asked to do the same over and over
        self.close_lines()
        self._disconnect()
        line = self.open(requirement="T/9")
        call = self.begin("get_status")
        line.serve(call, "00")
        try:
            self.expect_result(call, _IDLE, requirement="4.8/11")
        finally:
            self.idle_status = (
                call.result if self.idle_status is None and call.ok else self.idle_status
            )
        self._disconnect()
        self.close_lines()
        for file in self.access.folder.iterdir():
            file.unlink()
        self._calls.clear()  # these were none of a case's

    def _disconnect(self) -> None:
        self.wait_for_answer(self.begin("disconnect"))

    def _close_extra_connection(self, deadline_s: float) -> bool:
        """End the next connection that it opens of its own accord; whether one came by then."""
        link = self.access.accept(self._slice(deadline_s))
        if link is not None:
            link.close()
        return link is not None

    def revive(self) -> None:
        """Start it anew.

        Raises:
            CaseInconclusive: It cannot be started.
        """
        self.close_lines()
        try:
            self.access.restart()
        except DriverError as error:
            raise CaseInconclusive(str(error)) from None


def _require_implemented(call: Call) -> None:
    if call.unimplemented:
        raise CaseSkipped(UserMessage("the client lacks the operation {call}", call=call.name))


@contextmanager
def _driver_errors() -> Iterator[None]:
    """Tell what is wrong with a driver in the words of the suite."""
    try:
        yield
    except DriverEndedError as error:
        raise NoReply(
            UserMessage("the client has crashed: {error}", error=error), observed=f"{error}"
        ) from None
    except DriverError as error:
        raise CaseInconclusive(str(error)) from None
