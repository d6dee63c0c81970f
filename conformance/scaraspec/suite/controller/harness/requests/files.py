"""Files: how the suite sends a file and fetches one, chunk by chunk and without mistakes.

What is checked on the way names its own requirement, whatever the case is about. Cases about
transfers that go wrong send their own chunks, with `try_chunk`.
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
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.transfers import refuses_an_answer
from scaraspec.user_message import UserMessage

CHUNK_S: Final = 30.0
"""How long a chunk may take to come, or to be answered (A-5-23, L763, L787)."""

_PLAIN: Final = re.compile(rb"[A-Za-z0-9]+\.[A-Za-z]+")
_TRANSFER: Final = range(0x50, 0x57)
_MOST_BYTES: Final = 2**20
_MOST_CHUNKS: Final = 2000  # of a file of at most so many bytes


class NameRefused(CaseSkipped):
    """A new name of other characters than letters and digits, which may be refused (A-5-20)."""


# ---------------------------------------------------------------------- upload


def begin_upload(line: OutgoingConnection, name: bytes) -> None:
    """Offer a new file name.

    Raises:
        CaseFailed: It is refused.
        NameRefused: It is, and may be.
    """
    answer = line.ask("upload_name", data=name)
    if answer.accepted is False and not _PLAIN.fullmatch(name):
        raise NameRefused("the subject takes no names but of letters and digits")
    expect(
        answer.accepted,
        "a new file name was refused",
        expected="1",
        observed=f"{answer}",
        requirement="5.2/2",
    )


def try_chunk(
    line: OutgoingConnection,
    chunk: Chunk | None = None,
    *,
    data: bytes | None = None,
    within_s: float | None = None,
) -> bool | None:
    """Send a chunk, or whatever data in its place; whether it is taken, None without an answer."""
    try:
        return line.ask("upload_chunk", chunk, data=data, within_s=within_s).accepted
    except NoReply:
        return None


def send_chunk(
    line: OutgoingConnection, chunk: Chunk, requirement: str = "5.2/6", message: str = ""
) -> None:
    """Send a chunk that has to be taken; the message says what is wrong where it is not.

    Raises:
        CaseFailed: It is not.
        CaseInconclusive: It came so late that the transfer may have been over.
    """
    answer = line.ask("upload_chunk", chunk, within_s=CHUNK_S)
    if not answer.accepted:
        line.require_timely()
    expect(
        answer.accepted,
        message
        or f"the chunk at {chunk.position} of a file of {chunk.file_size} bytes was refused",
        expected="1",
        observed=f"{answer}",
        requirement=requirement,
    )


def upload(
    line: OutgoingConnection, name: bytes, content: bytes, requirement: str = "5.2/6"
) -> None:
    """Send a whole file (5.2).

    Raises:
        CaseFailed: The subject refuses the name or a chunk.
    """
    begin_upload(line, name)
    for chunk in chunks_of(content):
        send_chunk(line, chunk, requirement)


# ---------------------------------------------------------------------- download


def download(line: OutgoingConnection, name: bytes) -> bytes | None:
    """Fetch a whole file (5.3); None where the subject says that it has none.

    Raises:
        CaseFailed: A chunk is none, is out of bounds, or does not follow on the one before.
        NoReply: A chunk does not come.
    """
    if not line.ask("download_name", data=name).accepted:
        return None
    return b"".join(chunk.data for chunk in receive_chunks(line))


def receive_chunks(line: OutgoingConnection) -> Iterator[Chunk]:
    """The chunks of a download, each of which is answered when the next is asked for.

    Raises:
        CaseFailed: A chunk is none, is out of bounds, or does not follow on the one before.
        NoReply: A chunk does not come.
    """
    due, size_bytes = 0, -1
    while due != size_bytes:
        chunk = next_chunk(line)
        size_bytes = chunk.file_size if size_bytes < 0 else size_bytes
        expect_next(chunk, due, size_bytes)
        yield chunk
        line.answer_chunk(accepted=True)
        due += chunk.length
        if due > _MOST_BYTES:
            raise CaseInconclusive(
                UserMessage(
                    "a file of more than {most_bytes} bytes is not fetched to its end",
                    most_bytes=_MOST_BYTES,
                )
            )
    line.separate_frames()


def expect_stored(
    line: OutgoingConnection, name: bytes, content: bytes, requirement: str = "5.2/12"
) -> None:
    """Fetch a file and hold it against what it should be.

    Raises:
        CaseFailed: It is not there, or is another one.
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
            "a file of {content_count} bytes differs from byte {at} on when it is fetched",
            content_count=len(content),
            at=at,
        ),
        expected=f"{len(content)} bytes, at {at}: {content[at : at + 8].hex(' ')}",
        observed=f"{len(got)} bytes, at {at}: {got[at : at + 8].hex(' ')}",
        requirement=requirement,
    )


