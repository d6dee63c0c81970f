"""Mutants of clause 5.3: downloads, the replies to chunks, and the local file."""

from collections.abc import Callable, Iterable
from os import PathLike
from pathlib import Path
from typing import Any

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES, ClientCore, Event
from scaraspec.client.operations import Text
from scaraspec.client.pending_operation import Progress, Stage
from scaraspec.client.transfer import Download, chunk_reply
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import received_bytes, received_items, sent
from scaraspec.mutants.operators.client.messages import request_data
from scaraspec.mutants.operators.client.transfers import (
    DOWNLOAD_CHUNK,
    DOWNLOAD_NAME,
    AnyOrder,
    before_download,
    chunk_taken,
    chunks_checked_by,
    download_content,
    downloads,
)
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk, Receiver, TransferState

# The name

row(
    "names-of-eight-bytes",
    "5.3/1",
    "Only eight bytes of the name of a download are sent, as the document prints it.",
    request_data("download_name", lambda name: name[:8]),
)


@mutant("downloads-under-its-own-name", "5.3/1")
class DownloadsLocalName(AsyncClient):
    """A download requests the name of the new local file."""

    async def download(
        self,
        remote: Text,
        local: str | PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Path:
        return await super().download(Path(local).name if local else remote, local, progress)


@mutant("fetches-once", "5.3/11", subtle=True)
class CachesDownloads(AsyncClient):
    """A file that was downloaded once is copied from memory the next time."""

    _cache: dict[Text, bytes] | None = None

    async def download(
        self,
        remote: Text,
        local: str | PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Path:
        cache = self._cache = self._cache or {}
        if local and remote in cache:
            return _written(cache[remote], Path(local))
        path = await super().download(remote, local, progress)
        cache[remote] = path.read_bytes()
        return path


def _written(content: bytes, path: Path) -> Path:
    path.write_bytes(content)
    return path


# The refusal


class _WaitsAfterRefusal(Download):
    def _take_name_reply(self, parsed: Parsed, data: bytes, now_s: float) -> None:
        if data == b"0":
            self.stage, self.deadline_s = Stage.EXECUTING, now_s + 0.2
            self._receiver = self.receiver(now_s, self._dialect)
        else:
            super()._take_name_reply(parsed, data, now_s)


def _accepted_with_a_chunk(items: list[StreamItem]) -> Iterable[StreamItem]:
    chunk = any(isinstance(item, Frame) and item.opcode == DOWNLOAD_CHUNK for item in items)
    for item in items:
        if chunk and isinstance(item, Frame) and item.opcode == DOWNLOAD_NAME:
            yield item._replace(data=b"1")
        else:
            yield item


row(
    "refusal-takes-a-moment",
    "5.3/5 5.2/19",
    "A chunk within 0.2 s after the refusal of a download is accepted.",
    downloads(_WaitsAfterRefusal),
    subtle=True,
)
row(
    "chunk-overrides-the-refusal",
    "5.3/5 5.2/19",
    "The refusal of a download is ignored if a chunk arrives in the same segment.",
    received_items(_accepted_with_a_chunk),
    subtle=True,
)

# The replies


def _replies(change: Callable[[Download, list[Frame]], list[Frame]]) -> type[ClientCore]:
    """The frames that a download sends after a received frame are changed."""

    class Replies(Download):
        def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
            return change(self, super().take(parsed, data, now_s))

    return downloads(Replies)


class _AnswersName(Download):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        name_reply = self._receiver is None
        frames = super().take(parsed, data, now_s)
        go_on = chunk_reply(accepted=True, dialect=self._dialect)
        return [go_on] if name_reply and not self.settled else frames


row(
    "answers-each-chunk-twice",
    "5.3/5",
    "Each chunk is answered twice.",
    sent(lambda frame: (frame,) * (2 if frame.opcode == DOWNLOAD_CHUNK else 1)),
)
row(
    "leaves-the-last-chunk-unanswered",
    "5.3/5",
    "The last chunk of a download is not answered.",
    _replies(lambda download, frames: [] if download.settled and not download.error else frames),
)
row(
    "asks-for-the-first-chunk",
    "5.3/5",
    "The reply to the name of a download is answered like a chunk.",
    downloads(_AnswersName),
)
row(
    "never-answers-no",
    "5.3/5",
    "A chunk that is refused is not answered.",
    _replies(lambda download, frames: [] if download.error else frames),
    subtle=True,
)


@mutant("takes-unasked-chunks", "5.3/5")
class AcceptsStrayChunks(ClientCore):
    """A chunk outside a download is answered with 1."""

    def _refuse_stray_chunk(self, parsed: Parsed) -> None:
        if parsed.part == "request":
            self._send([chunk_reply(accepted=True, dialect=self.dialect)])


_NAME_REPLY = bytes((0xCC, DOWNLOAD_NAME, 1)) + b"1\xaa"

row(
    "drops-what-comes-with-the-promise",
    "5.3/5",
    "Bytes in the same segment after the reply to the name of a download are lost.",
    received_bytes(lambda data: _NAME_REPLY if data.startswith(_NAME_REPLY) else data),
    subtle=True,
)


@mutant("answers-pieces-of-chunks", "5.3/5", subtle=True)
class AnswersPartsOfChunks(ClientCore):
    """The first part of a chunk that arrives in several segments is answered, too."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        if data[1:2] == bytes((DOWNLOAD_CHUNK,)) and self._framer.buffered_bytes:
            self._send([chunk_reply(accepted=True, dialect=self.dialect)])
        return events


# The error signal


def _is_empty(data: bytes) -> bool:
    chunk = FILE_DATA.decode(data).value
    return chunk is None or chunk.length == 0


def _passed_over(
    condition: Callable[[bytes], bool], *, reply: bool | None = None
) -> type[ClientCore]:
    """A chunk that satisfies the condition is not stored. It is answered with `reply`, if given."""

    class PassedOver(Receiver):
        def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
            return reply if condition(data) else super().receive_chunk(data, now_s)

    return chunks_checked_by(PassedOver)


class _EmptyChunkIsLast(Receiver):
    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        if self.state is TransferState.ACTIVE and _is_empty(data):
            self.state = TransferState.DONE
            return True
        return super().receive_chunk(data, now_s)


row(
    "empty-chunks-are-the-end",
    "5.3/8 5.2/19",
    "A chunk of length 0 ends a download as done.",
    chunks_checked_by(_EmptyChunkIsLast),
)
row(
    "ignores-empty-chunks",
    "5.3/8",
    "A chunk of length 0 is ignored, and the download continues.",
    _passed_over(_is_empty),
)
row(
    "takes-empty-chunks",
    "5.3/8 5.3/5",
    "A chunk of length 0 is answered with 1, and the download continues.",
    _passed_over(lambda data: bool(data) and _is_empty(data), reply=True),
    subtle=True,
)
row(
    "ignores-frames-without-data",
    "5.3/8",
    "A chunk frame without data is ignored, and the download continues.",
    _passed_over(lambda data: not data),
    subtle=True,
)

# The file


def _checked_as(change: Callable[[Chunk], Chunk]) -> type[ClientCore]:
    """A chunk is accepted if the changed chunk is acceptable."""

    class CheckedAs(Receiver):
        def _problem(self, chunk: Chunk) -> str:
            return super()._problem(change(chunk))

    return chunks_checked_by(CheckedAs)


row(
    "writes-text-files",
    "5.3/11 5.2/16",
    "Each LF of a downloaded file is stored as CR LF.",
    download_content(lambda content: content.replace(b"\n", b"\r\n")),
)
row(
    "drops-zeros-at-the-end",
    "5.3/11",
    "Zeros at the end of a downloaded file are not stored.",
    download_content(lambda content: content.rstrip(b"\0")),
    subtle=True,
)
row(
    "positions-of-sixteen-bits",
    "5.3/11",
    "The position of a received chunk is read modulo 65,536.",
    _checked_as(lambda chunk: chunk._replace(position=chunk.position % 2**16)),
    subtle=True,
)
row(
    "loses-the-last-byte",
    "5.3/11",
    "The last byte of a downloaded file is not stored.",
    download_content(lambda content: content[:-1]),
)


@mutant("keeps-the-end-of-the-file-before", "5.3/11", subtle=True)
class ReusesDownloadBuffer(ClientCore):
    """A downloaded file that is shorter than the previous one ends like the previous one."""

    buffer = b""

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        core = self

        class Overlaid(Download):
            def settle(self, value: Any) -> None:
                core.buffer = value + core.buffer[len(value) :]
                super().settle(core.buffer)

        return Overlaid(name, limit_bytes, self.dialect)


# Local files


def _remove(path: Path) -> bool:
    path.unlink(missing_ok=True)
    return True


def _remove_empty(path: Path) -> bool:
    if path.exists() and not path.stat().st_size:
        path.unlink()
    return True


def _truncate(path: Path) -> bool:
    if path.exists():
        path.write_bytes(b"")
    return True


row(
    "overwrites-local-files",
    "5.3/12",
    "An existing local file is overwritten.",
    before_download(_remove),
)
row(
    "overwrites-empty-files",
    "5.3/12",
    "An existing local file that is empty is overwritten.",
    before_download(_remove_empty),
    subtle=True,
)
row(
    "empties-refused-files",
    "5.3/12",
    "An existing local file is truncated before the download is refused.",
    before_download(_truncate),
)
row(
    "existing-files-are-done",
    "5.3/12 5.2/19",
    "If the local file exists, it is kept and the download is reported as done.",
    before_download(lambda path: not path.exists()),
    subtle=True,
)

# Chunks out of bounds


def _accepted_if(condition: Callable[[Chunk], bool]) -> type[ClientCore]:
    """A chunk out of bounds is accepted if the condition holds."""

    class AcceptedIf(AnyOrder):
        def _problem(self, chunk: Chunk) -> str:
            return "" if condition(chunk) else super()._problem(chunk)

    return chunks_checked_by(AcceptedIf)


def _clamped(data: bytes) -> bytes:
    chunk = FILE_DATA.decode(data).value
    if chunk is None or chunk.length <= BUFFER_BYTES:
        return data
    room = max(0, min(BUFFER_BYTES, chunk.file_size - chunk.position))
    return FILE_DATA.encode(chunk._replace(length=room, buffer=chunk.buffer[:BUFFER_BYTES]))


def _fits_frame(chunk: Chunk) -> bool:
    within = chunk.position + chunk.length <= chunk.file_size
    return within and chunk.length <= len(chunk.buffer)


def _fits_in_32_bits(chunk: Chunk) -> bool:
    end = chunk.position + chunk.length
    return end >= 2**32 and end % 2**32 <= chunk.file_size


def _one_byte_more(chunk: Chunk) -> Chunk:
    beyond = chunk.position + chunk.length == chunk.file_size + 1
    return chunk._replace(file_size=chunk.file_size + beyond)


row(
    "clamps-lengths",
    "5.3/13",
    "The length of a chunk that is longer than 200 is reduced to the available room.",
    chunk_taken(_clamped),
)
row(
    "takes-what-the-frame-holds",
    "5.3/13",
    "A chunk of more than 200 bytes is accepted if its frame contains them.",
    _accepted_if(_fits_frame),
)
row(
    "takes-chunks-beyond-the-end",
    "5.3/13 5.1/13",
    "A chunk beyond the end of the file is accepted.",
    _accepted_if(lambda chunk: chunk.length <= BUFFER_BYTES),
)
row(
    "takes-one-byte-too-many",
    "5.3/13",
    "A chunk that extends one byte beyond the end of the file is accepted.",
    _checked_as(_one_byte_more),
    subtle=True,
)
row(
    "adds-in-thirty-two-bits",
    "5.3/13",
    "position + length is computed modulo 2^32.",
    _accepted_if(_fits_in_32_bits),
    subtle=True,
)
