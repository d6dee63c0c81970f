"""The client under test, as the cases use it.

The suite starts operations on it. The client connects to the suite and reports the results of its
operations. Requirements are judged only by the checks that a case calls.
"""

import itertools
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.suite.client.harness.access import Access
from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.driver import DriverEndedError, DriverError
from scaraspec.suite.client.harness.driver_values import matches, to_display_text
from scaraspec.suite.client.harness.incoming_connection import PASSWORD, IncomingConnection
from scaraspec.suite.client.harness.traits import ClientTraits
from scaraspec.suite.engine.connection import Connection, pump_all
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    NotConnected,
    OperationRefused,
    expect,
)
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.system_under_test import Interference, ToleratedReading
from scaraspec.traffic.events import FrameSeen
from scaraspec.transports.link import Link
from scaraspec.user_message import UserMessage, sentence_of

if TYPE_CHECKING:
    from scaraspec.protocol.frames import Frame

_SILENCE_S: Final = 0.3
_SLICE_S: Final = 0.02  # how long a connection waits while others may receive
_CONCURRENT_S: Final = 2.0
_DECLINED: Final = "declined"
_TRANSFERS: Final = frozenset({"upload", "download"})
_TWICE: Final = 2
_IDLE: Final = "00"
_SHORT_WAIT_S: Final = 1.0
_IMMEDIATE_S: Final = 4.0  # a client times out on a reply after 5 s (A-3-15)


