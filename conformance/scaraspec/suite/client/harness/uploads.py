"""Uploads: how the suite, as the controller, receives a file from the client.

Each check here names its own requirement, whatever requirement the case has. Cases about failing
uploads send their own answers.
"""

from collections.abc import Iterator
from pathlib import Path

from scaraspec.protocol.transfer import BUFFER_BYTES, Chunk, chunks_of
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.files import (
    MAX_RETRIES,
    SLICE_S,
    expect_named_file,
    expect_transfer_done,
    expect_transfer_failed,
    is_abort_signal,
    request_or_none,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.chunks import chunk_of, expect_next
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.user_message import UserMessage


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
        expect_named_file(line, self.call, remote, "5.2/1")
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
        for _ in range(MAX_RETRIES):
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
        due_data = self._content[due : due + chunk.length]
        expect(
            chunk.data == due_data,
            UserMessage("the chunk at {position} differs from the file", position=due),
            expected=due_data.hex(" "),
            observed=chunk.data.hex(" "),
            requirement="5.2/20",
        )
        return chunk


def serve_read_back(
    subject: ClientUnderTest, line: IncomingConnection, call: Call, content: bytes
) -> None:
    """Serve a client that downloads the file after an upload to compare it (A-5-21)."""
    deadline_s = subject.access.now_s + subject.answer_timeout_s
    while not (subject.access.attended or line.ended or subject.answers_within(call, SLICE_S)):
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
