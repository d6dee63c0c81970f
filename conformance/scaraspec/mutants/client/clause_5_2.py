"""Mutants of clause 5.2: uploads, and the outcome of transfers."""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from scaraspec.client.base import LINK_LOST_REASONS
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES, ClientCore, Event
from scaraspec.client.errors import ClientError, LinkLost, TransferFailed
from scaraspec.client.operations import Text
from scaraspec.client.pending_operation import Stage
from scaraspec.client.transfer import Download, FileTransfer, Upload
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import received, sent
from scaraspec.mutants.operators.client.messages import request_data
from scaraspec.mutants.operators.client.transfers import (
    UPLOAD_CHUNK,
    UPLOAD_NAME,
    LongTimeout,
    NoTimeout,
    NoTimeoutForName,
    OneTimeout,
    ShortTimeout,
    chunks,
    chunks_cut_by,
    downloads,
    timeout_restarts,
    upload_content,
    upload_name,
    uploads,
)
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import NAME_MAX_BYTES, PayloadError
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, HEAD_BYTES, Chunk, Sender
from scaraspec.transports.link import Ending

# The name


def _names(change: Callable[[bytes], bytes]) -> tuple[type[ClientCore], ...]:
    """The names of uploads and downloads are changed."""
    return request_data("upload_name", change), request_data("download_name", change)


def _refuse_thirty_bytes(_: Path, remote: Text) -> Text:
    if len(remote) >= NAME_MAX_BYTES:
        raise PayloadError("the name is too long")
    return remote


row(
    "uploads-under-its-own-name",
    "5.2/1",
    "A file is uploaded under its name on the client's disk.",
    upload_name(lambda path, _: path.name),
)
row(
    "adds-the-extension",
    "5.2/1 5.3/1",
    "The extension .rob is added to a file name without it.",
    *_names(
        lambda name: name if name.endswith(b".rob") else name[: NAME_MAX_BYTES - 4] + b".rob",
    ),
)
row(
    "lowers-names",
    "5.2/1 5.3/1",
    "File names are sent in lower case.",
    *_names(lambda name: name.lower()),
)
row(
    "names-of-fixed-size",
    "5.2/1 5.3/1",
    "File names are padded with zeros to 30 bytes.",
    *_names(lambda name: name.ljust(NAME_MAX_BYTES, b"\0")),
)
row(
    "question-marks-for-chinese",
    "5.2/1",
    "A character of a file name that is not ASCII is sent as a question mark.",
    *_names(lambda name: name.decode().encode("ascii", "replace")),
    subtle=True,
)
row(
    "cuts-upload-names",
    "5.2/18",
    "A name of more than 30 bytes is cut to 30 bytes and sent.",
    upload_name(lambda _, remote: remote[:NAME_MAX_BYTES]),
)
row(
    "refuses-names-of-thirty-bytes",
    "5.2/18",
    "A name of 30 bytes is refused as too long.",
    upload_name(_refuse_thirty_bytes),
    subtle=True,
)


# The reply to the name


def _accepted(parsed: Parsed) -> Parsed:
    return parsed._replace(decoded=parsed.decoded._replace(value=True, issues=()))


def _taken_as_yes(condition: Callable[[Upload, bytes], bool]) -> type[ClientCore]:
    """A reply to an upload is taken as 1 if the condition holds."""

    class TakenAsYes(Upload):
        def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
            parsed = _accepted(parsed) if condition(self, data) else parsed
            return super().take(parsed, data, now_s)

    return uploads(TakenAsYes)


def _done_if(
    condition: Callable[[FileTransfer, ClientError], bool], value: bytes | None = None
) -> type[FileTransfer]:
    """A failed transfer succeeds with `value` if the condition holds."""

    class DoneIf(FileTransfer):
        def fail(self, error: ClientError) -> None:
            if condition(self, error):
                self.settle(value)
            else:
                super().fail(error)

    return DoneIf


def _name_failed(transfer: FileTransfer, error: ClientError) -> bool:
    return transfer.stage is Stage.REQUESTED and isinstance(error, TransferFailed)


row(
    "sends-content-after-refusal",
    "5.2/4 5.2/19",
    "Content is sent although the controller refused the name.",
    _taken_as_yes(lambda upload, _: upload.stage is Stage.REQUESTED),
)