class ClientUnderTest:
    """The client under test.

    Args:
        access: The access to the client.
        ics: Its implementation conformance statement.
        observer: Observes the traffic.

    Attributes:
        dialect: The readings that the suite uses towards the client.
        tolerated: The listed readings that the running case has observed.
        detected_readings: The readings that were detected, by key.
        traits: What was detected once for the whole run.
        idle_status: What the client reports for an idle robot. A value other than 00 has failed
            once; later it is accepted in place of 00.
        polled: The requests that the client has sent without an operation of the suite.
        survival_requirement: Empty: see `system_under_test.SystemUnderTest`.
        off: Always False: a client is not switched off.
    """

    def __init__(self, access: Access, ics: Ics, observer: Observer) -> None:
        self.access, self.ics, self.observer = access, ics, observer
        self.dialect = ics.dialect
        self.tolerated: list[ToleratedReading] = []
        self.detected_readings: dict[str, str] = {}
        self.served: dict[str, bool] = {}
        self.traits = ClientTraits()
        self.idle_status: Any = None
        self.polled: set[Frame] = set()
        self.survival_requirement = ""
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

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that forgets what is detected from now on."""
        readings, dialect = dict(self.detected_readings), self.dialect
        traits, silences = self.traits.copy(), self._silences.copy()

        def restore() -> None:
            self.detected_readings, self.dialect = readings, dialect
            self.traits, self._silences = traits, silences

        return restore

    # ------------------------------------------------------------------ time

    @property
    def now_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""
        return self.access.now_ns

    @property
    def complaints(self) -> str:
        """The end of the driver's stderr."""
        return self.access.complaints

    @property
    def answer_timeout_s(self) -> float:
        """How long the client may take to answer an operation."""
        return self.access.answer_timeout_s

    @property
    def silence_s(self) -> float:
        """How long the suite waits before it concludes that nothing is sent."""
        return _SILENCE_S

    @property
    def transfer_s(self) -> float:
        """The silence after which the client aborts a transfer (5.4, L795)."""
        return self.ics.transfer_s

    def pause(self, for_s: float) -> None:
        """Wait for this time and keep receiving."""
        deadline_s = self.access.now_s + for_s
        while (remaining_s := deadline_s - self.access.now_s) > 0:
            line = self._open_line()
            if line is None:
                self._wait(deadline_s)
            else:
                line.wait(remaining_s)

    # ------------------------------------------------------------------ connections

    def open(self, *, judged: bool = True, requirement: str = "") -> IncomingConnection:
        """Let the client connect and log in.

        Args:
            judged: False for a connection that will carry invalid bytes.
            requirement: The requirement that an accepted login reported as failed violates.

        Raises:
            CaseFailed: The client does not connect or log in.
            CaseInconclusive: The client waits on a further connection.
            CaseSkipped: The client does not implement it.
        """
        if self.access.attended:
            if (kept := self._open_line()) and kept.auto_responder.idle:
                kept.inbox.clear()
                kept.auto_responder.begin_case()
                return kept
            self.close_lines()  # a case was skipped during an operation
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
        self._calls.remove(call)  # it is not part of the case
        return line

    def begin_connect(
        self, *, judged: bool = True, **values: Any
    ) -> tuple[IncomingConnection, Call]:
        """Let the client connect, without answering its login.

        Args:
            judged: False for a connection that will carry invalid bytes.
            values: Replace the address and the password. None omits a value.

        Returns:
            The connection, and the operation that the login will finish.

        Raises:
            CaseFailed: The client does not connect.
            CaseSkipped: The client does not implement it.
        """
        if self._was_connected:  # the client may not have noticed that the previous one was closed
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
                                "the operator did not do the step within {answer_timeout_s:g} s",
                                answer_timeout_s=self.answer_timeout_s,
                            )
                        )
                    raise NotConnected("the client did not connect after the operation connect")
        return self._connected(link, judged=judged), call

    def _connected(self, link: Link, *, judged: bool) -> IncomingConnection:
        line = IncomingConnection(str(next(self._connections)), link, self, judged=judged)
        self._lines.append(line)
        return line

    def _next(self, line: IncomingConnection, *, judged: bool) -> IncomingConnection | None:
        """Return the next connection if the client closed this one without sending a byte."""
        silent = line.ended and not (line.inbox or line.invalid_bytes)
        link = self.access.accept(self.access.now_s + _SHORT_WAIT_S) if silent else None
        return None if link is None else self._connected(link, judged=judged)

    def accept_unrequested(self, deadline_s: float) -> IncomingConnection | None:
        """Accept a connection that the client opens by itself. It is judged and recorded.

        Args:
            deadline_s: Until when to wait, on the clock of `Access.now_s`.

        Returns:
            The connection, on which nothing is served yet; None if none came.
        """
        link = self.access.accept(self._slice(deadline_s))
        line = None if link is None else self._connected(link, judged=True)
        self._pump_all()
        return line

    def require_single_connection(self) -> None:
        """Require that the client has no further connection: the suite serves one (A-2-2).

        Raises:
            CaseInconclusive: The missing request may be on the further connection.
        """
        if self._close_extra_connection(self.access.now_s):
            raise CaseInconclusive(
                "the client opened a further connection; the suite serves one connection (A-2-2)"
            )

    def _open_line(self) -> IncomingConnection | None:
        return next((line for line in self._lines if not line.ended), None)

    def pump_others(self, line: Connection, /) -> list[Link]:
        """Receive on the other connections. Return the links that may receive more."""
        self._pump()
        return pump_all(self._lines, line)

    def close_lines(self) -> None:
        """Close every connection."""
        for line in self._lines:
            line.close()
        self._lines.clear()

    # ------------------------------------------------------------------ operations

    def begin(self, name: str, /, **values: Any) -> Call:
        """Start an operation, with its name and values as in the driver protocol.

        Raises:
            CaseFailed: The client has crashed.
            CaseInconclusive: The driver violates the driver protocol.
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
        """Allow the client to refuse an operation before it sends anything.

        A refusal skips the rest of the block and is reported as tolerated.
        """
        try:
            yield
        except OperationRefused as refusal:
            if refusal.after_s > _IMMEDIATE_S and not self.access.attended:
                raise
            self.tolerate("", _DECLINED, refusal.observed, str(refusal))

    @property
    def stop_failure(self) -> None:
        """None: a client has no emergency stop of its own."""
        return

    @property
    def withheld(self) -> str:
        """Empty: every request of a case is sent."""
        return ""

    def report_stop_failure(self, requirement: str, message: str) -> None:
        """Do nothing: a client has no emergency stop of its own."""

    def notify(self, sentence: str) -> None:
        """Add a notice for the reader of the results."""
        self.notices.append(sentence)

    def begin_case(self) -> None:
        """Reset the tolerated readings for the next case."""
        self.tolerated.clear()

    @property
    def no_verdict_reason(self) -> str:
        """Why the case has no verdict: the client refused every operation. Empty otherwise."""
        declined = any(each.key == _DECLINED for each in self.tolerated)
        if not declined or any(call.request_seen for call in self._calls):
            return ""
        return "the client refuses every operation of this case without sending a request"

    @property
    def programs(self) -> dict[bytes, bool]:
        """The programs of the pending operations, and whether the controller has them."""
        had = {}
        for call in self._calls:
            name = call.values.get("remote") or call.values.get("name")
            if name and call.answer is None:
                brought = call.request_seen or call.name != "upload"
                deleted = call.request_seen and call.name == "delete_program"
                had[name.encode(errors="surrogateescape")] = brought and not deleted
        return had

    def is_expected(self, seen: FrameSeen) -> bool:
        """Whether this may be the missing request of a pending operation."""
        return any(
            call.name == seen.name
            and not call.request_seen
            and not call.failed
            and not self.is_repeated_poll(seen, call)
            for call in self._calls
        )

    def is_repeated_poll(self, seen: FrameSeen, call: Call | None) -> bool:
        """Whether this request repeats an earlier poll and does not belong to the operation.

        An example is a client that polls one port while the case reads another port.
        """
        return (
            call is not None
            and bool(call.values)
            and seen.frame in self.polled
            and seen.value not in call.values.values()
        )

    def note_request(self, name: str, call: Call | None) -> None:
        """Note the request of this operation, or else of the oldest one of this name."""
        waiting = (each for each in self._calls if each.name == name and not each.request_seen)
        call = call or next(waiting, None)
        if call is not None:
            call.request_seen = True

    @contextmanager
    def expecting(self, call: Call | None) -> Iterator[None]:
        """Treat an answer to this operation as too early while the context is active."""
        self._expected = call
        try:
            yield
        finally:
            self._expected = None

    def wait_for_answer(self, call: Call, *, within_s: float | None = None) -> Call:
        """Wait for the answer to an operation.

        After two timeouts in a row for operations of this name, the timeout is shorter.

        Raises:
            CaseFailed: No answer comes, or the client has crashed.
            CaseSkipped: The client does not implement the operation.
        """
        limit_s = full_s = self.answer_timeout_s if within_s is None else within_s
        if self._silences[call.name] >= _TWICE and not self.access.attended:
            limit_s = min(full_s, _SHORT_WAIT_S)
        if not self.answers_within(call, limit_s):
            self._silences[call.name] += full_s >= self.answer_timeout_s
            raise CaseFailed(
                UserMessage(
                    "the client did not answer {call} within {timeout_s:g} s",
                    timeout_s=limit_s,
                    call=call.name,
                ),
                expected="an answer of the driver",
                observed=self._describe_silence(),
            )
        if call.ok:
            self._silences[call.name] = 0
        _require_implemented(call)
        return call

    def _describe_silence(self) -> str:
        """Describe the missing answer, with the unserved requests that the client may wait for."""
        unserved = (seen for line in self._lines for seen in line.inbox)
        sent = dict.fromkeys(seen.name or f"{seen.frame}" for seen in unserved)
        return (
            UserMessage(
                "silence; unanswered requests of the client: {names}", names=", ".join(sent)
            )
            if sent
            else "silence"
        )

    def answers_within(self, call: Call, within_s: float) -> bool:
        """Wait for the answer to an operation. Return whether it comes.

        Raises:
            CaseFailed: The client has crashed.
        """
        deadline_s = self.access.now_s + within_s
        while not self._answered(call):
            if self.access.now_s >= deadline_s:
                return False
            if call.name == "disconnect":
                self._close_extra_connection(
                    deadline_s
                )  # a client that reconnects first would block there
            else:
                self._wait(deadline_s)
        return True

    def _answered(self, call: Call) -> bool:
        """Receive everything available. Return whether the operation is answered."""
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
        """Return until when to wait without checking the open connection."""
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
                message = UserMessage(
                    "the client refuses {call} without sending a request", call=call.name
                )
                raise OperationRefused(message, expected="a request", observed=f"{call}")
            if call.failed:
                self.require_timely(call)
            raise CaseFailed(
                UserMessage("the client reports the end of {call} too early", call=call.name),
                expected="the operation continues",
                observed=f"{call}",
            )

    def require_timely(self, call: Call) -> None:
        """Ignore an aborted transfer if this machine was too slow.

        Raises:
            CaseInconclusive: A silence of the suite may have caused the timeout.
        """
        if call.name in _TRANSFERS:
            for line in self._lines:
                line.require_timely(call.begun_ns)

    # ------------------------------------------------------------------ its reports

    def confirm_with_operator(self, sentence: str, call: Call | None = None) -> bool | None:
        """Ask the operator whether the client shows this; None without an operator.

        Args:
            sentence: What the client should show.
            call: The operation. The operator is not asked if it is already answered.
        """
        if call is not None and call.answer is not None:
            return None
        question = self.access.ask_operator(sentence)
        if question is None:
            return None
        while not self.answers_within(question, self.answer_timeout_s):
            pass  # the operator may be away
        return question.ok

    def expect_done(
        self, call: Call, *, requirement: str = "", within_s: float | None = None
    ) -> Any:
        """Require that an operation succeeds. Return its result.

        Raises:
            CaseFailed: The client reports a failure, or nothing.
        """
        confirmed = self.confirm_with_operator(UserMessage("{call} was done", call=call.name), call)
        if confirmed is None:
            confirmed = self.wait_for_answer(call, within_s=within_s).ok
        if not confirmed:
            self.require_timely(call)
            raise CaseFailed(
                UserMessage("{call} succeeded, but the client reports a failure", call=call.name),
                expected="done",
                observed=f"{call}",
                requirement=requirement,
            )
        return call.result

    def expect_result(self, call: Call, expected: Any, *, requirement: str = "") -> None:
        """Require that an operation returns this result.

        Raises:
            CaseFailed: The client reports something else.
        """
        confirmed = self.confirm_with_operator(
            UserMessage(
                "{call} returned {expected}", call=call.name, expected=to_display_text(expected)
            ),
            call,
        )
        if confirmed is None:
            result = self.expect_done(call, requirement=requirement)
            known = self.idle_status is not None and (call.name, expected) == ("get_status", _IDLE)
            expect(
                matches(result, expected) or (known and matches(result, self.idle_status)),
                UserMessage("the client reports a wrong result of {call}", call=call.name),
                expected=f"{expected}",
                observed=f"{result}",
                requirement=requirement,
            )
        elif not confirmed:
            raise CaseFailed(
                UserMessage("the client does not show the result of {call}", call=call.name),
                expected=f"{expected}",
                observed="something else",
                requirement=requirement,
            )

    def expect_failure(
        self, call: Call, *, requirement: str = "", within_s: float | None = None
    ) -> None:
        """Require that an operation fails. A two-stage command may also report a refusal.

        Raises:
            CaseFailed: The client reports success, or nothing.
        """
        failed = self.confirm_with_operator(UserMessage("{call} failed", call=call.name), call)
        if failed is None:
            self.wait_for_answer(call, within_s=within_s)
            failed = call.failed
        if not failed:
            raise CaseFailed(
                UserMessage("{call} failed, but the client reports success", call=call.name),
                expected="an error",
                observed=f"{call}",
                requirement=requirement,
            )

    def expect_pending(self, call: Call, message: str, *, requirement: str = "") -> None:
        """Require that an operation is not answered yet.

        Raises:
            CaseFailed: The client has answered it.
        """
        self._pump()
        if call.answer is not None:
            _require_implemented(call)
            raise CaseFailed(
                message, expected="no answer yet", observed=f"{call}", requirement=requirement
            )

    def tolerate(self, requirement: str, key: str, option: str, message: str) -> None:
        """Note that the client follows a listed reading, or causes only a warning."""
        self.tolerated.append(ToleratedReading(requirement, key, option, message))

    # ------------------------------------------------------------------ what it can do

    def require_concurrency(self, line: IncomingConnection) -> None:
        """Require that the client runs two operations at the same time.

        Raises:
            CaseSkipped: The client, or its driver, runs one operation at a time.
        """
        if self.traits.concurrent is None:
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
            # without success of the first, the second may follow a timeout of the first
            self.traits.concurrent = came and bool(first.ok)
        if not self.traits.concurrent:
            raise CaseSkipped("the client runs one operation at a time")

    def prefer_unpolled(self, *names: str) -> tuple[str, str]:
        """Return two of these queries, preferring those that the client does not poll."""
        one, other, *_ = sorted(names, key=self.has_polled)
        return one, other

    def has_polled(self, name: str) -> bool:
        """Whether the client has polled this query."""
        return any(frame.opcode == BY_NAME[name].opcode for frame in self.polled)

    def lacks_operation(self, name: str) -> bool:
        """Whether the client reports the operation as not implemented."""
        call = self.begin(name)
        with suppress(CaseSkipped):
            self.wait_for_answer(call)
        return call.unimplemented

    def make_file(self, content: bytes) -> str:
        """Create a file for an upload. Return its path."""
        path = self.access.folder / f"zs{next(self._files)}.rob"
        path.write_bytes(content)
        return str(path)

    def missing_file(self) -> str:
        """Return the path of a file that does not exist."""
        return str(self.access.folder / f"zs{next(self._files)}.rob")

    # ------------------------------------------------------------------ rest

    def settle(self) -> None:
        """Disconnect the client, and check that it connects and reports an idle status.

        Raises:
            CaseFailed: The client does not respond correctly.
            CaseInconclusive: The driver violates the driver protocol.
        """
        self._calls.clear()
        if self.access.attended:
            return  # the operator would have to repeat the same steps
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
        self._calls.clear()  # these are not part of a case

    def _disconnect(self) -> None:
        self.wait_for_answer(self.begin("disconnect"))

    def _close_extra_connection(self, deadline_s: float) -> bool:
        """Close the next connection that the client opens. Return whether one came in time."""
        line = self.accept_unrequested(deadline_s)
        if line is not None:
            line.close()
        return line is not None

    def revive(self) -> None:
        """Restart the client.

        Raises:
            CaseInconclusive: The client cannot be started.
        """
        self.close_lines()
        try:
            self.access.restart()
        except DriverError as error:
            raise CaseInconclusive(sentence_of(error)) from None


def _require_implemented(call: Call) -> None:
    if call.unimplemented:
        raise CaseSkipped(
            UserMessage("the client does not implement the operation {call}", call=call.name)
        )


@contextmanager
def _driver_errors() -> Iterator[None]:
    """Turn driver errors into the outcome of a case."""
    try:
        yield
    except DriverEndedError as error:
        raise NoReply(
            UserMessage("the client crashed: {error}", error=error), observed=f"{error}"
        ) from None
    except DriverError as error:
        raise CaseInconclusive(sentence_of(error)) from None
