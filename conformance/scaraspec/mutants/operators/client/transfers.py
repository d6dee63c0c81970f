"""Transferring: where faults of clause 5 take hold: what is sent of a file, and what is taken.

No fault is entered here.
"""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES, ClientCore, Event
from scaraspec.client.operations import Text
from scaraspec.client.pending_operation import Progress, Stage
from scaraspec.client.transfer import Download, FileTransfer, Upload
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender, State

UPLOAD_NAME, UPLOAD_CHUNK, DOWNLOAD_NAME, DOWNLOAD_CHUNK = 0x50, 0x52, 0x54, 0x56


class AltersFrames(ClientCore):
    """Sends other frames than it should."""

    def altered(self, frame: Frame) -> Iterable[Frame]:
        """What is sent in place of a frame."""
        return (frame,)

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(each for frame in frames for each in self.altered(frame))


class AltersChunkData(AltersFrames):
    """Sends the chunks of an upload in other bytes than it should."""

    def data(self, chunk: Chunk) -> bytes:
        """The data of a chunk frame."""
        return FILE_DATA.encode(chunk, self.dialect)

    def altered(self, frame: Frame) -> Iterable[Frame]:
        """Write the chunk anew."""
        if frame.opcode == UPLOAD_CHUNK:
            chunk: Chunk = FILE_DATA.decode(frame.data).value
            frame = frame._replace(data=self.data(chunk))
        return (frame,)


class AltersChunks(AltersChunkData):
    """Sends other chunks of an upload than it should."""

    def other(self, chunk: Chunk) -> Chunk:
        """What is sent in place of a chunk."""
        return chunk

    def data(self, chunk: Chunk) -> bytes:
        """The other chunk."""
        return super().data(self.other(chunk))


class UploadsOtherwise(ClientCore):
    """Uploads in its own way."""

    way: ClassVar[type[Upload]] = Upload

    def upload(self, name: bytes, content: bytes) -> Upload:
        """The upload."""
        return self.way(name, content, self.dialect)


class CutsOtherwise(ClientCore):
    """Cuts files in its own way."""

    sender: ClassVar[type[Sender]] = Sender

    def upload(self, name: bytes, content: bytes) -> Upload:
        """The upload, with the other sender."""
        way: type[Upload] = type("Cut", (Upload,), {"sender": self.sender})
        return way(name, content, self.dialect)


class DownloadsOtherwise(ClientCore):
    """Downloads in its own way."""

    way: ClassVar[type[Download]] = Download

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        """The download."""
        return self.way(name, limit_bytes, self.dialect)


class JudgesChunks(ClientCore):
    """Judges the chunks of a download by another receiver."""

    receiver: ClassVar[type[Receiver]] = Receiver

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        """The download, with the other receiver."""
        way: type[Download] = type("Judged", (Download,), {"receiver": self.receiver})
        return way(name, limit_bytes, self.dialect)


class AltersContent(ClientCore):
    """Sends the content of another file than it should."""

    def read(self, content: bytes) -> bytes:
        """What is made of the file."""
        return content

    def upload(self, name: bytes, content: bytes) -> Upload:
        """The upload of that."""
        return super().upload(name, self.read(content))


class KeepsOtherwise(ClientCore):
    """Keeps something else than was sent."""

    def kept(self, content: bytes) -> bytes:
        """What is kept of a file."""
        return content

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        """The download, which ends with that."""
        kept = self.kept

        class Kept(Download):
            def settle(self, value: Any) -> None:
                super().settle(kept(value))

        return Kept(name, limit_bytes, self.dialect)


class Careless(Receiver):
    """Takes every chunk wherever it belongs; what reaches the end of the file ends it."""

    def take(self, data: bytes, now_s: float) -> bool | None:
        """Take it."""
        taken = super().take(data, now_s)
        last = FILE_DATA.decode(data).value
        if taken and last is not None and last.last:
            self.state = State.DONE
        return taken

    def _problem(self, chunk: Chunk) -> str:
        return "" if chunk.legal else super()._problem(chunk)


class Forever(FileTransfer):
    """Waits without end."""

    def _restart_timeout(self, now_s: float) -> None:
        """Set no alarm."""


class Hurried(FileTransfer):
    """Waits as long as other commands do."""

    def _restart_timeout(self, now_s: float) -> None:
        self._start_timeout("reply_timeout", now_s)


class Lazy(FileTransfer):
    """Waits for more than a minute."""

    def _restart_timeout(self, now_s: float) -> None:
        self.deadline_s = now_s + 75


class InAll(FileTransfer):
    """Waits for 30 s, all waits together."""

    def _restart_timeout(self, now_s: float) -> None:
        if self.deadline_s is None:
            super()._restart_timeout(now_s)


class ForeverAtFirst(FileTransfer):
    """Waits for the answer to its name without end."""

    def _restart_timeout(self, now_s: float) -> None:
        if self.stage is not Stage.REQUESTED:
            super()._restart_timeout(now_s)


class PutsOff(ClientCore):
    """Whatever comes puts off the end of the transfers of one kind."""

    way: ClassVar[type[FileTransfer]]

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Wait anew."""
        events = super().feed(data, now_s)
        for transfer in self._open:
            if isinstance(transfer, self.way):
                transfer._restart_timeout(now_s)  # noqa: SLF001 - the fault is in there
        return events


class MeetsFiles(AsyncClient):
    """Does something of its own where a file is to be sent, or to be made."""

    def sends(self, local: Path, remote: Text | None) -> Text | None:
        """The name to send it under; None where nothing is to be sent."""
        return local.name if remote is None else remote

    def makes(self, local: Path) -> bool:  # noqa: ARG002 - others look at it
        """Whether to go on."""
        return True

    async def upload(
        self,
        local: str | PathLike[str],
        remote: Text | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Ask first."""
        name = self.sends(Path(local), remote)
        if name is not None:
            await super().upload(local, name, progress)

    async def download(
        self,
        remote: Text,
        local: str | PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Path:
        """Ask first."""
        path = Path(str(remote) if local is None else local)
        return await super().download(remote, path, progress) if self.makes(path) else path
