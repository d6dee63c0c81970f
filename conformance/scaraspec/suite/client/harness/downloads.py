"""Downloads: how the suite, as the controller, sends a file to the client.

Each check here names its own requirement, whatever requirement the case has. Cases about failing
downloads send their own chunks with `Download.offer_chunk`.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk, chunks_of
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.files import (
    expect_named_file,
    expect_transfer_done,
    expect_transfer_failed,
    request_or_none,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.user_message import UserMessage


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
        expect_named_file(line, self.call, remote, "5.3/1")

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
        used = dialect.replace(endian=byte_order) if byte_order else dialect
        data = FILE_DATA.encode(chunk._replace(buffer=chunk.buffer[:BUFFER_BYTES]), used)
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
        seen = UserMessage(
            "{count} bytes, at {offset}: {data}",
            count=len(got),
            offset=at,
            data=got[at : at + 8].hex(" "),
        )
        raise CaseFailed(
            UserMessage(
                "the client stored a downloaded file of {size_bytes} bytes incorrectly",
                size_bytes=size_bytes,
            ),
            expected=UserMessage(
                "{count} bytes, at {offset}: {data}",
                count=size_bytes,
                offset=at,
                data=content[at : at + 8].hex(" "),
            ),
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
            expected=UserMessage("no file, or the {count} bytes received", count=len(received)),
            observed=UserMessage("{count} bytes", count=len(stored)),
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
