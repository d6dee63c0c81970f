"""A connection from the client under test, on which the suite acts as the controller.

Replies come from the command table, or are any bytes that a case needs. Which reply is correct is
not known here. Polls of the client are answered while a case waits.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.client.harness.auto_responder import REPLIES, AutoResponder
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.valid_bytes import expect_valid_bytes
from scaraspec.suite.engine.connection import Connection, ReceivedFrame
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseSkipped,
    NoReply,
    OperationRefused,
    expect_equal,
)
from scaraspec.suite.engine.transfer_timeouts import too_slow, transfer_timeouts_of
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.wire import Kind
from scaraspec.transports.link import Link
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from collections.abc import Callable

    from scaraspec.suite.client.harness.client_under_test import ClientUnderTest

PASSWORD: Final = b"password"  # the example of the document (L108)

YES: Final = True
"""The value of a plain success reply."""

_DONE: Final = "11"
_MOMENT_S: Final = 0.005
_ALONE_S: Final = 1.0
"""A client that refuses sooner has not waited for a reply on a connection of its own."""
_NS: Final = 1e9
_CUTS: Final = (1, 3)  # after the start byte and after the length
_TRANSFER_COMMANDS: Final = frozenset(
    {"upload_name", "upload_chunk", "download_name", "download_chunk"}
)


class IncomingConnection(Connection):
    """One connection, created by `ClientUnderTest.open`.

    Attributes:
        auto_responder: Answers the polls of the client.
        fragment_pause_s: The pause between the pieces of a frame; 0 sends each frame whole.
    """

    def __init__(self, name: str, link: Link, subject: "ClientUnderTest", *, judged: bool) -> None:
        self.auto_responder = AutoResponder(subject.is_expected)
        self.fragment_pause_s = 0.0
        self._appended: list[bytes] = []
        self._subject = subject
        self._answering = False
        self._is_expected: Callable[[FrameSeen], bool] = _nothing
        self._sent_ns: list[int] = []
        self._received_ns: list[int] = []
        super().__init__(name, link, subject, C2A, judged=judged)

    # ------------------------------------------------------------------ listening

    def request(
        self, name: str, call: Call | None = None, *, within_s: float | None = None
    ) -> ReceivedFrame:
        """Wait for a request.

        Args:
            name: The command.
            call: The operation that should send it.
            within_s: The timeout in seconds; by default the answer timeout.

        Raises:
            NoReply: No request came.
            CaseFailed: The client finishes the operation without sending the request.
            CaseInconclusive: The request may be on a further connection.
            CaseSkipped: The client does not implement the operation, or the operator is away.
        """
        command = BY_NAME[name]
        opcodes = {command.opcode, command.alternate_opcode} - {None}
        timeout_s = self._subject.answer_timeout_s if within_s is None else within_s

        def is_request(seen: FrameSeen) -> bool:
            return seen.frame.opcode in opcodes and not self._subject.is_repeated_poll(seen, call)

        self._is_expected = is_request
        begun_s = self._subject.access.now_s
        try:
            with self._subject.expecting(call):
                request = self.wait_for_frame(
                    is_request,
                    timeout_s,
                    UserMessage("the client did not send {command}", command=name),
                )
        except OperationRefused as refusal:
            self.finish()
            if self.inbox or self.invalid_bytes:  # the client has sent something else
                raise self.no_reply_error(f"{refusal}") from None
            refusal.after_s = self._subject.access.now_s - begun_s
            if refusal.after_s > _ALONE_S:
                self._subject.require_single_connection()
            raise
        except NoReply:
            if self._subject.access.attended and within_s is None and not self.ended:
                raise CaseSkipped(
                    UserMessage(
                        "the operator did not do the step within {timeout_s:g} s",
                        timeout_s=timeout_s,
                    )
                ) from None
            if within_s is None and not self.ended:
                self._subject.require_single_connection()
            raise
        finally:
            self._is_expected = _nothing
        self.auto_responder.case_received(request.seen)
        self._subject.note_request(name, call)
        return request

    def _receive(self, deadline_s: float, others: Sequence[Link] = ()) -> bool:
        """Receive once, as `Connection` does, and answer polls before and after it.

        A client that has closed its end and waits for no reply may wait for the suite to close too.
        """
        self._answer_polls()
        received = super()._receive(deadline_s, others)
        self._answer_polls()
        if self.ending is not None and not (self.closed or self.inbox):
            self._finish_close(self.link.close, Kind.CLOSED)
        return received

    def _answer_polls(self) -> None:
        if self._answering:
            return
        self._answering = True
        try:
            while not (self.ended or self.mid_frame):
                unwanted = [seen for seen in self.inbox if not self._is_expected(seen)]
                poll = self.auto_responder.next_poll(unwanted, self._subject.access.now_s)
                if poll is None:
                    break
                self.inbox.remove(poll)
                if poll.name in REPLIES:
                    self._subject.polled.add(poll.frame)
                fetched = bool(self._subject.traits.requests_list_parts)
                frames = self.auto_responder.reply_frames(
                    poll, self._subject.programs, fetched=fetched
                )
                with suppress(NoReply):  # the client has closed the connection
                    for frame in frames:
                        self.send_frame(frame)
        finally:
            self._answering = False

    def _sent(self, seen: FrameSeen) -> None:
        self._sent_ns.append(seen.place.time_ns)
        self.auto_responder.case_sent(seen)

    def _received(self, seen: FrameSeen) -> None:
        self._received_ns.append(seen.place.time_ns)

    def require_timely(self, since_ns: int) -> None:
        """Require that the suite was never silent long enough to end a transfer.

        Args:
            since_ns: The start of the period, in nanoseconds since the Unix epoch.

        Raises:
            CaseInconclusive: This machine, the network or the client was too slow.
        """
        self.pump()
        due = (
            [self._subject.now_ns]
            if any(seen.name in _TRANSFER_COMMANDS for seen in self.inbox)
            else []
        )
        sent_ns = [since_ns, *(time_ns for time_ns in self._sent_ns if time_ns > since_ns), *due]
        silences = [(then - at, at, then) for at, then in pairwise(sent_ns)]
        silence_ns, begun_ns, ended_ns = max(silences, default=(0, 0, 0))
        if silence_ns / _NS > transfer_timeouts_of(self._subject).early_s:
            received_ns = [at for at in self._received_ns if begun_ns <= at <= ended_ns]
            own_ns = ended_ns - min(received_ns, default=begun_ns)
            raise too_slow(silence_ns / _NS, own_ns / _NS)

    # ------------------------------------------------------------------ sending

    def send_frame(self, frame: Frame) -> None:
        """Send one frame, in pieces if `fragment_pause_s` is set, with appended bytes if any."""
        data = frame.encode() + (self._appended.pop(0) if self._appended else b"")
        cuts = (
            sorted({0, *_CUTS, len(data) // 2, len(data) - 1, len(data)})
            if self.fragment_pause_s
            else ()
        )
        for begin, end in pairwise(cuts or (0, len(data))):
            self.send_bytes(data[begin:end])
            if end < len(data):
                self.wait(self.fragment_pause_s)

    @contextmanager
    def append_to_frame(self, data: bytes, *, after_frames: int) -> Iterator[None]:
        """Send bytes in one segment with the next frame, or after that many frames.

        Bytes that were not sent with a frame are sent at the end.
        """
        self._appended = [b""] * after_frames + [data]
        try:
            yield
        finally:
            left = b"".join(self._appended)
            self._appended.clear()
            self.send_bytes(left)

    def frame(self, name: str, value: Any = YES, *, data: bytes | None = None) -> Frame:
        """Return the first reply to a request. `data` replaces the encoded value."""
        command = BY_NAME[name]
        payload = command.reply.encode(value, self._subject.dialect) if data is None else data
        return Frame(C2A, command.opcode, payload)

    def reply(self, name: str, value: Any = YES, *, data: bytes | None = None) -> None:
        """Send a first reply."""
        self.send_frame(self.frame(name, value, data=data))

    def result(self, name: str, code: str = "", *, data: bytes | None = None) -> None:
        """Send the final result of a two-stage command: success, or a failure with a code.

        It is sent a moment after the first reply. A client that loses a final result in the same
        segment (4/10) would otherwise hang in every command.
        """
        self.wait(_MOMENT_S)
        self.send_frame(self.result_frame(name, code, data=data))

    def result_frame(self, name: str, code: str = "", *, data: bytes | None = None) -> Frame:
        """Return the frame of a final result."""
        payload = (f"00|{code}" if code else _DONE).encode() if data is None else data
        return Frame(C2A, BY_NAME[name].opcode, payload, tagged=True)

    def send_chunk(self, chunk: Chunk) -> None:
        """Send a chunk of a download."""
        self.send_frame(self.chunk_frame(chunk))

    def chunk_frame(self, chunk: Chunk) -> Frame:
        """Return the frame of a download chunk."""
        command = BY_NAME["download_chunk"]
        data = command.request.encode(chunk, self._subject.dialect)
        return Frame(C2A, command.opcode, data)

    # ------------------------------------------------------------------ both

    def log_in(self, call: Call, *, reply: bytes = b"1") -> None:
        """Wait for the login of a connect operation and answer it.

        Raises:
            NoReply: The login did not come.
            CaseFailed: The login is not a frame or carries another password, or the client does
                not log in.
        """
        try:
            request = self.request("login", call)
        except CaseFailed:
            self.expect_login(call)
            raise
        sent = request.seen.text  # a NUL may end it (A-T-3)
        expect_equal(sent, PASSWORD, "the login carries a wrong password", requirement="4.1/1")
        self.reply("login", data=reply)

    def expect_login(self, call: Call) -> None:
        """Explain why the login of a connect operation is missing.

        A client that reports a connection without a login may log in before its first query.

        Raises:
            CaseFailed: The login is not a frame, or the client sends a query without a login.
        """
        self.finish()
        expect_valid_bytes(self)
        if not call.ok:
            return
        self._subject.begin("get_status")
        self.wait_for_any(self._subject.answer_timeout_s)
        if self.inbox and self.inbox[0].name != "login":
            raise CaseFailed(
                "the client reports a connection and sends a request without a login",
                expected="login",
                observed=f"{self.inbox[0].frame}",
                requirement="2/10",
            )

    def serve(
        self, call: Call, value: Any = YES, *, data: bytes | None = None, sent: bytes | None = None
    ) -> ReceivedFrame:
        """Wait for the request of an operation and answer it.

        Args:
            call: The operation.
            value: The value of the reply.
            data: The data of the reply, in place of the value.
            sent: The data that the request must carry; None for any.

        Raises:
            NoReply: No request came.
            CaseFailed: The request carries other data.
        """
        request = self.request(call.name, call)
        self.reply(call.name, value, data=data)
        if sent is not None:
            carried = request.seen.text if sent else request.frame.data  # NUL may end text (A-T-3)
            expect_equal(
                carried, sent, UserMessage("the request {call} carries wrong data", call=call.name)
            )
        return request


def _nothing(_: FrameSeen) -> bool:
    return False
