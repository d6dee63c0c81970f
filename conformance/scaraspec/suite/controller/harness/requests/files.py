"""Files: how the suite uploads and downloads a file correctly, chunk by chunk.

Each check here names its own requirement, whatever requirement the case has. Cases about failing
transfers send their own chunks with `try_chunk`.
"""

import re
from collections.abc import Iterator
from typing import Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import Chunk, chunks_of
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.chunks import chunk_of, expect_next
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    expect,
)
from scaraspec.suite.program_files.writing import wait_program
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.transfers import refuses_reply
from scaraspec.user_message import UserMessage

_PLAIN: Final = re.compile(rb"[A-Za-z0-9]+\.[A-Za-z]+")
_TRANSFER: Final = range(0x50, 0x57)
_NO_PROGRAM: Final = b"!"
_MOST_BYTES: Final = 2**20
_SMALL_BYTES: Final = 4096  # every store has room for such a file
_MOST_CHUNKS: Final = 2000  # of a file of at most `_MOST_BYTES`


class NameRefused(CaseSkipped):
    """The subject refused a new name with characters other than letters and digits (A-5-20)."""


class StoreFull(CaseSkipped):
    """The subject has no place for another file (A-5-21).

    Attributes:
        deleted: The file of the suite that was deleted to find this out.
    """

    def __init__(self, deleted: bytes) -> None:
        super().__init__("the store is full: it has no place for another file")
        self.deleted = deleted


class NoRoom(CaseSkipped):
    """The subject refuses a large file; the cases of 5.2/16 judge whether it may (A-5-25)."""


class ContentRefused(CaseSkipped):
    """The subject refuses files that are not valid programs (A-5-21)."""


def is_plain(name: bytes) -> bool:
    """Whether every controller must accept this name: it has only letters and digits (A-5-20)."""
    return _PLAIN.fullmatch(name) is not None


# ---------------------------------------------------------------------- upload


def begin_upload(line: OutgoingConnection, name: bytes) -> None:
    """Request the upload of a new file.

    Raises:
        CaseFailed: The subject refuses the name.
        NameRefused: The subject refuses the name, and the document permits this.
        StoreFull: The store of the subject is full.
        CaseInconclusive: Files of the user may fill the store of the subject.
    """
    answer = line.ask("upload_name", data=name)
    if answer.accepted is False and not is_plain(name):
        raise NameRefused("the subject accepts only names of letters and digits")
    expect_begun(line, name, answer, "a new file name was refused")


def expect_begun(
    line: OutgoingConnection,
    name: bytes,
    answer: ReceivedFrame,
    message: str,
    requirement: str = "5.2/2",
) -> None:
    """Require that the subject has accepted the upload of a new file.

    Args:
        line: The connection.
        name: The name of the file.
        answer: The reply to the name.
        message: The message of the failure.
        requirement: The requirement that a refusal violates.

    Raises:
        CaseFailed: The subject has refused the name, although it has a place for the file.
        StoreFull: The store of the subject is full.
        CaseInconclusive: Files of the user may fill the store of the subject.
    """
    if answer.accepted is False:
        require_place(line, name)
    expect(answer.accepted, message, expected="1", observed=f"{answer}", requirement=requirement)


def require_place(line: OutgoingConnection, name: bytes) -> None:
    """Find out whether the store is full: a name is accepted only after a deletion (A-5-21)."""
    subject = line.subject
    stored = [each for each in subject.files.stored if each != name]
    if not subject.files.any_accepted and "list_programs" not in subject.ics.unsupported:
        part = line.ask("list_programs").value
        if part is not None and any(part.names):
            raise CaseInconclusive(
                "no upload was accepted: delete programs if the store of the robot may be full"
            )
    if not stored or line.ask("upload_name", data=subject.new_name()).accepted:
        return
    for deleted in reversed(stored):
        if line.ask("delete_program", data=deleted).accepted:
            if line.ask("upload_name", data=name).accepted:
                send_chunk(line, Chunk(1, 0, 1, b"!"))
                delete(line, name)
                raise StoreFull(deleted)
            return


def require_any_content(line: OutgoingConnection) -> None:
    """Find out whether the subject stores only valid programs, after it has refused a chunk.

    Raises:
        ContentRefused: It refuses a file of one byte, and accepts a program.
    """
    traits = line.subject.traits
    if traits.stores_only_programs is None:
        program = wait_program(line.subject.dialect, 1, layout=traits.listed_layout)
        accepts = (_accepts(line, content) for content in (_NO_PROGRAM, program))
        traits.stores_only_programs = tuple(accepts) == (False, True)
    if traits.stores_only_programs:
        raise ContentRefused("the subject stores only valid programs")


def _accepts(line: OutgoingConnection, content: bytes) -> bool:
    name = line.subject.new_name()
    accepted = line.ask("upload_name", data=name).accepted is True
    accepted = accepted and all(try_chunk(line, chunk) for chunk in chunks_of(content))
    if accepted:
        line.ask("delete_program", data=name)
    return accepted


