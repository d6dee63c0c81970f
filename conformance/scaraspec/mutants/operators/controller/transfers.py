"""Transferring: where faults of clause 5 take hold: what is sent of a file, and who judges chunks.

No fault is entered here.
"""

from collections.abc import Iterable
from typing import ClassVar

from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

CHUNK = 0x56


class AltersChunks(ControllerCore):
    """Sends other chunks of a download than it should."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """What is sent in place of a chunk."""
        return (chunk,)

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        for each in self.altered(chunk):
            super()._send_chunk(session, each)


class AltersChunkData(ControllerCore):
    """Sends the chunks of a download in other bytes than it should."""

    def data(self, chunk: Chunk) -> bytes:
        """The data of a chunk frame."""
        return FILE_DATA.encode(chunk, self.dialect)

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        self.send_after_reply(session, Frame(C2A, CHUNK, self.data(chunk)))


class JudgesChunks(ControllerCore):
    """Judges the chunks of an upload by another receiver."""

    receiver: ClassVar[type[Receiver]] = Receiver

    def judge(self, request: Request) -> Receiver:
        """The receiver of an upload."""
        return self.receiver(request.now_s, self.dialect)

    def upload_name(self, request: Request) -> bool:
        """Put the other receiver in."""
        accepted = super().upload_name(request)
        transfer = request.session.transfer
        if accepted and transfer is not None:
            request.session.transfer = transfer._replace(end=self.judge(request))
        return accepted


class AltersContent(ControllerCore):
    """Stores something else than was sent."""

    def kept(self, content: bytes) -> bytes:
        """What is stored of a file."""
        return content

    def _write(self, name: bytes, content: bytes) -> bool:
        return super()._write(name, self.kept(content))


class SendsAfterTheEnd(ControllerCore):
    """Does something more when a transfer is complete."""

    def uploaded(self, session: Session, name: bytes) -> None:
        """An upload is complete."""

    def downloaded(self, session: Session, name: bytes) -> None:
        """A download is complete."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """See whether it was the last."""
        transfer = request.session.transfer
        taken = super().upload_chunk(request)
        if taken is True and transfer is not None and request.session.transfer is None:
            self.uploaded(request.session, transfer.name)
        return taken

    def download_chunk(self, request: Request) -> Silence:
        """See whether it was the last."""
        transfer = request.session.transfer
        answer = super().download_chunk(request)
        ended = transfer is not None and isinstance(transfer.end, Sender)
        if transfer is not None and ended and request.session.transfer is None and request.value:
            self.downloaded(request.session, transfer.name)
        return answer
