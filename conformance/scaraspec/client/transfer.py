"""File transfers (clause 5) as exchanges: a name, its answer, then chunk by chunk.

What a chunk may be, and when a transfer is over, stands in `protocol.transfer`; what becomes of
the file on this side in `files`.
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
from scaraspec.protocol.transfer import Chunk, Receiver, Sender, State

_UPLOAD_NAME: Final = BY_NAME["upload_name"]
_UPLOAD_CHUNK: Final = BY_NAME["upload_chunk"]
_DOWNLOAD_NAME: Final = BY_NAME["download_name"]
_DOWNLOAD_CHUNK: Final = BY_NAME["download_chunk"]

_BEYOND_S: Final = 0.001
"""等待时间超过 30 秒: given up not at the limit but beyond it (L795)."""


def chunk_reply(*, accepted: bool, dialect: Dialect) -> Frame:
    """The answer to a chunk of a download (L782-785)."""
    data = _DOWNLOAD_CHUNK.reply.encode(accepted, dialect)
    return Frame(A2C, _DOWNLOAD_CHUNK.opcode, data)


class FileTransfer(PendingOperation):
    """What both directions share: one at a time (A-5-17), 30 s of patience, a count of bytes.

    Attributes:
        moved_bytes: How much of the file is known to have arrived at the other end.
        total_bytes: Its size; None until it is known.
    """

    def __init__(self, command: Command, name: bytes, dialect: Dialect) -> None:
        super().__init__(command, name, dialect)
        self.moved_bytes = 0
        self.total_bytes: int | None = None
        self._reported_bytes = 0
        self._what = f"{command.name.removesuffix('_name')} of {show(name)!r}"
        self._aborted = False

    @property
    def slot(self) -> str:
        """One for both directions."""
        return "transfer"

    @property
    def has_progress(self) -> bool:
        """Whether bytes have moved that nobody was told of."""
        return self.moved_bytes > self._reported_bytes

    def report(self, progress: Progress | None) -> None:
        """Tell how far it is, if that has changed."""
        if self.has_progress:
            self._reported_bytes = self.moved_bytes
            if progress is not None:
                progress(self.moved_bytes, self.total_bytes)

    def expire(self, now_s: float) -> list[Frame]:  # noqa: ARG002 - nothing is asked again
        """Give up; the link stays usable (5.4/6)."""
        seconds = self._dialect.seconds("xfer_timeout")
        self._fail_transfer(f"nothing heard for {seconds:g} s (L763, L795)")
        return []

    def abort(self) -> None:
        """End it at the next frame, which is the first occasion to say so."""
        self._aborted = True

    def _send_request(self, now_s: float) -> list[Frame]:
        self._restart_timeout(now_s)
        return [self._request]

    def _restart_timeout(self, now_s: float) -> None:
        """Wait for the next frame; the 30 s hold for the answer to the name too (L763)."""
        self._start_timeout("xfer_timeout", now_s)
        if self.deadline_s is not None:
            self.deadline_s += _BEYOND_S

    def _fail_transfer(self, reason: str) -> None:
        self.fail(TransferFailed(self._what, reason))


class Upload(FileTransfer):
    """The client sends a file (5.2): one chunk, its answer, the next chunk (5.2/7).

    Args:
        name: The file's name on the controller.
        content: Its bytes.
        dialect: Among others whether, and how, an empty file is sent (A-5-10).

    Raises:
        PayloadError: The name or the file cannot be sent.
    """

    sender: ClassVar[type[Sender]] = Sender
    """What cuts the file; an upload that is wrong on purpose has another one."""

    def __init__(self, name: bytes, content: bytes, dialect: Dialect) -> None:
        super().__init__(_UPLOAD_NAME, name, dialect)
        if not content and dialect["empty_file"] == "refused":
            raise PayloadError("an empty file cannot be transferred (L787; A-5-10)")
        if len(content) >= 2**32:
            raise PayloadError("a file of 4 GiB or more cannot be transferred (L719)")
        self.total_bytes = len(content)
        self._content = content
        self._sender: Sender | None = None

    def expects(self, frame: Frame, parsed: Parsed) -> bool:  # noqa: ARG002 - the table tells it
        """The answer to the name, then to each chunk."""
        awaited = _UPLOAD_NAME if self.stage is Stage.REQUESTED else _UPLOAD_CHUNK
        return parsed.part == "reply" and parsed.command is awaited

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Send the next chunk after a ``1``; stop after anything else (A-5-14)."""
        try:
            interpret_reply(parsed, data)
        except Refused:
            self._fail_transfer(
                "the controller refused its name; perhaps it has such a file (L748)"
                if self.stage is Stage.REQUESTED
                else f"the controller refused the chunk at {self.moved_bytes} (L758)"
            )
        except ClientError as error:
            self._fail_transfer(str(error))
        else:
            self._restart_timeout(now_s)
            chunk = self._next(now_s) if self._content else self._next_of_empty_file()
            if chunk is not None:
                data = _UPLOAD_CHUNK.request.encode(chunk, self._dialect)
                return [Frame(A2C, _UPLOAD_CHUNK.opcode, data)]
        return []

    def _next(self, now_s: float) -> Chunk | None:
        """The chunk that follows what was just answered; None behind the last."""
        if self._sender is None:
            self.accepted, self.stage = True, Stage.EXECUTING
            self._sender = self.sender(self._content, now_s, self._dialect)
        else:
            self._sender.acknowledge(accepted=True, now_s=now_s)
            self.moved_bytes = self._sender.acknowledged_bytes
        if self._sender.state is State.DONE:
            self.settle(None)
            return None
        if self._aborted:
            self._fail_transfer("it was aborted")
            return Chunk(len(self._content), self.moved_bytes, 0, b"")  # the error signal (L787)
        return self._sender.next_chunk()

    def _next_of_empty_file(self) -> Chunk | None:
        """The same for an empty file: a name alone, or one chunk of length 0 (A-5-10)."""
        if self.stage is Stage.REQUESTED and self._dialect["empty_file"] == "chunk":
            self.accepted, self.stage = True, Stage.EXECUTING
            return Chunk(0, 0, 0, b"")
        self.settle(None)
        return None


