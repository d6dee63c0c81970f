"""Operators that change file transfers: chunks of downloads, receivers of uploads, the end."""

from collections.abc import Callable
from typing import Any

from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

Core = type[ControllerCore]
AtEnd = Callable[[ControllerCore, Session, bytes], Any]


def receiver_of(session: Session) -> Receiver | None:
    """The receiver of the upload in progress, if there is one."""
    end = session.transfer.end if session.transfer else None
    return end if isinstance(end, Receiver) else None


def sender_of(session: Session) -> Sender | None:
    """The sender of the download in progress, if there is one."""
    end = session.transfer.end if session.transfer else None
    return end if isinstance(end, Sender) else None


def send_chunk(core: ControllerCore, session: Session, chunk: Chunk) -> None:
    """Send a chunk of a download after the current first reply."""
    core.send_after_reply(session, Frame(C2A, 0x56, FILE_DATA.encode(chunk, core.dialect)))


def sent_chunk(change: Callable[[Chunk], Chunk | None]) -> Core:
    """The chunks of downloads are changed; a chunk that becomes None is not sent."""

    class SentChunk(ControllerCore):
        def _send_chunk(self, session: Session, chunk: Chunk) -> None:
            changed = change(chunk)
            if changed is not None:
                super()._send_chunk(session, changed)

    return SentChunk


def chunk_data(encode: Callable[[Chunk, Dialect], bytes]) -> Core:
    """`encode` encodes the chunks of downloads."""

    class ChunkData(ControllerCore):
        def _send_chunk(self, session: Session, chunk: Chunk) -> None:
            self.send_after_reply(session, Frame(C2A, 0x56, encode(chunk, self.dialect)))

    return ChunkData


def receives(*receivers: type[Receiver]) -> Core:
    """Uploads use this receiver class, or a class with these bases."""
    receiver = receivers[0] if len(receivers) == 1 else type("Receiver", receivers, {})

    class Receives(ControllerCore):
        def upload_name(self, request: Request) -> bool:
            accepted = super().upload_name(request)
            transfer = request.session.transfer
            if accepted and transfer is not None:
                end = receiver(request.now_s, self.dialect)
                request.session.transfer = transfer._replace(end=end)
            return accepted

    return Receives


def stored(change: Callable[[bytes], bytes]) -> Core:
    """The content of an upload is changed before it is stored."""

    class Stored(ControllerCore):
        def _write(self, name: bytes, content: bytes) -> bool:
            return super()._write(name, change(content))

    return Stored


class SendsAfterTheEnd(ControllerCore):
    """Base class: calls `uploaded` or `downloaded` when a transfer is complete."""

    def uploaded(self, session: Session, name: bytes) -> None:
        """Called when an upload is complete."""

    def downloaded(self, session: Session, name: bytes) -> None:
        """Called when a download is complete."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        transfer = request.session.transfer
        taken = super().upload_chunk(request)
        if taken is True and transfer is not None and request.session.transfer is None:
            self.uploaded(request.session, transfer.name)
        return taken

    def download_chunk(self, request: Request) -> Silence:
        transfer = request.session.transfer
        reply = super().download_chunk(request)
        sent = transfer is not None and isinstance(transfer.end, Sender)
        if transfer is not None and sent and request.session.transfer is None and request.value:
            self.downloaded(request.session, transfer.name)
        return reply


def after_upload(act: AtEnd) -> Core:
    """`act` is called with session and file name when an upload is complete."""
    return type("AfterUpload", (SendsAfterTheEnd,), {"uploaded": act})


def after_download(act: AtEnd) -> Core:
    """`act` is called with session and file name when a download is complete."""
    return type("AfterDownload", (SendsAfterTheEnd,), {"downloaded": act})