@mutant("remembers-the-first-yes", "5.2/4", subtle=True)
class RemembersAcceptedNames(ClientCore):
    """A name that was accepted once is always taken as accepted."""

    @cached_property
    def known(self) -> set[bytes]:
        return set()

    def upload(self, name: bytes, content: bytes) -> Upload:
        known = self.known

        class Remembering(Upload):
            def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
                if self.stage is Stage.REQUESTED:
                    parsed = _accepted(parsed) if name in known else parsed
                    if data == b"1":
                        known.add(name)
                return super().take(parsed, data, now_s)

        return Remembering(name, content, self.dialect)


row(
    "uploads-without-yes-are-done",
    "5.2/19 5.2/9",
    "An upload whose name was refused or not answered is reported as done.",
    uploads(_done_if(_name_failed), Upload),
)


# The content


def _head_and_buffer(frame: Frame) -> tuple[Frame, ...]:
    if frame.opcode != UPLOAD_CHUNK:
        return (frame,)
    pieces = frame.data[:HEAD_BYTES], frame.data[HEAD_BYTES:]
    return tuple(frame._replace(data=piece) for piece in pieces)


def _cut_after_end_byte(frame: Frame) -> list[Frame]:
    head, end, rest = frame.data.partition(b"\xcc")
    if frame.opcode != UPLOAD_CHUNK or not end:
        return [frame]
    return [frame._replace(data=piece) for piece in (head + end, rest) if piece]


class _Window(Upload):
    from_bytes = 0

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        return (
            [*frames, *self.ahead()] if frames and self.moved_bytes >= self.from_bytes else frames
        )

    def ahead(self) -> list[Frame]:
        position = self.moved_bytes + BUFFER_BYTES
        piece = self._content[position : position + BUFFER_BYTES]
        chunk = Chunk(len(self._content), position, len(piece), piece)
        return [Frame(A2C, UPLOAD_CHUNK, FILE_DATA.encode(chunk, self._dialect))] if piece else []


class _LateWindow(_Window):
    from_bytes = BUFFER_BYTES + 1


class _OneMoreChunk(_Window):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        executing = self.stage is Stage.EXECUTING
        frames = Upload.take(self, parsed, data, now_s)
        return self.ahead() if executing and self.error else frames


row(
    "head-and-buffer-apart",
    "5.2/5 5.1/1",
    "The numbers of a chunk are sent in one frame and its buffer in the next.",
    sent(_head_and_buffer),
)
row(
    "escapes-end-bytes",
    "5.2/5 5.1/1",
    "A chunk that contains 0xCC is split after it into two frames.",
    sent(_cut_after_end_byte),
    subtle=True,
)
row(
    "sends-one-chunk-ahead",
    "5.2/7",
    "The next chunk is sent together with one that is not answered yet.",
    uploads(_Window),
)
row(
    "sends-ahead-once-it-runs",
    "5.2/7",
    "From the third chunk on, the next chunk is sent before the reply.",
    uploads(_LateWindow),
    subtle=True,
)
row(
    "ignores-refused-chunks",
    "5.2/8 5.2/19",
    "A refused chunk is counted as accepted.",
    _taken_as_yes(lambda upload, _: upload.stage is not Stage.REQUESTED),
)
row(
    "ignores-the-last-refusal",
    "5.2/19",
    "The reply to the last chunk is awaited, but its data are ignored.",
    _taken_as_yes(
        lambda upload, _: upload.moved_bytes + BUFFER_BYTES >= (upload.total_bytes or 0) > 0
    ),
    subtle=True,
)
row(
    "stops-one-chunk-late",
    "5.2/8",
    "One more chunk is sent after a refused chunk.",
    uploads(_OneMoreChunk),
    subtle=True,
)

# Time

row(
    "uploads-wait-for-ever",
    "5.2/9",
    "An upload waits for a reply without a timeout.",
    uploads(NoTimeout, Upload),
)
row(
    "uploads-wait-five-seconds",
    "5.2/9",
    "An upload waits for a reply only 5 s, like other commands.",
    uploads(ShortTimeout, Upload),
)
row(
    "uploads-wait-too-long",
    "5.2/9",
    "An upload is given up after 75 s.",
    uploads(LongTimeout, Upload),
    subtle=True,
)
row(
    "uploads-have-thirty-seconds-in-all",
    "5.2/9",
    "The timeout of 30 s applies to the whole upload.",
    uploads(OneTimeout, Upload),
    subtle=True,
)
row(
    "upload-names-wait-for-ever",
    "5.2/9",
    "An upload waits for the reply to its name without a timeout.",
    uploads(NoTimeoutForName, Upload),
    subtle=True,
)
row(
    "other-replies-put-off-uploads",
    "5.2/9",
    "Any received bytes restart the 30 s of an upload.",
    timeout_restarts(Upload),
    subtle=True,
)