def try_chunk(
    line: OutgoingConnection,
    chunk: Chunk | None = None,
    *,
    data: bytes | None = None,
    within_s: float | None = None,
) -> bool | None:
    """Send a chunk, or other data in its place.

    Returns:
        Whether the subject accepts it; None without an answer.
    """
    try:
        return line.ask("upload_chunk", chunk, data=data, within_s=within_s).accepted
    except NoReply:
        return None


def send_chunk(
    line: OutgoingConnection, chunk: Chunk, requirement: str = "5.2/6", message: str = ""
) -> None:
    """Send a chunk that the subject must accept.

    Args:
        line: The connection.
        chunk: The chunk.
        requirement: The requirement that a refusal violates.
        message: The message of the failure; empty for a default.

    Raises:
        CaseFailed: The subject refuses the chunk.
        CaseInconclusive: The suite sent the chunk so late that the transfer may have ended.
        ContentRefused: The subject stores only valid programs.
        NoRoom: The subject refuses the first chunk of a large file.
    """
    answer = line.ask("upload_chunk", chunk, within_s=line.chunk_timeout_s)
    if not answer.accepted:
        line.require_timely()
        if chunk.position == 0 and chunk.file_size > _SMALL_BYTES:
            raise NoRoom(
                UserMessage(
                    "the subject has no room for a file of {size_bytes} bytes",
                    size_bytes=chunk.file_size,
                )
            )
        require_any_content(line)
    expect(
        answer.accepted,
        message
        or UserMessage(
            "the chunk at {position} of a file of {size_bytes} bytes was refused",
            position=chunk.position,
            size_bytes=chunk.file_size,
        ),
        expected="1",
        observed=f"{answer}",
        requirement=requirement,
    )


def upload(
    line: OutgoingConnection, name: bytes, content: bytes, requirement: str = "5.2/6"
) -> None:
    """Upload a file (5.2).

    Raises:
        CaseFailed: The subject refuses the name or a chunk.
    """
    begin_upload(line, name)
    for chunk in chunks_of(content):
        send_chunk(line, chunk, requirement)


# ---------------------------------------------------------------------- download


def download(line: OutgoingConnection, name: bytes) -> bytes | None:
    """Download a file (5.3).

    Returns:
        Its content; None if the subject answers that there is no such file.

    Raises:
        CaseFailed: A chunk is invalid, out of bounds, or does not follow the one before.
        NoReply: A chunk does not arrive.
    """
    if not line.ask("download_name", data=name).accepted:
        return None
    return b"".join(chunk.data for chunk in receive_chunks(line))


def receive_chunks(line: OutgoingConnection) -> Iterator[Chunk]:
    """Yield the chunks of a download. Each is answered when the caller requests the next one.

    Raises:
        CaseFailed: A chunk is invalid, out of bounds, or does not follow the one before.
        NoReply: A chunk does not arrive.
    """
    position, size_bytes = 0, -1
    while position != size_bytes:
        chunk = next_chunk(line)
        size_bytes = chunk.file_size if size_bytes < 0 else size_bytes
        expect_next(chunk, position, size_bytes)
        yield chunk
        line.answer_chunk(accepted=True)
        position += chunk.length
        if position > _MOST_BYTES:
            raise CaseInconclusive(
                UserMessage(
                    "the suite does not download files of more than {max_bytes} bytes completely",
                    max_bytes=_MOST_BYTES,
                )
            )
    line.separate_frames()


def expect_stored(
    line: OutgoingConnection, name: bytes, content: bytes, requirement: str = "5.2/12"
) -> None:
    """Download a file and compare its content.

    Raises:
        CaseFailed: The file does not exist, or its content differs.
    """
    got = download(line, name)
    if got is None:
        raise CaseFailed(
            "a file that was uploaded cannot be downloaded",
            expected="1",
            observed="0",
            requirement=requirement,
        )
    if got == content:
        return
    first = next((i for i, (a, b) in enumerate(zip(got, content, strict=False)) if a != b), None)
    at = min(len(got), len(content)) if first is None else first
    raise CaseFailed(
        UserMessage(
            "a downloaded file of {size_bytes} bytes differs from byte {position} on",
            size_bytes=len(content),
            position=at,
        ),
        expected=UserMessage(
            "{count} bytes, at {offset}: {data}",
            count=len(content),
            offset=at,
            data=content[at : at + 8].hex(" "),
        ),
        observed=UserMessage(
            "{count} bytes, at {offset}: {data}",
            count=len(got),
            offset=at,
            data=got[at : at + 8].hex(" "),
        ),
        requirement=requirement,
    )


def expect_round_trip(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    content: bytes,
    requirement: str = "5.2/12",
) -> None:
    """Upload a file, download it, compare the content, and delete the file.

    Raises:
        CaseFailed: The content differs, or a request is refused.
    """
    name = subject.new_name()
    upload(line, name, content, requirement)
    expect_stored(line, name, content, requirement)
    delete(line, name)