class Download(FileTransfer):
    """The controller sends a file (5.3); its content is the value of the exchange.

    Args:
        name: The file's name on the controller.
        limit_bytes: The largest file that is taken.
        dialect: Among others which order of chunks is taken.

    Raises:
        PayloadError: The name cannot be sent.
    """

    receiver: ClassVar[type[Receiver]] = Receiver
    """What judges the chunks; a download that is wrong on purpose has another one."""

    def __init__(self, name: bytes, limit_bytes: int, dialect: Dialect) -> None:
        super().__init__(_DOWNLOAD_NAME, name, dialect)
        self._limit_bytes = limit_bytes
        self._receiver: Receiver | None = None

    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        """The answer to the name, then each chunk, which is the controller's request (A-5-19)."""
        if self._receiver is None:
            return super().expects(frame, parsed)
        return parsed.part == "request" and parsed.command is _DOWNLOAD_CHUNK

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Take the answer to the name, or answer a chunk, once each (5.3/5)."""
        self._restart_timeout(now_s)
        receiver = self._receiver
        if receiver is None:
            self._take_name_reply(parsed, data, now_s)
            return []
        if self._aborted:
            receiver.fail("it was aborted")
            accepted: bool | None = False
        else:
            accepted = receiver.take(data, now_s)
        self.moved_bytes, self.total_bytes = receiver.received_bytes, receiver.size_bytes
        if receiver.state is State.DONE:
            self.settle(receiver.content)
        elif receiver.state is State.FAILED:
            self._fail_transfer(receiver.reason)
        if accepted is None:
            return []
        return [chunk_reply(accepted=accepted, dialect=self._dialect)]

    def _take_name_reply(self, parsed: Parsed, data: bytes, now_s: float) -> None:
        try:
            interpret_reply(parsed, data)
        except Refused:
            self._fail_transfer("the controller cannot send it; perhaps it has no such file (L772)")
        except ClientError as error:
            self._fail_transfer(str(error))
        else:
            self.accepted, self.stage = True, Stage.EXECUTING
            self._receiver = self.receiver(now_s, self._dialect, limit_bytes=self._limit_bytes)
