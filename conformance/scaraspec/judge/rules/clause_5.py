"""Clauses 5.1 to 5.4: chunks and transfers, uploads and downloads."""

from scaraspec.judge.rules.flag import one_flag
from scaraspec.judge.rules.missing_programs import list_without
from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    places_of,
    places_of_file,
    rule,
    tolerated,
)
from scaraspec.judge.rules.settings import MAX_UNSEEN_NS
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import NAME_MAX_BYTES, show
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA_BYTES, HEAD_BYTES, TransferState
from scaraspec.traffic.events import Exchange, FrameSeen, Transfer, UnsolicitedReply
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.transfers import REFUSED_CHUNK, REFUSED_NAME, SILENCE
from scaraspec.user_message import UserMessage

_CHUNKS = ("upload_chunk", "download_chunk")
_UPLOAD_CHUNK = ("upload_chunk",)
_DOWNLOAD_CHUNK = ("download_chunk",)
_CONTENT_COMES_NS = 5_000_000_000
"""Within this time after the reply to its name the content begins (A-3-15)."""


# 5.1: the structure


@rule("5.1/1", "5.2/5", on=Exchange, names=_UPLOAD_CHUNK)
@rule("5.1/1", "5.3/4", on=Exchange, names=_DOWNLOAD_CHUNK)
def structure(x: Exchange, _: RobotState) -> RuleResult | None:
    """Each chunk frame carries one fileData structure (L718-723, L756, L780)."""
    if not x.request.frame.data:
        return None
    size = len(x.request.frame.data)
    if x.chunk is None or (size != FILE_DATA_BYTES and size != HEAD_BYTES + x.chunk.length):
        return failed(
            "the data of a chunk is not a fileData structure",
            expected=UserMessage("{count} bytes", count=FILE_DATA_BYTES),
            observed=UserMessage("{count} bytes", count=size),
            at=(x.request.place,),
        )
    return PASSED


@rule("5.1/2", on=Exchange, names=_CHUNKS)
def structure_size(x: Exchange, _: RobotState) -> RuleResult | None:
    """The data length is sizeof(fileData) = 212 (L756, L780; A-5-3)."""
    if x.chunk is None:
        return None
    size = len(x.request.frame.data)
    if size == FILE_DATA_BYTES:
        return PASSED
    if size == HEAD_BYTES + x.chunk.length:
        return tolerated(
            "chunk_trunc",
            "truncated",
            UserMessage("a chunk is truncated to its data ({size} bytes)", size=size),
        )
    return None


@rule("5.1/3", on=Exchange, names=_CHUNKS)
def constant_file_size(x: Exchange, _: RobotState) -> RuleResult | None:
    """The file size is the same in all chunks of a transfer (L729; A-5-7)."""
    transfer = x.transfer
    if x.chunk is None or transfer is None or transfer.size_bytes < 0 or x.error_signal:
        return None
    if x.chunk.file_size == transfer.size_bytes:
        return PASSED
    return failed(
        "the file size changed during a transfer",
        expected=str(transfer.size_bytes),
        observed=str(x.chunk.file_size),
        at=(x.request.place,),
    )