def expect_round_trip(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    content: bytes,
    requirement: str = "5.2/12",
) -> None:
    """Send a file, fetch it, compare, and delete it.

    Raises:
        CaseFailed: It does not come back as it was sent.
    """
    name = subject.new_name()
    upload(line, name, content, requirement)
    expect_stored(line, name, content, requirement)
    delete(line, name)


def next_chunk(line: OutgoingConnection) -> Chunk:
    """Wait for the next chunk of a download.

    Raises:
        NoReply: None comes in `CHUNK_S`.
        CaseFailed: It is no chunk.
        CaseInconclusive: The one before was answered so late that the transfer may have been over.
    """
    return chunk_of(_chunk_frame(line))


def download_replies(line: OutgoingConnection, name: bytes) -> list[ReceivedFrame]:
    """Fetch a file and keep every frame of it, right or wrong, until no more come.

    Raises:
        CaseFailed: The file is refused.
        CaseInconclusive: A chunk was answered so late that the transfer may have been over.
    """
    expect(
        line.ask("download_name", data=name).accepted,
        "a file that is there was refused",
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
        return line.reply("download_chunk", within_s=CHUNK_S)
    except NoReply as error:
        line.require_timely()
        error.requirement = "5.3/4"
        raise


# ---------------------------------------------------------------------- around a transfer


def expect_nothing_more(
    line: OutgoingConnection, message: str, requirement: str, *, stray: bool = False
) -> None:
    """Fail the subject if it has sent, or now sends, any frame of a transfer.

    Args:
        line: The connection.
        message: What is wrong then.
        requirement: What it violates.
        stray: Whether an answer to no chunk was sent, which may be answered 0 (A-5-16).

    Raises:
        CaseFailed: It has.
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
    """Take the frames of clause 5 that came and were not waited for.

    Where an answer to no chunk was sent, a 0 to it counts for nothing (A-5-16).
    """
    line.separate_frames()
    try:
        came = line.sync() if line.ending is None else line.inbox
    except NoReply:
        if line.ending is None:  # it may end the link (A-5-26)
            raise
        came = line.inbox
    came = [seen for seen in came if seen.frame.opcode in _TRANSFER]
    return [seen for seen in came if not (stray and refuses_an_answer(seen.frame))]


def is_cancelled(seen: FrameSeen | ReceivedFrame) -> bool:
    """Whether the controller says with it that its download has failed (L787; A-5-10)."""
    if seen.frame.opcode != BY_NAME["download_chunk"].opcode:
        return False
    return not seen.frame.data or (isinstance(seen.value, Chunk) and not seen.value.length)


def delete(line: OutgoingConnection, name: bytes) -> None:
    """Delete a file of the suite's own.

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
    """The name of a file to fetch: one of this content, or what is there where none may be sent.

    Raises:
        CaseSkipped: There is none, and none may be sent.
    """
    if Hazard.STATE in subject.allowed:
        name = subject.new_name()
        upload(line, name, content)
        return name
    part = line.ask("list_programs").value
    if part is None or not part.names:
        raise CaseSkipped("no program is stored, and --allow state is needed to send one")
    return bytes(part.names[0])


def reconnect(subject: ControllerUnderTest, line: OutgoingConnection) -> OutgoingConnection:
    """Another connection in place of this one, which ends."""
    line.close()
    return subject.open()


def leftover_content(line: OutgoingConnection, name: bytes) -> bytes | None:
    """What is stored under a name, of which nothing may be; b"" also where no chunk comes.

    Raises:
        CaseInconclusive: A chunk was answered so late that the transfer may have been over.
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
