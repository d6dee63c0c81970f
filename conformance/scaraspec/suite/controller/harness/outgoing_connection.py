"""Outgoing connection: one connection to the controller, on which the suite acts as the client.

Requests are built from the command table, or are any bytes of a case. If the controller does not
notice the end of a connection, the suite completes everything before it closes it. This module
does not know which reply is correct.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from scaraspec.protocol.commands import BY_NAME, Command, is_known_opcode
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import MAX_FRAME_BYTES, Frame, Framer
from scaraspec.protocol.payloads import FinalResult, NameListPart, NoData, Outcome
from scaraspec.report.failed_step import Stage
from scaraspec.suite.controller.harness.timeouts import ExpectedReply
from scaraspec.suite.engine.connection import Connection, ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    RequestAbandoned,
    SentTooSlowly,
)
from scaraspec.suite.engine.transfer_timeouts import too_slow, transfer_timeouts_of
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.robot_state import LONGEST_PAUSE_NS
from scaraspec.traffic.transfers import CHUNKS, NAMES
from scaraspec.transports.link import Link
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest

SEGMENT_S: Final = 0.02
"""A pause that separates two segments, in seconds."""

_SIGNS_OF_LIFE: Final = ("login", "get_status")
"""Requests that show whether the controller still answers; they may be steps of every case."""
_CUT_S: Final = 0.001  # enough for a link without delay
_SEPARATION_S: Final = 0.05
_INSTANT_S: Final = 0.001
_IDLE: Final = "00"
_POLL_S: Final = 0.05
_LATE_S: Final = 0.3  # a final result may come this much later than the idle status
_BRIEF_S: Final = 0.5  # a wait of at most this time is not shortened
_SHORT_REPLIES: Final = 45  # this many status replies fill the longest frame
_LAG_WAITS: Final = 3  # during a wait the state may change once more
_NS: Final = 1e9
_NAME_OPCODES: Final = frozenset(BY_NAME[name].opcode for name in NAMES)
_CHUNK_OPCODES: Final = frozenset(BY_NAME[name].opcode for name in CHUNKS)
_STOP_OPCODE: Final = BY_NAME["emergency_stop"].opcode


def split_bytes(data: bytes, sizes: Iterable[int]) -> list[bytes]:
    """Split bytes into parts of these sizes; the rest is the last part."""
    ends = itertools.accumulate(sizes, initial=0)
    cuts = [*[end for end in ends if end < len(data)], len(data)]
    return [data[begin:end] for begin, end in itertools.pairwise(cuts)]


class OutgoingConnection(Connection):
    """One connection, on which the suite sends requests; made by `ControllerUnderTest.open`.

    Attributes:
        listing: The last received part of a program list announces another part.
        cuts: The sizes of the segments of each request in bytes; the rest is the last segment. An
            emergency stop is never cut.
        long_pause_s: The pause after the first segment of the next request that is cut, in seconds.
            It is then zero, and short pauses separate the segments.
    """

    def __init__(
        self, name: str, link: Link, subject: "ControllerUnderTest", *, judged: bool
    ) -> None:
        super().__init__(name, link, subject, A2C, judged=judged)
        self._subject = subject
        self.listing = self._names_files = False
        self.cuts: Sequence[int] = ()
        self.long_pause_s = 0.0
        self._sent_ns = self._received_ns = self._own_ns = 0
        self._transfer_sent_ns = self._pause_ns = self._own_pause_ns = 0
        self._request_pause_ns = 0
        self._outgoing = Framer(A2C, recovery_filter=is_known_opcode)

    @property
    def subject(self) -> "ControllerUnderTest":
        """The controller under test."""
        return self._subject

    # ------------------------------------------------------------------ sending

    def send(self, name: str, value: Any = None, *, data: bytes | None = None) -> Command:
        """Send a request of the command table; `data` replaces its encoded value.

        Returns:
            The row of the command table.
        """
        command, frame = BY_NAME[name], self.request(name, value, data=data)
        if command.result:
            self._drop_results(command)
        self.send_frame(frame)
        return command

    def _drop_results(self, command: Command) -> None:
        """Drop untagged final results of earlier requests; the judge has already seen them."""
        self.pump()
        self.inbox[:] = [
            seen
            for seen in self.inbox
            if seen.frame.tagged or seen.frame.opcode != command.opcode or _outcome(seen) is None
        ]

    def send_frame(self, frame: Frame) -> None:
        """Send one frame.

        Raises:
            RequestAbandoned: A long pause inside became too long.
            RuntimeError: The suite is defective: the case does not declare the hazard.
        """
        self._subject.require_permitted(frame.opcode)
        if not self.cuts or frame.opcode == _STOP_OPCODE:
            self.send_bytes(frame.encode())
            return
        self._before([frame])  # not inside the request: a write to the journal may take long
        for number, part in enumerate(split_bytes(frame.encode(), self.cuts)):
            if number:
                pause_s, self.long_pause_s = self.long_pause_s, 0.0
                begun_ns = self._subject.now_ns
                self.wait(pause_s or _CUT_S)
                self._request_pause_ns = self._subject.now_ns - begun_ns
                if pause_s and self._is_slow:
                    raise RequestAbandoned(self._slow_message())
            self.send_bytes(part, checked=frame)

    def send_bytes(self, data: bytes, *, checked: Frame | None = None) -> None:
        """Send bytes as they are. The guard checks the frames that they complete first.

        Args:
            data: The bytes.
            checked: A frame that the guard has checked.
        """
        frames = [item for item in self._outgoing.feed(data) if isinstance(item, Frame)]
        self._before([frame for frame in frames if frame != checked])
        super().send_bytes(data)

    def _before(self, frames: list[Frame]) -> None:
        """Do what is necessary before these frames are sent."""
        for frame in frames:
            self._subject.guard.check(frame)
        self._wait_for_state(frames)

    def _wait_for_state(self, frames: list[Frame]) -> None:
        """Wait until the robot has settled and replies report its state (A-4-9, A-4.8-3)."""
        lag, settling = self._subject.lag, self._subject.settling
        if lag.measured or settling.is_known:
            self._subject.pump_others(self)
            self.wait(settling.wait_s(frames, self._subject.now_ns))
            for _ in range(_LAG_WAITS):
                self.wait(lag.wait_s(frames, self._subject.now_ns))

    def request(self, name: str, value: Any = None, *, data: bytes | None = None) -> Frame:
        """Return the frame of a request, in the dialect of the subject.

        Raises:
            CaseSkipped: The ICS says that the subject does not support the command.
            CaseInconclusive: The value was reported by the subject and cannot be encoded.
        """
        self._require(name)
        command, dialect = BY_NAME[name], self._subject.dialect
        if value is None and data is None and not isinstance(command.request, NoData):
            raise CaseInconclusive(
                UserMessage(
                    "{command} cannot be sent: the subject has reported no value for it",
                    command=name,
                )
            )
        try:
            payload = command.request.encode(value, dialect) if data is None else data
        except PayloadError as error:
            raise CaseInconclusive(
                UserMessage("{command} cannot be sent: {error}", command=name, error=error)
            ) from None
        opcode = command.opcode
        if command.alternate_opcode is not None and dialect["op_get_default"] == "0x13":
            opcode = command.alternate_opcode
        return Frame(A2C, opcode, payload)

    @property
    def chunk_timeout_s(self) -> float:
        """The timeout for a chunk or for its answer, in seconds (A-5-23, L763, L787).

        It is the transfer timeout that the subject claims, but not less than the reply timeout.
        """
        return max(self._subject.reply_s, self._subject.transfer_s)

    def require_timely(self) -> None:
        """Require that the last two frames of a transfer were sent without a pause that may end it.

        Other commands may have been sent between them.

        Raises:
            CaseInconclusive: This machine, the network or the subject was too slow.
        """
        if (pause_s := self._pause_ns / _NS) > transfer_timeouts_of(self._subject).early_s:
            raise too_slow(pause_s, self._own_pause_ns / _NS)

    # ------------------------------------------------------------------ requests

    def ask(
        self,
        name: str,
        value: Any = None,
        *,
        data: bytes | None = None,
        within_s: float | None = None,
    ) -> ReceivedFrame:
        """Send a request and wait for its first reply.

        Raises:
            NoReply: No reply arrived within `within_s`, by default the reply timeout.
        """
        stop, settling = self._subject.guard.stop, self._subject.settling
        settles = settling.may_refuse(BY_NAME[name].opcode, self._subject.now_ns)
        settles = settles and not stop.executing
        self._drop_unsolicited(self.send(name, value, data=data))
        try:
            answer = self.reply(name, within_s=within_s)
        except NoReply:
            if within_s is None:
                self.end_unfinished_reply()
            raise
        if settles and answer.accepted is False and answer.code in BUSY:
            settling.note_refusal(self)
            return self.ask(name, value, data=data, within_s=within_s)
        return answer

    def end_unfinished_reply(self) -> None:
        """Send requests until an unfinished reply ends, so that the judge can see its fault.

        A reply whose length byte is too large contains the replies after it (3/7).
        """
        with suppress(NoReply):
            for _ in range(_SHORT_REPLIES):
                if not self.unfinished or self.invalid_bytes or self.ended:
                    break
                if self._subject.access.needs_login:  # the unfinished reply may be that to a login
                    self.send("login", self._subject.password)
                self.send("get_status")
                self.wait(_SEPARATION_S)

    def _drop_unsolicited(self, command: Command) -> None:
        """Drop unsolicited replies: they answer no later request and may be outdated (A-3-16)."""
        if unsolicited := [seen.place for seen in self._subject.observer.unsolicited]:
            self.inbox[:] = [
                seen
                for seen in self.inbox
                if seen.frame.opcode != command.opcode or seen.place not in unsolicited
            ]

    def reply(self, name: str, *, within_s: float | None = None) -> ReceivedFrame:
        """Wait for a first reply, or for a chunk of a download.

        Raises:
            NoReply: No reply arrived in time.
        """
        self._require(name)
        command = BY_NAME[name]
        opcodes = {command.opcode, command.alternate_opcode, command.alternate_reply_opcode} - {
            None
        }
        answer = self._wait_for_reply(
            ExpectedReply(name),
            lambda seen: not seen.frame.tagged and seen.frame.opcode in opcodes,
            within_s,
            self._subject.reply_s,
            UserMessage("{name} was not answered", name=name),
        )
        if name == "emergency_stop" and answer.accepted:
            self._subject.note_accepted_stop()
        if name == "list_programs":
            self.listing = isinstance(answer.value, NameListPart) and answer.value.more
        return answer

    def _require(self, name: str) -> None:
        """Skip the case if the ICS says that the subject does not support a command."""
        if name in self._subject.ics.unsupported:
            raise CaseSkipped(UserMessage("the ICS says that {name} is unsupported", name=name))

    def result(
        self, name: str, *, within_s: float | None = None, untagged: bool = False
    ) -> ReceivedFrame:
        """Wait for the final result of a two-stage command.

        If it was missing twice and has never come, an idle status ends the wait.

        Args:
            name: The command.
            within_s: The timeout in seconds; by default the maximum duration of a motion.
            untagged: Whether a result without the tag is accepted. If tagged results have never
                come, every case about another requirement accepts it.

        Raises:
            NoReply: No result arrived in time.
        """
        due, opcode = ExpectedReply(name, result=True), BY_NAME[name].opcode
        timeout_policy, full_s = self._subject.timeout_policy, self._subject.longest_s
        given_up = timeout_policy.given_up(due)
        untagged = untagged or (given_up and not self._subject.is_case_about(due.requirement))

        def is_expected(seen: FrameSeen) -> bool:
            return seen.frame.opcode == opcode and (
                seen.frame.tagged or (untagged and _outcome(seen) is not None)
            )

        short_s = timeout_policy.timeout_s(due, full_s if within_s is None else within_s)
        if given_up and short_s > _BRIEF_S and self._becomes_idle(is_expected, short_s):
            within_s = _LATE_S
        message = UserMessage("no final result of {name} came", name=name)
        answer = self._wait_for_reply(due, is_expected, within_s, full_s, message)
        self._subject.settling.measure(self, name)
        return answer if answer.frame.tagged else answer._replace(value=_outcome(answer.seen))

    def _becomes_idle(self, is_expected: Callable[[FrameSeen], bool], within_s: float) -> bool:
        """Query the status until it is idle or the expected frame has come.

        Returns:
            Whether the robot is idle; False if it may answer no query while it executes (A-4-3).
        """
        if self._subject.traits.unresponsive_while_executing is not False:
            return False
        deadline = Deadline(self._subject, within_s)
        with suppress(NoReply):
            while not (deadline.expired or any(map(is_expected, self.inbox))):
                if self.ask("get_status").value == _IDLE:
                    return True
                self.wait(_POLL_S)
        return False

    def _wait_for_reply(
        self,
        due: ExpectedReply,
        is_expected: Callable[[FrameSeen], bool],
        within_s: float | None,
        full_s: float,
        message: str,
    ) -> ReceivedFrame:
        """Wait for a reply, for less than the full time if it has never come."""
        timeout_policy, limit_s = (
            self._subject.timeout_policy,
            full_s if within_s is None else within_s,
        )
        try:
            answer = self.wait_for_frame(
                is_expected, timeout_policy.timeout_s(due, limit_s), message
            )
        except NoReply as error:
            if not due.result:
                self._require_prompt_request()
            error.reply_requirement = due.requirement
            error.due = error.due or (due.name, Stage.RESULT if due.result else Stage.REPLY)
            error.preparation = due.name not in _SIGNS_OF_LIFE
            if timeout_policy.given_up(due):
                error.requirement, error.depends_on = due.requirement, self.dependency(due)
            elif limit_s >= full_s and (due.result or not self._subject.guard.stop.executing):
                self.await_late(is_expected)
            if limit_s >= full_s and not self.ended:
                timeout_policy.note_timeout(due)
            raise
        if not due.result or (answer.frame.tagged and answer.done):
            timeout_policy.note_received(due)
        return answer

    def _require_prompt_request(self) -> None:
        """Require that the last request was sent without a pause after which it may be dropped.

        Raises:
            SentTooSlowly: This machine was too slow.
        """
        if self._is_slow:
            raise SentTooSlowly(self._slow_message())

    @property
    def _is_slow(self) -> bool:
        """Whether the last request had a pause after which it may be dropped (A-3-11)."""
        return self._request_pause_ns * self._subject.ics.time_scale > LONGEST_PAUSE_NS

    def _slow_message(self) -> UserMessage:
        return UserMessage(
            "this machine is too slow: it has sent a request with a pause of {pause_s:.3f} s "
            "inside",
            pause_s=self._request_pause_ns / _NS,
        )

    def dependency(self, due: ExpectedReply) -> str:
        """Return the case that has shown that this final result never comes.

        Returns:
            Its id; empty while the wait budget is not used up, in a case about this result, and for
            a first reply, whose requirement is that of all commands.
        """
        subject = self._subject
        missing = due.result and subject.timeout_policy.given_up(due)
        if not missing or subject.is_case_about(due.requirement):
            return ""
        return subject.observer.budget.dependency(due.requirement)

    def no_result(self, name: str, *, for_s: float, requirement: str = "") -> None:
        """Require that no final result of this command arrives within this time.

        Raises:
            CaseFailed: A result arrives.
        """
        self.wait(for_s)
        opcode = BY_NAME[name].opcode
        for seen in self.inbox:
            if seen.frame.tagged and seen.frame.opcode == opcode:
                message = UserMessage(
                    "a final result of {command} came that must not come", command=name
                )
                raise CaseFailed(
                    message, expected="none", observed=f"{seen.frame}", requirement=requirement
                )

    def chunk_answer(self, *, accepted: bool) -> Frame:
        """Return the frame of the answer to a chunk of a download."""
        data = BY_NAME["download_chunk"].reply.encode(accepted, self._subject.dialect)
        return Frame(A2C, BY_NAME["download_chunk"].opcode, data)

    def answer_chunk(self, *, accepted: bool) -> None:
        """Answer a chunk of a download."""
        self.send_frame(self.chunk_answer(accepted=accepted))

    def separate_frames(self) -> None:
        """Wait so that the next frame does not arrive together with the last one.

        Some controllers do not handle two frames that arrive together (A-3-14).
        """
        self.wait(_SEPARATION_S if self._subject.dialect["pipelining"] == "one" else _INSTANT_S)

    def sync(self) -> list[FrameSeen]:
        """Query the status, and return all frames that arrive before the reply.

        Replies come in the order of their requests (3/14). A reply that is missing by then does
        not come, so the suite need not wait for a timeout.

        Raises:
            NoReply: The status query was not answered.
        """
        if self._subject.dialect["pipelining"] == "one":
            self.separate_frames()
        self.send("get_status")
        before = list(self.inbox)
        self.inbox.clear()
        opcode = BY_NAME["get_status"].opcode
        deadline_s = self.link.now_s + self._subject.reply_s

        def is_reply(seen: FrameSeen) -> bool:
            return seen.frame.opcode == opcode and not seen.frame.tagged

        while True:
            while self.inbox:
                seen = self.inbox.pop(0)
                if is_reply(seen):
                    return before
                before.append(seen)
            if not self._more(deadline_s):
                self.inbox[:0] = before
                if not self._subject.guard.stop.executing:
                    self.await_late(is_reply)
                raise self.no_reply_error("get_status was not answered")

    def collect_replies(self) -> list[FrameSeen]:
        """Call `sync`; if nothing came, wait a moment for replies out of order (A-3-14).

        Raises:
            NoReply: The status query was not answered.
        """
        came = self.sync()
        if not came:
            self.wait(_SEPARATION_S)
            came = list(self.inbox)
            self.inbox.clear()
        return came

    # ------------------------------------------------------------------ ending

    def close(self) -> None:
        """Close the connection."""
        self._complete()
        super().close()

    def reset(self) -> None:
        """Reset the connection."""
        self._complete()
        super().reset()

    def _complete(self) -> None:
        """Complete everything if the controller does not notice the end of the connection.

        An unfinished frame is made invalid, a transfer ends after its timeout (L763, L795), and
        pending replies arrive.
        """
        if self.ended:
            return
        with suppress(CaseFailed):
            detects_close = self._subject.access.detects_close
            if not detects_close and self.mid_frame:
                self.send_bytes(bytes(MAX_FRAME_BYTES))
            if self._subject.transfers_outlive and self.may_transfer:
                self.wait(transfer_timeouts_of(self._subject).must_end_s)
            if not detects_close:
                self.sync()

    @property
    def may_transfer(self) -> bool:
        """Whether a file transfer may be active on this connection."""
        if self._judged:
            return self._subject.observer.judge.transferring(self.name)
        return self._names_files

    def _sent(self, seen: FrameSeen) -> None:
        time_ns = seen.place.time_ns
        self._own_ns += time_ns - max(self._sent_ns, self._received_ns)
        self._sent_ns = time_ns
        if seen.frame.opcode in _NAME_OPCODES:
            self._pause_ns = self._own_pause_ns = 0
            self._transfer_sent_ns, self._own_ns = time_ns, 0
        elif seen.frame.opcode in _CHUNK_OPCODES:
            self._pause_ns, self._own_pause_ns = time_ns - self._transfer_sent_ns, self._own_ns
            self._transfer_sent_ns, self._own_ns = time_ns, 0
        self._request_pause_ns = seen.pause_ns
        self._names_files = self._names_files or seen.name in NAMES
        self._subject.guard.sent(self.name, seen)
        self._subject.lag.frame_seen(seen.frame, seen.place.time_ns)

    def _received(self, seen: FrameSeen) -> None:
        self._received_ns = seen.place.time_ns
        self._subject.guard.stop.transferring = self._subject.may_transfer
        self._subject.guard.received(self.name, seen)
        self._subject.lag.frame_seen(seen.frame, seen.place.time_ns)
        self._subject.settling.frame_seen(seen.frame, seen.place.time_ns)


def _outcome(seen: FrameSeen) -> Outcome | None:
    """Decode a frame as a final result, with or without the tag; None if it is not one."""
    outcome: Outcome | None = FinalResult().decode(seen.frame.data).value
    return outcome
