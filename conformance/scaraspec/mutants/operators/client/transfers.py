"""Operators that change file transfers of the reference client (clause 5)."""

from collections.abc import Callable, Iterable
from os import PathLike
from pathlib import Path
from typing import Any, Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES, ClientCore, Event
from scaraspec.client.operations import Text
from scaraspec.client.pending_operation import Progress, Stage
from scaraspec.client.transfer import Download, FileTransfer, Upload
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender, TransferState

UPLOAD_NAME: Final = 0x50
UPLOAD_CHUNK: Final = 0x52
DOWNLOAD_NAME: Final = 0x54
DOWNLOAD_CHUNK: Final = 0x56


def chunk_data(write: Callable[[Chunk, Dialect], bytes]) -> type[ClientCore]:
    """The chunks of uploads are encoded by `write`."""

    class ChunkData(ClientCore):
        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._written, frames))

        def _written(self, frame: Frame) -> Frame:
            if frame.opcode != UPLOAD_CHUNK:
                return frame
            return frame._replace(data=write(FILE_DATA.decode(frame.data).value, self.dialect))

    return ChunkData


def chunks(change: Callable[[Chunk], Chunk]) -> type[ClientCore]:
    """The chunks of uploads are changed before they are encoded."""
    return chunk_data(lambda chunk, dialect: FILE_DATA.encode(change(chunk), dialect))


def uploads(*bases: type[FileTransfer]) -> type[ClientCore]:
    """Uploads are instances of a class with these bases."""
    made: Any = type("OtherUpload", bases, {})

    class Uploads(ClientCore):
        def upload(self, name: bytes, content: bytes) -> Upload:
            upload: Upload = made(name, content, self.dialect)
            return upload

    return Uploads


def downloads(*bases: type[FileTransfer]) -> type[ClientCore]:
    """Downloads are instances of a class with these bases."""
    made: Any = type("OtherDownload", bases, {})

    class Downloads(ClientCore):
        def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
            download: Download = made(name, limit_bytes, self.dialect)
            return download

    return Downloads


def chunks_cut_by(sender: type[Sender]) -> type[ClientCore]:
    """Uploads are split into chunks by another class."""
    return uploads(type("Cut", (Upload,), {"sender": sender}))


def chunks_checked_by(receiver: type[Receiver]) -> type[ClientCore]:
    """The chunks of downloads are checked and stored by another class."""
    return downloads(type("Checked", (Download,), {"receiver": receiver}))


def chunk_taken(change: Callable[[bytes], bytes]) -> type[ClientCore]:
    """The data of a downloaded chunk are changed before they are checked."""

    class ChunkTaken(Receiver):
        def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
            return super().receive_chunk(change(data), now_s)

    return chunks_checked_by(ChunkTaken)


def ends_with(condition: Callable[[Receiver, Chunk], bool]) -> type[ClientCore]:
    """A download ends with the accepted chunk that satisfies the condition."""

    class EndsWith(Receiver):
        def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
            taken = super().receive_chunk(data, now_s)
            if taken and condition(self, FILE_DATA.decode(data).value):
                self.state = TransferState.DONE
            return taken

    return chunks_checked_by(EndsWith)


def upload_content(change: Callable[[bytes], bytes]) -> type[ClientCore]:
    """The content of a file is changed before it is uploaded."""

    class UploadContent(ClientCore):
        def upload(self, name: bytes, content: bytes) -> Upload:
            return super().upload(name, change(content))

    return UploadContent


def download_content(change: Callable[[bytes], bytes]) -> type[ClientCore]:
    """The content of a file is changed after it was downloaded."""

    class DownloadContent(Download):
        def settle(self, value: Any) -> None:
            super().settle(change(value))

    return downloads(DownloadContent)


def upload_name(choose: Callable[[Path, Text], Text | None]) -> type[AsyncClient]:
    """`choose` returns the remote name of an upload, or None to send nothing."""

    class UploadName(AsyncClient):
        async def upload(
            self,
            local: str | PathLike[str],
            remote: Text | None = None,
            progress: Progress | None = None,
        ) -> None:
            path = Path(local)
            name = choose(path, path.name if remote is None else remote)
            if name is not None:
                await super().upload(local, name, progress)

    return UploadName


def before_download(act: Callable[[Path], bool]) -> type[AsyncClient]:
    """`act` is called with the local path of a download; False requests nothing."""

    class BeforeDownload(AsyncClient):
        async def download(
            self,
            remote: Text,
            local: str | PathLike[str] | None = None,
            progress: Progress | None = None,
        ) -> Path:
            path = Path(str(remote) if local is None else local)
            return await super().download(remote, path, progress) if act(path) else path

    return BeforeDownload


def timeout_restarts(kind: type[FileTransfer]) -> type[ClientCore]:
    """Any received bytes restart the timeout of transfers of one kind."""

    class TimeoutRestarts(ClientCore):
        def feed(self, data: bytes, now_s: float) -> list[Event]:
            events = super().feed(data, now_s)
            for transfer in self._open:
                if isinstance(transfer, kind):
                    transfer._restart_timeout(now_s)  # noqa: SLF001 - the fault is in there
            return events

    return TimeoutRestarts


class AnyOrder(Receiver):
    """Accepts every chunk within the file; a chunk that reaches its end ends the download."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        taken = super().receive_chunk(data, now_s)
        last = FILE_DATA.decode(data).value
        if taken and last is not None and last.last:
            self.state = TransferState.DONE
        return taken

    def _problem(self, chunk: Chunk) -> str:
        return "" if chunk.legal else super()._problem(chunk)


class NoTimeout(FileTransfer):
    """Waits without a timeout."""

    def _restart_timeout(self, now_s: float) -> None:
        pass


class ShortTimeout(FileTransfer):
    """Has the timeout of other commands."""

    def _restart_timeout(self, now_s: float) -> None:
        self._start_timeout("reply_timeout", now_s)


class LongTimeout(FileTransfer):
    """Has a timeout of 75 s."""

    def _restart_timeout(self, now_s: float) -> None:
        self.deadline_s = now_s + 75


class OneTimeout(FileTransfer):
    """Has one timeout for the whole transfer."""

    def _restart_timeout(self, now_s: float) -> None:
        if self.deadline_s is None:
            super()._restart_timeout(now_s)


class NoTimeoutForName(FileTransfer):
    """Waits without a timeout for the reply to the name."""

    def _restart_timeout(self, now_s: float) -> None:
        if self.stage is not Stage.REQUESTED:
            super()._restart_timeout(now_s)
