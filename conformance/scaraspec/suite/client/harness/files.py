"""Files: how the suite, as the controller, receives an upload and sends a download.

Each check here names its own requirement, whatever requirement the case has. Cases about failing
transfers send their own answers, and their own chunks with `Download.offer_chunk`.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk, chunks_of
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.chunks import chunk_of, expect_next
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect, expect_equal
from scaraspec.suite.engine.transfer_timeouts import transfer_timeouts_of
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

_TRANSFER: Final = range(0x50, 0x57)
_SLICE_S: Final = 0.05  # between two checks for an answer of the client
_RETRIES: Final = 20
_GRACE_S: Final = 0.5  # until the client reports an aborted transfer


# ---------------------------------------------------------------------- either way


def request_or_none(
    subject: ClientUnderTest,
    line: IncomingConnection,
    call: Call,
    command: str,
    within_s: float | None = None,
) -> ReceivedFrame | None:
    """Wait for a request; None if it does not come, or not soon after the operation ends.

    The network may still carry bytes that the client sent before it reported the end.
    """
    remaining_s = subject.answer_timeout_s if within_s is None else within_s
    while True:
        answered = call.answer is not None
        if answered:
            remaining_s = min(remaining_s, subject.silence_s)
        last = line.ended or remaining_s <= 0
        with suppress(NoReply):
            return line.request(command, within_s=min(_SLICE_S, max(remaining_s, 0)))
        if last or (answered and not line.unfinished):
            return None
        remaining_s -= _SLICE_S


def _settled(subject: ClientUnderTest, call: Call, within_s: float, requirement: str) -> None:
    """Wait for the answer to an operation. An operator is asked later.

    Raises:
        CaseFailed: No answer comes.
    """
    if not subject.access.attended:
        try:
            subject.wait_for_answer(call, within_s=within_s)
        except CaseFailed as error:
            error.requirement = requirement
            raise


def expect_transfer_done(subject: ClientUnderTest, call: Call) -> None:
    """Require that a complete transfer ends successfully.

    Raises:
        CaseFailed: It does not.
    """
    _settled(subject, call, subject.answer_timeout_s, "5.1/7")  # the client never ends the transfer
    subject.expect_done(call, requirement="5.2/19")


def expect_transfer_failed(
    subject: ClientUnderTest, call: Call, requirement: str = "5.2/19"
) -> None:
    """Require that a transfer fails, at once or after a timeout (A-5-14).

    Raises:
        CaseFailed: It does not.
    """
    _settled(subject, call, transfer_timeouts_of(subject).must_end_s + _GRACE_S, requirement)
    subject.expect_failure(call, requirement=requirement)


def transfer_frames(line: IncomingConnection) -> list[FrameSeen]:
    """Return the received frames of clause 5 that no case has taken."""
    return [seen for seen in line.inbox if seen.frame.opcode in _TRANSFER]


def is_abort_signal(seen: FrameSeen | ReceivedFrame) -> bool:
    """Whether this is the signal that ends an upload and needs no answer (L787; A-5-10)."""
    if seen.frame.opcode != BY_NAME["upload_chunk"].opcode:
        return False
    return not seen.frame.data or (isinstance(seen.value, Chunk) and not seen.value.length)


def expect_no_transfer_frames(
    line: IncomingConnection,
    message: str,
    requirement: str,
    for_s: float = 0.0,
    *,
    allowed: Callable[[FrameSeen], bool] | None = None,
) -> None:
    """Require that the client sends no frame of a transfer, before or during this time.

    Args:
        line: Its connection.
        message: The message of the failure.
        requirement: The requirement that such a frame violates.
        for_s: How long to wait, in seconds.
        allowed: Returns True for a frame that the client may send. Such frames are removed.

    Raises:
        CaseFailed: The client sends such a frame.
    """
    line.wait(for_s)
    came = transfer_frames(line)
    for seen in filter(allowed, came.copy()) if allowed else ():
        came.remove(seen)
        line.inbox.remove(seen)
    expect(
        not came,
        message,
        expected="nothing",
        observed="; ".join(f"{seen.frame}" for seen in came),
        requirement=requirement,
    )


def expect_served(
    subject: ClientUnderTest, line: IncomingConnection, what: str
) -> IncomingConnection:
    """Require that another command works, on this connection or on a new one (A-5-26).

    Returns:
        The connection to continue with.

    Raises:
        CaseFailed: The command works on neither.
    """
    try:
        _ask_status(subject, line)
    except CaseFailed as error:
        line.close()
        try:
            line = subject.open()
            _ask_status(subject, line)
        except CaseFailed:
            error.requirement = "5.4/6"
            raise error from None
        message = UserMessage(
            "after {event}, the client works only on a new connection", event=what
        )
        subject.tolerate("5.4/6", "A-5-26", "closed", message)
    return line


def _ask_status(subject: ClientUnderTest, line: IncomingConnection) -> None:
    call = subject.begin("get_status")
    line.serve(call, "00")
    _settled(subject, call, subject.answer_timeout_s, "5.4/6")
    subject.expect_result(call, "00")


def _expect_named(line: IncomingConnection, call: Call, remote: str, requirement: str) -> None:
    request = line.request(f"{call.name}_name", call)
    sent = request.frame.data.removesuffix(b"\0")  # some clients end a text with NUL (A-T-3)
    expect_equal(sent, remote.encode(), "the client sent a wrong name", requirement=requirement)


# ---------------------------------------------------------------------- upload


class Upload:
    """An upload whose name was received and is not answered yet.

    Args:
        subject: The client.
        line: Its connection.
        content: The content of the file.
        remote: The remote name; empty for the name of the local file.

    Attributes:
        call: The operation.
        received_bytes: The number of bytes received.

    Raises:
        CaseFailed: Another name is sent, or none.
    """

    def __init__(
        self, subject: ClientUnderTest, line: IncomingConnection, content: bytes, remote: str = ""
    ) -> None:
        self._subject, self._line, self._content = subject, line, content
        self.received_bytes = 0
        local = subject.make_file(content)
        remote = remote or Path(local).name
        self.call = subject.begin("upload", local=local, remote=remote)
        _expect_named(line, self.call, remote, "5.2/1")
        line.inbox[:] = [
            seen for seen in line.inbox if not is_abort_signal(seen)
        ]  # signals of an earlier upload

    def accept_name(self) -> None:
        """Answer the name with 1: the file is created."""
        self._line.reply("upload_name")

    def chunk_frames(self) -> Iterator[ReceivedFrame]:
        """Yield the chunk frames, valid or not. Each is answered 1 before the next one.

        The iteration ends where a correct client has sent the whole content.

        Raises:
            CaseFailed: The client stops earlier.
        """
        while self.received_bytes < len(self._content):
            frame = self._frame("5.2/20")
            yield frame
            self.accept_chunk(frame.value.length if isinstance(frame.value, Chunk) else 0)

    def accept_chunk(self, length: int) -> None:
        """Answer a chunk of this length with 1."""
        self._line.reply("upload_chunk")
        self.received_bytes += length or BUFFER_BYTES

    def next_chunk(self) -> Chunk:
        """Wait for the next chunk, without answering it.

        Raises:
            CaseFailed: It does not come, or is not the expected one.
        """
        return self._right(self._frame("5.2/19"))

    def refuse_chunk(self, chunk: Chunk) -> None:
        """Answer a chunk with 0: the upload has failed. The client may retry this chunk.

        Raises:
            CaseFailed: The client continues, or reports success.
        """
        self._line.reply("upload_chunk", value=False)
        for _ in range(_RETRIES):
            again = request_or_none(self._subject, self._line, self.call, "upload_chunk")
            if again is None:
                break
            if is_abort_signal(again):
                continue
            expect(
                chunk_of(again).position == chunk.position,
                UserMessage(
                    "the upload continued after the chunk at {position} was refused",
                    position=chunk.position,
                ),
                expected="no chunk",
                observed=f"{again}",
                requirement="5.2/8",
            )
            message = "the client sends a refused chunk again"
            self._subject.tolerate("5.2/8", "A-5-14", "retry", message)
            self._line.reply("upload_chunk", value=False)
        self.expect_failed()

    def finish(self) -> None:
        """Receive the rest and require that the client reports success.

        Raises:
            CaseFailed: It does not, or sends something else.
        """
        for frame in self.chunk_frames():
            self._right(frame)
        self.expect_done()

    def expect_done(self) -> None:
        """Require that the upload succeeds; see `expect_transfer_done`."""
        serve_read_back(self._subject, self._line, self.call, self._content)
        expect_transfer_done(self._subject, self.call)

    def expect_failed(self, requirement: str = "5.2/19") -> None:
        """Require that the upload fails; see `expect_transfer_failed`."""
        expect_transfer_failed(self._subject, self.call, requirement)

    def _frame(self, requirement: str) -> ReceivedFrame:
        try:
            return self._line.request("upload_chunk", self.call)
        except CaseFailed as error:
            error.requirement = requirement
            raise

    def _right(self, frame: ReceivedFrame) -> Chunk:
        """Require that a frame is the expected chunk. Return the chunk."""
        chunk, due = chunk_of(frame), self.received_bytes
        expect_next(chunk, due, len(self._content))
        wanted = self._content[due : due + chunk.length]
        expect(
            chunk.data == wanted,
            UserMessage("the chunk at {position} differs from the file", position=due),
            expected=wanted.hex(" "),
            observed=chunk.data.hex(" "),
            requirement="5.2/20",
        )
        return chunk


def serve_read_back(
    subject: ClientUnderTest, line: IncomingConnection, call: Call, content: bytes
) -> None:
    """Serve a client that downloads the file after an upload to compare it (A-5-21)."""
    deadline_s = subject.access.now_s + subject.answer_timeout_s
    while not (subject.access.attended or line.ended or subject.answers_within(call, _SLICE_S)):
        if subject.access.now_s >= deadline_s:
            break
        if any(seen.name == "download_name" for seen in line.inbox):
            line.request("download_name")
            line.reply("download_name")
            for chunk in chunks_of(content):
                line.send_chunk(chunk)
                line.request("download_chunk")


def receive_upload(
    subject: ClientUnderTest, line: IncomingConnection, content: bytes, remote: str = ""
) -> None:
    """Let the client upload a file and receive all of it.

    Raises:
        CaseFailed: The client sends it incorrectly, or does not report success.
    """
    upload = Upload(subject, line, content, remote)
    upload.accept_name()
    upload.finish()


# ---------------------------------------------------------------------- download


def split_content(content: bytes, lengths: Iterable[int]) -> Iterator[Chunk]:
    """Split a file into chunks of these lengths."""
    position = 0
    for length in lengths:
        yield Chunk(len(content), position, length, content[position : position + length])
        position += length


class Download:
    """A download whose name was received and is not answered yet.

    Args:
        subject: The client.
        line: Its connection.
        remote: The remote name; empty for the name of the local file.

    Attributes:
        call: The operation.
        local: The file that the client should create.
        received: The content that the client has accepted.

    Raises:
        CaseFailed: Another name is sent, or none.
    """

    def __init__(
        self, subject: ClientUnderTest, line: IncomingConnection, remote: str = ""
    ) -> None:
        self._subject, self._line = subject, line
        self.local = Path(subject.missing_file())
        self.received = b""
        remote = remote or self.local.name
        self.call = subject.begin("download", remote=remote, local=str(self.local))
        _expect_named(line, self.call, remote, "5.3/1")

    @property
    def stored(self) -> bytes | None:
        """The content of the local file; None without such a file."""
        return self.local.read_bytes() if self.local.exists() else None

    def accept_name(self) -> None:
        """Answer the name with 1: the file can be sent."""
        self._line.reply("download_name")

    def chunk_frame(self, chunk: Chunk, byte_order: str = "") -> Frame:
        """Return the frame of a chunk. Its buffer may exceed the size of a fileData."""
        dialect = self._subject.dialect
        spoken = dialect.replace(endian=byte_order) if byte_order else dialect
        data = FILE_DATA.encode(chunk._replace(buffer=chunk.buffer[:BUFFER_BYTES]), spoken)
        opcode = BY_NAME["download_chunk"].opcode
        return Frame(C2A, opcode, data + chunk.buffer[BUFFER_BYTES:])

    def offer_chunk(
        self, chunk: Chunk, *, data: bytes | None = None, byte_order: str = ""
    ) -> bool | None:
        """Send a chunk, or other data in its place.

        Returns:
            Whether the client accepts it; None without an answer.
        """
        frame = self.chunk_frame(chunk, byte_order)
        self._line.send_frame(frame if data is None else frame._replace(data=data))
        taken = self.await_answer()
        self.received += chunk.data if taken else b""
        return taken

    def await_answer(self) -> bool | None:
        """Return whether the client accepts the chunk; None without an answer."""
        timeout_s = self._subject.silence_s
        answer = request_or_none(self._subject, self._line, self.call, "download_chunk", timeout_s)
        return answer.accepted if answer else None

    def send_chunk(self, chunk: Chunk, requirement: str = "5.3/5") -> None:
        """Send a chunk that the client must accept.

        Raises:
            CaseFailed: It does not.
        """
        self._line.send_frame(self.chunk_frame(chunk))
        self.expect_taken(chunk, requirement)

    def expect_taken(self, chunk: Chunk, requirement: str = "5.3/5") -> None:
        """Wait for the answer to a chunk that the client must accept.

        Raises:
            CaseFailed: The client refuses it, or does not answer.
        """
        answer = request_or_none(self._subject, self._line, self.call, "download_chunk")
        if answer is None or not answer.accepted:
            self._subject.require_timely(self.call)
        if answer is None:
            error = self._line.no_reply_error(
                UserMessage(
                    "the client did not answer the chunk at {position} of a file of"
                    " {size_bytes} bytes",
                    position=chunk.position,
                    size_bytes=chunk.file_size,
                )
            )
            error.requirement = "5.3/5"
            if self.call.answer is not None:
                error.observed = f"{error.observed}; {self.call}"
            raise error
        expect(
            answer.accepted,
            UserMessage(
                "the client refused the chunk at {position} of a file of {size_bytes} bytes",
                position=chunk.position,
                size_bytes=chunk.file_size,
            ),
            expected="1",
            observed=f"{answer}",
            requirement=requirement,
        )
        self.received += chunk.data

    def expect_done(self, requirement: str = "5.3/11") -> None:
        """Require that the download succeeds and the local file holds what was received.

        Raises:
            CaseFailed: It does not.
        """
        expect_transfer_done(self._subject, self.call)
        size_bytes, content = len(self.received), self.received
        confirmed = self._subject.confirm_with_operator(
            UserMessage("{local} holds {size_bytes} bytes", local=self.local, size_bytes=size_bytes)
        )
        stored = self.stored
        if confirmed or (confirmed is None and stored == content):
            return
        got = stored or b""
        pairs = enumerate(zip(got, content, strict=False))
        at = next((i for i, (a, b) in pairs if a != b), min(len(got), size_bytes))
        seen = f"{len(got)} bytes, at {at}: {got[at : at + 8].hex(' ')}"
        raise CaseFailed(
            UserMessage(
                "the client stored a downloaded file of {size_bytes} bytes incorrectly",
                size_bytes=size_bytes,
            ),
            expected=f"{size_bytes} bytes, at {at}: {content[at : at + 8].hex(' ')}",
            observed="no file" if stored is None else seen,
            requirement=requirement,
        )

    def expect_failed(self, requirement: str = "5.2/19") -> None:
        """Require that the download fails. Its local file may hold only what was received.

        Raises:
            CaseFailed: It does not fail, or the file holds something else.
        """
        expect_transfer_failed(self._subject, self.call, requirement)
        stored, received = self.stored, self.received
        if stored is None:
            return
        room = stored.startswith(received) and not any(stored[len(received) :])
        expect(
            room or received.startswith(stored),
            "the file of an interrupted download differs from the received data",
            expected=f"no file, or the {len(received)} bytes received",
            observed=f"{len(stored)} bytes",
            requirement="5.3/11",
        )
        message = "the data of an interrupted download stays on the disk"
        self._subject.tolerate("5.3/11", "A-5-12", "keep", message)


def begin_download(
    subject: ClientUnderTest, line: IncomingConnection, remote: str = ""
) -> Download:
    """Begin a download and accept its name.

    Raises:
        CaseFailed: The name is not sent.
    """
    download = Download(subject, line, remote)
    download.accept_name()
    return download


def send_download(
    subject: ClientUnderTest,
    line: IncomingConnection,
    content: bytes,
    requirement: str = "5.3/11",
    remote: str = "",
) -> None:
    """Let the client download a file, and compare the local file.

    Raises:
        CaseFailed: The client does not store the file correctly.
    """
    download = begin_download(subject, line, remote)
    for chunk in chunks_of(content):
        download.send_chunk(chunk)
    download.expect_done(requirement)
