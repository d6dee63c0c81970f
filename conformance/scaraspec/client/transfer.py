"""File transfers (clause 5) as pending operations: the name, its reply, then chunk by chunk.

`protocol.transfer` decides which chunks are valid and when a transfer ends; `local_files` reads and
writes the local file.
"""

from typing import ClassVar, Final

from scaraspec.client.errors import ClientError, Refused, TransferFailed
from scaraspec.client.pending_operation import PendingOperation, Progress, Stage
from scaraspec.client.replies import interpret_reply
from scaraspec.protocol.commands import BY_NAME, Command, Parsed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import PayloadError, show
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import Dialect
from scaraspec.protocol.transfer import Chunk, Receiver, Sender, TransferState
from scaraspec.user_message import UserMessage, sentence_of

_UPLOAD_NAME: Final = BY_NAME["upload_name"]
_UPLOAD_CHUNK: Final = BY_NAME["upload_chunk"]
_DOWNLOAD_NAME: Final = BY_NAME["download_name"]
_DOWNLOAD_CHUNK: Final = BY_NAME["download_chunk"]

_TIMEOUT_MARGIN_S: Final = 0.001
"""等待时间超过 30 秒: the timeout expires after the limit, not at it (L795)."""


def chunk_reply(*, accepted: bool, dialect: Dialect) -> Frame:
    """Return the reply to a chunk of a download (L782-785)."""
    data = _DOWNLOAD_CHUNK.reply.encode(accepted, dialect)
    return Frame(A2C, _DOWNLOAD_CHUNK.opcode, data)


class FileTransfer(PendingOperation):
    """Base class of both directions: one transfer at a time (A-5-17), 30 s timeout, byte count.

    Attributes:
        moved_bytes: How many bytes of the file the receiver has confirmed.
        total_bytes: Size of the file; None while unknown.
    """

    def __init__(self, command: Command, name: bytes, dialect: Dialect) -> None:
        super().__init__(command, name, dialect)
        self.moved_bytes = 0
        self.total_bytes: int | None = None
        self._reported_bytes = 0
        self._description = f"{command.name.removesuffix('_name')} of {show(name)!r}"
        self._aborted = False

    @property
    def slot(self) -> str:
        """The key that uploads and downloads share."""
        return "transfer"

    @property
    def awaited_command(self) -> str:
        """None: after the timeout the transfer has ended for both sides, and no reply is due."""
        return ""

    @property
    def has_progress(self) -> bool:
        """Whether bytes were transferred since the last report."""
        return self.moved_bytes > self._reported_bytes

    def report(self, progress: Progress | None) -> None:
        """Call `progress` if bytes were transferred since the last report."""
        if self.has_progress:
            self._reported_bytes = self.moved_bytes
            if progress is not None:
                progress(self.moved_bytes, self.total_bytes)

    def expire(self, now_s: float) -> list[Frame]:  # noqa: ARG002 - nothing is repeated
        """Fail the transfer; the link stays usable (5.4/6)."""
        self._fail_transfer(
            UserMessage(
                "no frame for {timeout_s:g} s (L763, L795)",
                timeout_s=self._dialect.seconds("xfer_timeout"),
            )
        )
        return []

    def abort(self) -> None:
        """Abort at the next frame, when the controller can be notified."""
        self._aborted = True

    def _send_request(self, now_s: float) -> list[Frame]:
        self._restart_timeout(now_s)
        return [self._request]

    def _restart_timeout(self, now_s: float) -> None:
        """Restart the timeout for the next frame; it also applies to the name's reply (L763)."""
        self._start_timeout("xfer_timeout", now_s)
        if self.deadline_s is not None:
            self.deadline_s += _TIMEOUT_MARGIN_S

    @property
    def _likely_reading(self) -> tuple[str]:
        """Why the first chunk of a transfer fails most often; empty after it."""
        other = "little" if self._dialect["endian"] == "big" else "big"
        return (f"; the reading of the controller may be endian={other}" * (not self.moved_bytes),)

    def _fail_transfer(self, reason: str) -> None:
        self.fail(TransferFailed(self._description, reason))