def next_chunk(line: OutgoingConnection) -> Chunk:
    """Wait for the next chunk of a download.

    Raises:
        NoReply: No chunk arrives in time.
        CaseFailed: The frame is not a valid chunk.
        CaseInconclusive: The suite answered so late that the transfer may have ended.
    """
    return chunk_of(_chunk_frame(line))


def download_replies(line: OutgoingConnection, name: bytes) -> list[ReceivedFrame]:
    """Download a file, and return every chunk frame, valid or not, until no more arrive.

    Raises:
        CaseFailed: The subject refuses the download.
        CaseInconclusive: The suite answered so late that the transfer may have ended.
    """
    expect(
        line.ask("download_name", data=name).accepted,
        "the download of an existing file was refused",
        expected="1",
        observed="0",
        requirement="5.3/2",
    )
    frames = [_chunk_frame(line)]
    while len(frames) < _MOST_CHUNKS:
        chunk = frames[-1].value
        line.answer_chunk(accepted=True)
        if isinstance(chunk, Chunk) and chunk.last:
            line.separate_frames()
            break
        try:
            frames.append(_chunk_frame(line))
        except NoReply:
            break
    return frames


def _chunk_frame(line: OutgoingConnection) -> ReceivedFrame:
    try:
        return line.reply("download_chunk", within_s=line.chunk_timeout_s)
    except NoReply as error:
        line.require_timely()
        error.requirement = "5.3/4"
        raise


# ---------------------------------------------------------------------- around a transfer


def expect_nothing_more(
    line: OutgoingConnection, message: str, requirement: str, *, stray: bool = False
) -> None:
    """Require that the subject sends no further frame of a transfer.

    Args:
        line: The connection.
        message: The message of the failure.
        requirement: The requirement that such a frame violates.
        stray: Whether the suite sent a chunk answer although no chunk was pending. The subject
            may reply 0 to it (A-5-16).

    Raises:
        CaseFailed: The subject has sent such a frame.
    """
    came = transfer_frames(line, stray=stray)
    expect(
        not came,
        message,
        expected="nothing",
        observed="; ".join(f"{seen.frame}" for seen in came),
        requirement=requirement,
    )


def transfer_frames(line: OutgoingConnection, *, stray: bool = False) -> list[FrameSeen]:
    """Return the received frames of clause 5 that no case has read.

    With `stray`, a reply 0 is ignored: the suite sent a chunk answer although no chunk was pending
    (A-5-16).
    """
    line.separate_frames()
    try:
        came = line.sync() if line.ending is None else line.inbox
    except NoReply:
        if line.ending is None:  # the subject may close the connection (A-5-26)
            raise
        came = line.inbox
    came = [seen for seen in came if seen.frame.opcode in _TRANSFER]
    return [seen for seen in came if not (stray and refuses_reply(seen.frame))]


def is_cancelled(seen: FrameSeen | ReceivedFrame) -> bool:
    """Whether this is the signal of the controller that a download has failed (L787; A-5-10)."""
    if seen.frame.opcode != BY_NAME["download_chunk"].opcode:
        return False
    return not seen.frame.data or (isinstance(seen.value, Chunk) and not seen.value.length)


def delete(line: OutgoingConnection, name: bytes) -> None:
    """Delete a file of the suite.

    Raises:
        CaseFailed: The subject refuses.
    """
    answer = line.ask("delete_program", data=name)
    expect(
        answer.accepted,
        "a file cannot be deleted",
        expected="1",
        observed=f"{answer}",
        requirement="4.11/2",
    )


def upload_some_file(
    subject: ControllerUnderTest, line: OutgoingConnection, content: bytes
) -> bytes:
    """Return the name of a file to download.

    The file is uploaded first. If uploads are not allowed, it is a file that is already stored.

    Raises:
        CaseSkipped: No file is stored, and an upload is not allowed.
    """
    if Hazard.STATE in subject.allowed:
        name = subject.new_name()
        upload(line, name, content)
        return name
    part = line.ask("list_programs").value
    if part is None or not part.names:
        raise CaseSkipped("no program is stored, and an upload needs --allow state")
    return bytes(part.names[0])


def reconnect(subject: ControllerUnderTest, line: OutgoingConnection) -> OutgoingConnection:
    """Close this connection and return a new one."""
    line.close()
    return subject.open()


def leftover_content(line: OutgoingConnection, name: bytes) -> bytes | None:
    """Download a file that should not exist, and return its content.

    Returns:
        The content; b"" if no chunk arrives; None if the download is refused.

    Raises:
        CaseInconclusive: The suite answered so late that the transfer may have ended.
    """
    if not line.ask("download_name", data=name).accepted:
        return None
    content = b""
    for _ in range(_MOST_CHUNKS):
        try:
            chunk = chunk_of(line.reply("download_chunk"))
        except NoReply:
            if content:
                line.require_timely()
            break
        content += chunk.data
        line.answer_chunk(accepted=True)
        if chunk.last:
            line.separate_frames()
            break
    return content