@rule("5.1/3", on=Exchange, names=_DOWNLOAD_CHUNK)
def size_of_the_upload(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The file size of a download is the number of bytes that were uploaded (L729)."""
    stored = robot.files.get(x.transfer.name) if x.transfer else None
    if stored is None or x.chunk is None or x.error_signal or x.expected_position:
        return None
    if x.chunk.file_size == stored.received_bytes:
        return PASSED
    return failed(
        UserMessage(
            "the file size in the download of {file_name} is not the size of its upload",
            file_name=show(stored.name),
        ),
        expected=str(stored.received_bytes),
        observed=str(x.chunk.file_size),
        at=(*places_of_file(stored), x.request.place),
    )


@rule("5.1/4", on=Exchange, names=_CHUNKS)
def position_is_an_offset(x: Exchange, _: RobotState) -> RuleResult | None:
    """`position` is the byte offset of the chunk's first byte, from 0 (L731, L737; A-5-5).

    Other meanings are detected early: an end or a count from 1 in the first chunk, a count from 0
    in the others. Any other wrong position is a gap or an overlap.
    """
    transfer, expected = x.transfer or x.previous_transfer, x.expected_position
    if x.chunk is None or transfer is None or expected is None or x.error_signal:
        return None
    position = x.chunk.position
    if position == expected:
        return PASSED
    if expected and position != transfer.chunks - 1:
        return None
    return failed(
        "the position is not the byte offset of the chunk",
        expected=str(expected),
        observed=str(position),
        at=(*places_of(transfer), x.request.place),
    )


@rule("5.1/5", "5.4/3", on=Exchange, names=_CHUNKS)
def length_in_bounds(x: Exchange, _: RobotState) -> RuleResult | None:
    """Length is 1 to 200, the size of the buffer (L733-735, L793)."""
    if x.chunk is None or x.error_signal:
        return None
    if x.chunk.length <= BUFFER_BYTES:
        return PASSED
    return failed(
        "a chunk's length is over 200",
        expected="1 to 200",
        observed=str(x.chunk.length),
        at=(x.request.place,),
    )


@rule("5.1/6", on=Exchange, names=_CHUNKS)
def within_the_file(x: Exchange, _: RobotState) -> RuleResult | None:
    """Position + length never exceeds fileSize (L737)."""
    if x.chunk is None or x.error_signal:
        return None
    end = x.chunk.position + x.chunk.length
    if end <= x.chunk.file_size:
        return PASSED
    return failed(
        "a chunk reaches beyond the end of the file",
        expected=UserMessage("at most {limit}", limit=x.chunk.file_size),
        observed=str(end),
        at=(x.request.place,),
    )


@rule("5.1/7", on=Transfer)
def complete(transfer: Transfer, _: RobotState) -> RuleResult | None:
    """The transfer is complete at position + length == fileSize (L737)."""
    return PASSED if transfer.state is TransferState.DONE else None


@rule("5.1/8", on=Exchange, names=_CHUNKS)
def ascending(x: Exchange, _: RobotState) -> RuleResult | None:
    """Chunks come in ascending order without gap or overlap (L737, L793; A-5-8)."""
    if x.chunk is None or x.expected_position is None or x.error_signal:
        return None
    if x.chunk.position == x.expected_position:
        return PASSED
    if x.after_silence and x.chunk.position < x.expected_position:
        return None  # the controller did not answer, and the client sends a chunk again
    transfer = x.transfer or x.previous_transfer
    return failed(
        "a chunk does not follow the previous chunk",
        expected=str(x.expected_position),
        observed=str(x.chunk.position),
        at=(*(places_of(transfer) if transfer else ()), x.request.place),
    )


@rule("5.1/9", on=Exchange, names=_CHUNKS)
def one_byte_order(x: Exchange, _: RobotState) -> RuleResult | None:
    """The byte order is the same in all chunks that one side sends in a session (A-5-2)."""
    if not x.request.parsed or x.transfer is None or not x.transfer.order:
        return None
    order = dict(x.request.parsed.decoded.readings).get("endian", x.transfer.order)
    if order != x.transfer.order:
        return failed(
            "the byte order changed",
            expected=x.transfer.order,
            observed=order,
            at=(x.request.place,),
        )
    if order == "big":
        return tolerated("endian", "big", "file data is big-endian")
    return PASSED


@rule("5.1/11", on=Exchange, names=_CHUNKS)
def name_first(x: Exchange, _: RobotState) -> RuleResult | None:
    """The file name is sent before any content (L712)."""
    if x.transfer:
        return PASSED
    if x.previous_transfer is None:
        return failed(
            "content was sent without a file name before it", observed=x.name, at=(x.request.place,)
        )
    if not x.previous_transfer.certain:
        return inconclusive("the file name may be in a gap of the recording")
    return None


# 5.1, 5.2, 5.4: names


@rule("5.2/1", on=FrameSeen, names=("upload_name",), sender=A2C)
@rule("5.3/1", on=FrameSeen, names=("download_name",), sender=A2C)
def request_names_a_file(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The request carries the file name (L743-746, L767-770)."""
    if seen.frame.data:
        return PASSED
    return failed("the request names no file", expected="a file name", observed="no data")


@rule("5.2/18", on=FrameSeen, names=("upload_name",), sender=A2C)
def short_names(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Names have at most 30 bytes (L226; A-5-20)."""
    if len(seen.text) <= NAME_MAX_BYTES:
        return PASSED
    return tolerated(
        "name_max",
        "255",
        UserMessage("a file name of {byte_count} bytes was sent", byte_count=len(seen.text)),
    )


# The answer is "1" or "0" (L748-751, L758-761, L772-775, L782-785).
rule("5.2/2", on=Exchange, names=("upload_name",))(one_flag)
rule("5.2/6", on=Exchange, names=_UPLOAD_CHUNK)(one_flag)
rule("5.3/2", on=Exchange, names=("download_name",))(one_flag)
rule("5.3/5", on=Exchange, names=_DOWNLOAD_CHUNK)(one_flag)


@rule("5.1/10", "5.2/3", "5.4/2", on=Exchange, names=("upload_name",))
def existing_file_refused(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A name that exists is answered "0" (L739, L748, L791)."""
    stored = robot.files.get(x.request_value) if isinstance(x.request_value, bytes) else None
    if stored is None or x.accepted is None:
        return None
    if not x.accepted:
        return PASSED
    return failed(
        UserMessage(
            "the upload of {file_name} was accepted although the file exists",
            file_name=show(x.request_value),
        ),
        expected="0",
        observed="1",
        at=(*places_of_file(stored), *places_of(x)),
    )


@rule("5.4/1", on=Exchange, names=("upload_name",))
def absent_file_created(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A name that does not exist is answered "1" (L791); a refusal may have other reasons."""
    return PASSED if x.accepted and x.request_value not in robot.files else None


# 5.2 and 5.3: the sequence of a transfer


@rule("5.2/4", on=Exchange, names=_UPLOAD_CHUNK)
@rule("5.3/10", on=Exchange, names=_DOWNLOAD_CHUNK)
def no_content_after_refusal(x: Exchange, _: RobotState) -> RuleResult | None:
    """No content is sent after 0x50 or 0x54 was answered "0" (L748, L772)."""
    if x.transfer:
        return PASSED
    before = x.previous_transfer
    if before is None or before.reason != REFUSED_NAME:
        return None
    return failed(
        UserMessage(
            "content was sent although the file name {file_name} was refused",
            file_name=show(before.name),
        ),
        expected="no content",
        observed="a chunk",
        at=(*places_of(before), x.request.place),
    )


@rule("5.2/7", on=Exchange, names=_UPLOAD_CHUNK)
@rule("5.3/6", on=Exchange, names=_DOWNLOAD_CHUNK)
def stop_and_wait(x: Exchange, _: RobotState) -> RuleResult | None:
    """The next chunk is sent only after the answer to the previous one (A-5-9).

    A client may mistake an extra reply for the expected one: replies have no number.
    """
    if not x.same_opcode_pending:
        return PASSED
    if x.error_signal or (x.transfer and x.transfer.extra_reply_seen):
        return None
    return failed(
        "a chunk was sent before the previous chunk was answered",
        expected="one chunk outstanding",
        observed="two",
        at=(x.request.place,),
    )


@rule("5.3/5", on=UnsolicitedReply, names=_DOWNLOAD_CHUNK, sender=A2C)
def one_reply_per_chunk(unsolicited: UnsolicitedReply, _: RobotState) -> RuleResult | None:
    """The client answers each chunk exactly once (L782-785)."""
    if unsolicited.late:
        return None
    return failed(
        "the client sent a reply without a pending chunk",
        expected="one answer to each chunk",
        observed="two",
    )


@rule("5.2/8", on=Exchange, names=_UPLOAD_CHUNK)
def stops_after_refusal(x: Exchange, _: RobotState) -> RuleResult | None:
    """After 0x52 "0" the client stops the transfer (A-5-14)."""
    if x.transfer and not x.transfer.resumed:
        return PASSED
    before = x.transfer or x.previous_transfer
    continues = before is not None and (before.resumed or before.reason == REFUSED_CHUNK)
    if not continues or x.error_signal:
        return None
    return tolerated("A-5-14", "goes on", "a chunk was sent after a chunk was refused")


@rule("5.2/13", on=Exchange, names=_CHUNKS)
def nothing_after_the_end(x: Exchange, _: RobotState) -> RuleResult | None:
    """Nothing is exchanged after the answer to the last chunk (L737; A-5-15)."""
    if x.transfer:
        return PASSED
    before = x.previous_transfer
    if before is None or before.state is not TransferState.DONE:
        return None
    return failed(
        UserMessage(
            "a chunk was sent after the transfer of {file_name} was complete",
            file_name=show(before.name),
        ),
        expected="nothing",
        observed="a chunk",
        at=(*places_of(before), x.request.place),
    )


@rule("5.2/13", on=UnsolicitedReply, names=_UPLOAD_CHUNK, sender=C2A)
def no_second_last_answer(unsolicited: UnsolicitedReply, _: RobotState) -> RuleResult | None:
    """The last chunk is not answered twice (L737; A-5-15)."""
    last = unsolicited.after
    complete = last and last.transfer and last.transfer.state is TransferState.DONE
    if not last or not complete or unsolicited.late or not unsolicited.certain:
        return None
    return failed(
        "a second reply was sent to the last chunk of a complete upload",
        expected="nothing",
        observed="a second answer",
        at=(*places_of(last), unsolicited.seen.place),
    )


@rule("5.2/17", on=Exchange, names=_UPLOAD_CHUNK)
def no_empty_chunk(x: Exchange, _: RobotState) -> RuleResult | None:
    """A chunk of length 0 is only the error signal (L737, L787; A-5-10)."""
    if not x.error_signal:
        return PASSED
    if x.chunk and x.chunk.file_size == 0:
        return tolerated("empty_file", "chunk", "an empty file was sent as a chunk of length 0")
    return None


@rule("5.2/12", on=Transfer)
def reads_back(transfer: Transfer, robot: RobotState) -> RuleResult | None:
    """A file that was uploaded completely is downloaded with identical content (L737)."""
    stored = robot.files.get(transfer.name)
    if transfer.upload or transfer.state is not TransferState.DONE or stored is None:
        return None
    first, size = transfer.first_difference, transfer.received_bytes
    expected_size = stored.received_bytes
    if first < 0 and size == expected_size:
        return PASSED
    first = first if first >= 0 else min(size, expected_size)
    sent, got = (bytes(t.content[first : first + 8]).hex(" ") for t in (stored, transfer))
    chunk = (transfer.differing_chunk.place,) if transfer.differing_chunk else ()
    return failed(
        UserMessage(
            "the download of {file_name} differs from its upload, from byte {offset} on",
            file_name=show(transfer.name),
            offset=first,
        ),
        expected=UserMessage(
            "{count} bytes, at {offset}: {data}", count=expected_size, offset=first, data=sent
        ),
        observed=UserMessage(
            "{count} bytes, at {offset}: {data}", count=size, offset=first, data=got
        ),
        at=(*places_of_file(stored), *places_of(transfer), *chunk),
    )


@rule("5.2/12", on=Exchange, names=("download_name",))
def upload_is_there(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A file that was uploaded completely can be downloaded (L737)."""
    stored = robot.files.get(x.request.text)
    if stored is None or x.accepted is not False or not x.logged_in:
        return None
    if not stored.received_bytes:
        return None  # an empty file need not be stored (A-5-10)
    busy = x.concurrent or robot.executing or robot.transferring
    if busy or x.time_ns - stored.ended_ns > MAX_UNSEEN_NS:
        return None
    return failed(
        UserMessage(
            "the download of {file_name} was refused although its upload was complete",
            file_name=show(stored.name),
        ),
        expected="1",
        observed="0",
        at=(*places_of_file(stored), *places_of(x)),
    )


@rule("5.3/8", on=Exchange, names=_DOWNLOAD_CHUNK)
def error_signal_ends_the_download(x: Exchange, _: RobotState) -> RuleResult | None:
    """A chunk of length 0 is an error (L787): the client does not answer it with "1".

    A controller may send an empty file as such a chunk (A-5-10).
    """
    if not x.error_signal or not x.reply or (x.chunk and not x.chunk.file_size):
        return None
    if not x.accepted:
        return PASSED
    opening = places_of(x.transfer) if x.transfer else ()
    return failed(
        "a chunk without data was answered 1",
        expected="0, or no reply",
        observed="1",
        at=(*opening, *places_of(x)),
    )


@rule("5.3/4", on=Exchange, names=_DOWNLOAD_CHUNK)
def content_after_the_reply(x: Exchange, _: RobotState) -> RuleResult | None:
    """The first chunk comes after the reply to the file name (L777; A-5-23)."""
    opening = x.transfer.opening if x.transfer else None
    if opening is None or opening.reply is None:
        return None
    if opening.reply.place.offset_bytes < x.request.place.offset_bytes:
        return PASSED
    return failed(
        "content was sent before the reply to the file name",
        expected="1, then the first chunk",
        observed="a chunk, then 1",
        at=(x.request.place, opening.reply.place),
    )


@rule("5.3/3", on=Exchange, names=("download_name",))
def absent_file_refused(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A name that the last program list lacks is answered "0" (L772), if no file has it."""
    return PASSED if x.accepted is False and list_without(x, robot) else None


@rule("5.3/3", on=Transfer)
def absent_file_has_no_content(transfer: Transfer, robot: RobotState) -> RuleResult | None:
    """A name that is not listed and was answered "1" has content, or is not stored (L772)."""
    opening = transfer.opening
    if transfer.upload or transfer.chunks or opening is None:
        return None
    programs = list_without(opening, robot)
    if programs is None:
        return None
    if transfer.ended_ns - transfer.begun_ns < _CONTENT_COMES_NS:
        return None
    return failed(
        UserMessage(
            "the download of {file_name} was accepted, but the program list lacks it and no content"
            " followed",
            file_name=show(transfer.name),
        ),
        expected="0",
        observed="1",
        at=(*places_of(programs), *places_of(transfer)),
    )


@rule("5.3/4", on=Transfer)
def content_follows(transfer: Transfer, robot: RobotState) -> RuleResult | None:
    """After "1" the controller sends the content (L777-780); an empty file has none (A-5-10)."""
    if transfer.upload or transfer.chunks or transfer.reason != SILENCE:
        return None
    stored = robot.files.get(transfer.name)
    if absent_file_has_no_content(transfer, robot):
        return None
    if stored is None or not stored.received_bytes:
        return inconclusive(
            UserMessage(
                "the download of {file_name} was accepted without content; the file may be empty",
                file_name=show(transfer.name),
            )
        )
    return failed(
        UserMessage(
            "the download of {file_name} was accepted, but no content followed",
            file_name=show(transfer.name),
        ),
        expected="a chunk",
        observed="silence",
    )