@mutant("late-answers-revive-uploads", "5.2/9", subtle=True)
class ResumesOnLateReply(ClientCore):
    """A reply after the timeout of an upload makes the client send another chunk."""

    given_up: Upload | None = None

    def tick(self, now_s: float) -> list[Event]:
        waiting = [each for each in self._open if isinstance(each, Upload)]
        events = super().tick(now_s)
        for upload in waiting:
            if upload.settled:
                self.given_up = upload
        return events

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        upload, self.given_up = self.given_up, None
        if upload is not None and frame.opcode in (UPLOAD_NAME, UPLOAD_CHUNK):
            data = FILE_DATA.encode(Chunk(upload.total_bytes or 0, 0, 1, b"!"), self.dialect)
            self._send([Frame(A2C, UPLOAD_CHUNK, data)])
        return super()._dispatch(frame, now_s)


# The end


def _extra_chunk(make: Callable[[bytes], Chunk | None]) -> type[ClientCore]:
    """After an upload, the chunk that `make` returns for its content is sent."""

    class ExtraChunk(Upload):
        def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
            frames = super().take(parsed, data, now_s)
            chunk = make(self._content) if self.settled and not self.error else None
            if chunk is not None:
                frames.append(Frame(A2C, UPLOAD_CHUNK, FILE_DATA.encode(chunk, self._dialect)))
            return frames

    return uploads(ExtraChunk)


def _empty_chunk(content: bytes) -> Chunk:
    return Chunk(len(content), len(content), 0, b"")


def _last_chunk(content: bytes) -> Chunk:
    position = (len(content) - 1) // BUFFER_BYTES * BUFFER_BYTES
    return Chunk(len(content), position, len(content[position:]), content[position:])


row(
    "empty-chunk-at-the-end",
    "5.2/13 5.2/17",
    "An upload ends with a chunk of length 0.",
    _extra_chunk(_empty_chunk),
)
row(
    "empty-chunk-behind-full-ones",
    "5.2/13 5.2/17",
    "An upload of a multiple of 200 bytes ends with a chunk of length 0.",
    _extra_chunk(lambda content: None if len(content) % BUFFER_BYTES else _empty_chunk(content)),
    subtle=True,
)
row(
    "sends-the-last-chunk-twice",
    "5.2/13",
    "After an upload, its last chunk is sent again.",
    _extra_chunk(_last_chunk),
)


# Sizes and contents


class _StopsAfter255Chunks(Sender):
    def next_chunk(self) -> Chunk | None:
        if self.acknowledged_bytes // BUFFER_BYTES >= 255:
            return None
        return super().next_chunk()


def _copied_as_strings(content: bytes) -> bytes:
    pieces = (content[i : i + BUFFER_BYTES] for i in range(0, len(content), BUFFER_BYTES))
    return b"".join(p.partition(b"\0")[0].ljust(len(p), b"\0") for p in pieces)


row(
    "sizes-of-sixteen-bits",
    "5.2/16 5.1/3",
    "fileSize and position are sent modulo 65,536.",
    chunks(
        lambda chunk: chunk._replace(
            file_size=chunk.file_size & 0xFFFF, position=chunk.position & 0xFFFF
        )
    ),
    subtle=True,
)
row(
    "cuts-large-files",
    "5.2/16 5.1/3",
    "Only the first 65,535 bytes of a larger file are sent.",
    upload_content(lambda content: content[:0xFFFF]),
    subtle=True,
)
row(
    "counts-chunks-in-one-byte",
    "5.2/16 5.2/20",
    "An upload stops after 255 chunks.",
    chunks_cut_by(_StopsAfter255Chunks),
    subtle=True,
)
row(
    "loses-start-bytes",
    "5.2/16 5.2/20",
    "A byte 0xAA of a file is sent as 0x55.",
    upload_content(lambda content: content.replace(b"\xaa", b"\x55")),
)
row(
    "stops-at-zeros",
    "5.2/20 5.2/16",
    "All bytes after a zero in a chunk are sent as zeros.",
    upload_content(_copied_as_strings),
)
row(
    "reads-text-files",
    "5.2/20",
    "Each CR LF of a file is sent as LF.",
    upload_content(lambda content: content.replace(b"\r\n", b"\n")),
    subtle=True,
)
row(
    "drops-the-byte-order-mark",
    "5.2/20",
    "The byte order mark of a UTF-8 file is not sent.",
    upload_content(lambda content: content.removeprefix(b"\xef\xbb\xbf") or content),
    subtle=True,
)
row(
    "strips-the-end",
    "5.2/20",
    "Spaces, line feeds and zeros at the end of a file are not sent.",
    upload_content(lambda content: content.rstrip(b"\0 \n") or content),
    subtle=True,
)