class Upload(FileTransfer):
    """Upload of a file to the controller (5.2): a chunk, its reply, the next chunk (5.2/7).

    Args:
        name: Name of the file on the controller.
        content: Content of the file.
        dialect: The readings; they decide whether and how an empty file is sent (A-5-10).

    Raises:
        PayloadError: The name or the file cannot be sent.
    """

    sender: ClassVar[type[Sender]] = Sender
    """The class that splits the file into chunks; mutants replace it."""

    def __init__(self, name: bytes, content: bytes, dialect: Dialect) -> None:
        super().__init__(_UPLOAD_NAME, name, dialect)
        if not content and dialect["empty_file"] == "refused":
            raise PayloadError("an empty file cannot be transferred (L787; A-5-10)")
        if len(content) >= 2**32:
            raise PayloadError("a file of 4 GiB or more cannot be transferred (L719)")
        self.total_bytes = len(content)
        self._content = content
        self._sender: Sender | None = None

    def expects(self, frame: Frame, parsed: Parsed) -> bool:  # noqa: ARG002 - `parsed` suffices
        """Expect the reply to the name, then the reply to each chunk."""
        command = _UPLOAD_NAME if self.stage is Stage.REQUESTED else _UPLOAD_CHUNK
        return parsed.part == "reply" and parsed.command is command

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Send the next chunk after a ``1``; fail after any other reply (A-5-14)."""
        try:
            interpret_reply(parsed, data)
        except Refused:
            self._fail_transfer(
                "the controller refused the name; the file may exist already (L748)"
                if self.stage is Stage.REQUESTED
                else UserMessage.joined(
                    UserMessage(
                        "the controller refused the chunk at byte {position} (L758)",
                        position=self.moved_bytes,
                    ),
                    *self._likely_reading,
                )
            )
        except ClientError as error:
            self._fail_transfer(sentence_of(error))
        else:
            self._restart_timeout(now_s)
            chunk = self._next(now_s) if self._content else self._next_of_empty_file()
            if chunk is not None:
                data = _UPLOAD_CHUNK.request.encode(chunk, self._dialect)
                return [Frame(A2C, _UPLOAD_CHUNK.opcode, data)]
        return []

    def _next(self, now_s: float) -> Chunk | None:
        """Return the next chunk; None after the last one."""
        if self._sender is None:
            self.accepted, self.stage = True, Stage.EXECUTING
            self._sender = self.sender(self._content, now_s, self._dialect)
        else:
            self._sender.acknowledge(accepted=True, now_s=now_s)
            self.moved_bytes = self._sender.acknowledged_bytes
        if self._sender.state is TransferState.DONE:
            self.settle(None)
            return None
        if self._aborted:
            self._fail_transfer("it was aborted")
            return Chunk(len(self._content), self.moved_bytes, 0, b"")  # the error signal (L787)
        return self._sender.next_chunk()

    def _next_of_empty_file(self) -> Chunk | None:
        """Return the next chunk of an empty file: none, or one of length 0 (A-5-10)."""
        if self.stage is Stage.REQUESTED and self._dialect["empty_file"] == "chunk":
            self.accepted, self.stage = True, Stage.EXECUTING
            return Chunk(0, 0, 0, b"")
        self.settle(None)
        return None


class Download(FileTransfer):
    """Download of a file from the controller (5.3); the value is the content of the file.

    Args:
        name: Name of the file on the controller.
        limit_bytes: Largest accepted file.
        dialect: The readings; they decide which order of chunks is accepted.

    Raises:
        PayloadError: The name cannot be sent.
    """

    receiver: ClassVar[type[Receiver]] = Receiver
    """The class that checks the chunks; mutants replace it."""

    def __init__(self, name: bytes, limit_bytes: int, dialect: Dialect) -> None:
        super().__init__(_DOWNLOAD_NAME, name, dialect)
        self._limit_bytes = limit_bytes
        self._receiver: Receiver | None = None

    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        """Expect the reply to the name, then the chunks, which are requests (A-5-19)."""
        if self._receiver is None:
            return super().expects(frame, parsed)
        return parsed.part == "request" and parsed.command is _DOWNLOAD_CHUNK

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Process the reply to the name, or reply to a chunk; each once (5.3/5)."""
        self._restart_timeout(now_s)
        receiver = self._receiver
        if receiver is None:
            self._take_name_reply(parsed, data, now_s)
            return []
        if self._aborted:
            receiver.fail("it was aborted")
            accepted: bool | None = False
        else:
            accepted = receiver.receive_chunk(data, now_s)
        self.moved_bytes, self.total_bytes = receiver.received_bytes, receiver.size_bytes
        if receiver.state is TransferState.DONE:
            self.settle(receiver.content)
        elif receiver.state is TransferState.FAILED:
            self._fail_transfer(UserMessage.joined(receiver.reason, *self._likely_reading))
        if accepted is None:
            return []
        return [chunk_reply(accepted=accepted, dialect=self._dialect)]

    def _take_name_reply(self, parsed: Parsed, data: bytes, now_s: float) -> None:
        try:
            interpret_reply(parsed, data)
        except Refused:
            self._fail_transfer("the controller refused the name; the file may not exist (L772)")
        except ClientError as error:
            self._fail_transfer(sentence_of(error))
        else:
            self.accepted, self.stage = True, Stage.EXECUTING
            self._receiver = self.receiver(now_s, self._dialect, limit_bytes=self._limit_bytes)