# Empty files

row(
    "empty-files-are-done-at-once",
    "5.2/17 5.2/19",
    "An empty file is reported as sent, but nothing is sent.",
    upload_name(lambda path, remote: remote if path.stat().st_size else None),
)
row(
    "missing-files-are-done",
    "5.2/19",
    "A file that does not exist is reported as sent.",
    upload_name(lambda path, remote: remote if path.exists() else None),
    subtle=True,
)
row(
    "empty-files-become-one-zero",
    "5.2/17",
    "An empty file is sent as one zero byte.",
    upload_content(lambda content: content or b"\0"),
    subtle=True,
)


# The outcome


class _TakesAnyOpcode(Upload):
    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        return parsed.part == "reply" and frame.data == b"1"


class _KeepsPartOnLoss(Download):
    def fail(self, error: ClientError) -> None:
        if isinstance(error, LinkLost) and self.moved_bytes and self._receiver is not None:
            self.settle(self._receiver.content)
        else:
            super().fail(error)


def _lost_with_data(transfer: FileTransfer, error: ClientError) -> bool:
    return isinstance(error, LinkLost) and bool(transfer.moved_bytes)


def _reset_with_data(transfer: FileTransfer, error: ClientError) -> bool:
    return _lost_with_data(transfer, error) and LINK_LOST_REASONS[Ending.RESET] in str(error)


row(
    "any-answer-is-yes",
    "5.2/19",
    "Any reply to an upload other than 0 is taken as 1.",
    _taken_as_yes(lambda _, data: data != b"0"),
)
row(
    "answers-of-any-opcode",
    "5.2/19 3/33",
    "A 1 with any opcode is taken as the reply to a name or a chunk.",
    uploads(_TakesAnyOpcode),
)
row(
    "ignores-the-tag",
    "5.2/19 3/33",
    "A 1 with the tag of final results is taken as the reply to a name or a chunk.",
    received(
        lambda frame: (
            frame._replace(tagged=False) if frame.opcode in (UPLOAD_NAME, UPLOAD_CHUNK) else frame
        )
    ),
    subtle=True,
)
row(
    "lost-uploads-are-done",
    "5.2/19",
    "An upload whose connection ends after its first chunk is reported as done.",
    uploads(_done_if(_lost_with_data), Upload),
)
row(
    "uploads-cut-off-are-done",
    "5.2/19",
    "An upload whose connection is reset after its first chunk is reported as done.",
    uploads(_done_if(_reset_with_data), Upload),
    subtle=True,
)
row(
    "lost-downloads-are-done",
    "5.2/19 5.3/11",
    "A download whose connection ends is reported as done with the bytes received so far.",
    downloads(_KeepsPartOnLoss),
)
row(
    "refused-downloads-are-empty",
    "5.2/19",
    "A refused download is reported as done with an empty file.",
    downloads(_done_if(_name_failed, b""), Download),
)


@mutant("remembers-refusals", "5.2/19", subtle=True)
class RemembersFailedDownloads(ClientCore):
    """A name whose download failed once always fails."""

    @cached_property
    def refused(self) -> set[bytes]:
        return set()

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        refused = self.refused

        class Remembering(Download):
            def fail(self, error: ClientError) -> None:
                if self.stage is Stage.REQUESTED:
                    refused.add(name)
                super().fail(error)

            def settle(self, value: Any) -> None:
                if name in refused:
                    self._fail_transfer("there is no such file")
                else:
                    super().settle(value)

        return Remembering(name, limit_bytes, self.dialect)
