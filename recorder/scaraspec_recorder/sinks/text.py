"""Texts of traffic events and findings: log lines and payload texts, the same in all outputs.

Texts are messages: a command can show them in another language. They never contain passwords.
"""

from collections.abc import Callable
from datetime import datetime
from functools import lru_cache
from typing import Any, Final, NamedTuple

from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol import commands, errors
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.fields import StatusCode, show
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import (
    Acceptance,
    NameListPart,
    OptionalName,
    OptionalRecord,
    Outcome,
)
from scaraspec.protocol.redaction import is_secret, mask_unframed
from scaraspec.protocol.transfer import Chunk, TransferState
from scaraspec.traffic.events import (
    CaptureGap,
    Ending,
    Exchange,
    FrameSeen,
    Injected,
    InvalidBytes,
    LinkChange,
    TrafficEvent,
    Transfer,
    UnsolicitedReply,
)
from scaraspec.traffic.wire import Kind, WireRange
from scaraspec.user_message import UserMessage

SECRET: Final = UserMessage("(password)")
"""The replacement of a password."""
TEXT_LIMIT: Final = 200
"""The text of a payload has at most so many characters."""

_HEX_BYTES: Final = 24
_SECOND_NS: Final = 1_000_000_000


class Level:
    """Log levels that Rerun and Foxglove share."""

    DEBUG: Final = "DEBUG"
    INFO: Final = "INFO"
    WARN: Final = "WARN"
    ERROR: Final = "ERROR"


class LogLine(NamedTuple):
    """One log line: level, source and text."""

    level: str
    source: str
    text: str


_LEVELS: Final = {
    Verdict.FAIL: Level.ERROR,
    Verdict.ERROR: Level.ERROR,
    Verdict.INCONCLUSIVE: Level.WARN,
    Verdict.TOLERATED: Level.INFO,
}


def log_line(item: TrafficEvent | Finding) -> LogLine | None:
    """Return the log line of an item; None for items without one, such as single frames."""
    make = _LINES.get(type(item))
    return make(item) if make else None


def name_of(seen: FrameSeen) -> str:
    """Return the command name of a frame, or its undefined opcode."""
    return seen.command.name if seen.command else f"0x{seen.frame.opcode:02X}"


def part_of(seen: FrameSeen) -> str:
    """Return the part of the command: request, reply or result; empty if undefined."""
    return _PARTS[seen.parsed.part] if seen.parsed else ""


def frame_text(seen: FrameSeen) -> str:
    """Return the text of a frame's payload."""
    return text_of(seen.frame)


def text_of(frame: Frame) -> str:
    """Return the text of a payload; no password is shown."""
    return SECRET if is_secret(frame) else _text(frame)


def defect_texts(seen: FrameSeen) -> tuple[str, ...]:
    """Return the defects of a frame's payload; only their kinds if the payload is secret."""
    found = seen.parsed.decoded.issues if seen.parsed else ()
    if not found:
        return ()
    secret = is_secret(seen.frame)
    return tuple(complaint.defect.value if secret else complaint.text for complaint in found)


def code_text(code: str) -> str:
    """Return a code of table 8-1 with its meaning."""
    if row := errors.lookup(code):
        return UserMessage("{code} {meaning}", code=code, meaning=_message(row.meaning))
    return code


def exchange_text(exchange: Exchange) -> str:
    """Return the text of an exchange: request, replies, ending and duration."""
    reply = ""
    if exchange.reply:
        reply = frame_text(exchange.reply) or UserMessage("an empty reply")
    elif exchange.malformed:
        reply = UserMessage("malformed reply {data}", data=hex_text(exchange.malformed))
    took_ns = exchange.latency_ns if exchange.duration_ns is None else exchange.duration_ns
    values = {
        "name": exchange.name,
        "request": frame_text(exchange.request),
        "reply": reply,
        "result": frame_text(exchange.result) if exchange.result else "",
        "ending": ending_text(exchange),
        "took": "" if took_ns is None else _duration_text(took_ns),
    }
    text = template = ""
    for value, (before, field, after) in zip(values.values(), _EXCHANGE, strict=True):
        if value:
            text += before + value + after
            template += before + field + after
    return UserMessage.of(text, template, values)


def ending_text(exchange: Exchange) -> str:
    """Return how an exchange ended; empty if it was answered."""
    return _ENDINGS.get(exchange.ending, "")


def transfer_text(transfer: Transfer) -> str:
    """Return the text of a file transfer."""
    done = transfer.state is TransferState.DONE
    return UserMessage(
        _TRANSFERS[transfer.upload, done],
        name=show(transfer.name),
        count=transfer.received_bytes,
        size="?" if transfer.size_bytes < 0 else transfer.size_bytes,
        reason=_message(transfer.reason),
    )


def attachment_name(transfer: Transfer) -> str:
    """Return a transferred file's name as a label without path separators."""
    name = show(transfer.name).translate({ord("/"): "_", ord("\\"): "_"})
    return f"{'upload' if transfer.upload else 'download'} {name}"


def hex_text(item: InvalidBytes) -> str:
    """Return the first bytes of an undecodable run, with passwords masked."""
    data = mask_unframed(item.data)
    more = "…" if item.place.length_bytes > _HEX_BYTES else ""
    return data[:_HEX_BYTES].hex(" ").upper() + more


def place_text(place: WireRange) -> str:
    """Return a position on the wire as text."""
    return (
        f"connection {place.connection} {place.direction.value} "
        f"bytes {place.offset_bytes}-{place.offset_bytes + place.length_bytes - 1}"
    )


def _duration_text(duration_ns: int) -> str:
    return (
        f"{duration_ns / 1e9:.2f} s" if duration_ns >= _SECOND_NS else f"{duration_ns / 1e6:.1f} ms"
    )


def _undecodable_text(item: InvalidBytes) -> str:
    size = item.place.length_bytes
    template = "{count} bytes from the {sender} that are no frame ({reason}): {data}"
    if size == 1:
        template = "1 byte from the {sender} that is no frame ({reason}): {data}"
    reason: str = _message(item.reason.value)
    if item.touches_gap:
        reason = UserMessage("{reason}, beside a gap", reason=reason)
    return UserMessage(
        template,
        count=size,
        sender=_SENDER[item.place.direction],
        reason=reason,
        data=hex_text(item),
    )


def _gap_text(item: CaptureGap) -> str:
    event = item.event
    template = "{count} bytes from the {sender} are missing: {note}"
    if event.length_bytes < 0:
        template = "an unknown number of bytes from the {sender} are missing: {note}"
    return UserMessage(
        template,
        count=event.length_bytes,
        sender=_SENDER[event.direction],
        note=event.note,
    )


def _message(text: str) -> UserMessage:
    """Return a constant sentence as a message; one that is a message already stays it."""
    if isinstance(text, UserMessage):
        return text
    return UserMessage.of(text, text, {})


_YES_NO: Final = {
    Acceptance: (UserMessage("accepted"), UserMessage("refused")),
    Outcome: (UserMessage("done"), UserMessage("failed")),
}
_SENDER: Final = {
    Direction.A2C: UserMessage("client"),
    Direction.C2A: UserMessage("controller"),
}
_EXCHANGE: Final = (
    ("", "{name}", ""),
    (" ", "{request}", ""),
    (" → ", "{reply}", ""),
    (" → ", "{result}", ""),
    (" → ", "{ending}", ""),
    (" (", "{took}", ")"),
)
"""The parts of an exchange, with what is before and after each."""
_ENDINGS: Final = {
    Ending.UNANSWERED: UserMessage("unanswered"),
    Ending.UNFINISHED: UserMessage("unfinished"),
    Ending.CUT_OFF: UserMessage("cut off"),
    Ending.HUNG_UP: UserMessage("hung up"),
    Ending.UNSEEN: UserMessage("unseen"),
}
_TRANSFERS: Final = {
    (True, True): "upload of {name} complete: {count} bytes",
    (True, False): "upload of {name} broke off at {count} of {size}: {reason}",
    (False, True): "download of {name} complete: {count} bytes",
    (False, False): "download of {name} broke off at {count} of {size}: {reason}",
}
_LINKS: Final = {
    Kind.OPENED: "connection {connection} opened",
    Kind.HALF_CLOSED: "connection {connection} half-closed",
    Kind.CLOSED: "connection {connection} closed",
    Kind.RESET: "connection {connection} reset",
}
_PARTS: Final = {
    "request": UserMessage("request"),
    "reply": UserMessage("reply"),
    "result": UserMessage("result"),
}
_UNASKED: Final = {
    "reply": "unasked reply of {command}: {data}",
    "result": "unasked result of {command}: {data}",
}


def _exchange_level(exchange: Exchange) -> str:
    """Return WARN for refused or failed exchanges, DEBUG for queries and file chunks."""
    failed = exchange.outcome is not None and not exchange.outcome.done
    if exchange.accepted is False or failed or exchange.ending is not Ending.ANSWERED:
        return Level.WARN
    command = exchange.command
    routine = exchange.chunk or (command and command.hazard is Hazard.READ_ONLY)
    return Level.DEBUG if routine else Level.INFO


@lru_cache(maxsize=4096)
def _text(frame: Frame) -> str:
    """Return the text of a frame. Cached, because polling repeats the same frames."""
    parsed = commands.parse_frame(frame)
    text = _value_text(parsed) if parsed else ""
    if not text and frame.data:
        text = show(frame.data)
    return text if len(text) <= TEXT_LIMIT else text[: TEXT_LIMIT - 1] + "…"


def _value_text(parsed: Parsed) -> str:
    command, part, decoded = parsed
    payload = command.request if part == "request" else command.reply
    value, fields = decoded.value, payload.fields
    text: str
    match value:
        case Acceptance() | Outcome():
            good, bad = _YES_NO[type(value)]
            text = good if value[0] else bad
            if not value[0] and value.code:
                text = UserMessage("{refused} {code}", refused=bad, code=code_text(value.code))
        case NameListPart():
            text = ", ".join(show(name) for name in value.names) or UserMessage("no programs")
            if value.more:
                text = UserMessage("{names}, …", names=text)
        case Chunk():
            text = UserMessage(
                "{count} bytes at {position} of {size}",
                count=len(value.data),
                position=value.position,
                size=value.file_size,
            )
        case tuple():
            text = ", ".join(
                f"{field.name.removesuffix('_s')} {_scalar_text(item)} {field.unit}".rstrip()
                for field, item in zip(fields, value, strict=True)
            )
        case str() if len(fields) == 1 and isinstance(fields[0], StatusCode):
            text = code_text(value)
        case None | b"" if (
            isinstance(payload, OptionalRecord | OptionalName) and not decoded.issues
        ):
            text = UserMessage("none")
        case _:
            text = _scalar_text(value)
    return text


def _scalar_text(value: Any) -> str:
    match value:
        case None:
            return ""
        case bool():
            return UserMessage("ok") if value else UserMessage("refused")
        case bytes():
            return show(value)
        case float():
            return f"{value:.10g}"
        case datetime():
            return value.isoformat(sep=" ")
        case _:
            return str(value)


def _finding_line(finding: Finding) -> LogLine:
    level = _LEVELS.get(finding.verdict, Level.INFO)
    text = f"{finding.verdict.value} {finding.requirement}: {finding.message}"
    return LogLine(level, "finding", text)


def _exchange_line(exchange: Exchange) -> LogLine:
    return LogLine(_exchange_level(exchange), exchange.name, exchange_text(exchange))


def _undecodable_line(item: InvalidBytes) -> LogLine:
    return LogLine(Level.WARN, "undecodable", _undecodable_text(item))


def _link_line(item: LinkChange) -> LogLine:
    event = item.event
    text = UserMessage(_LINKS[event.kind], connection=event.connection)
    if event.note:
        text = UserMessage("{change}: {note}", change=text, note=event.note)
    return LogLine(Level.INFO, "connection", text)


def _lost_line(item: CaptureGap) -> LogLine:
    return LogLine(Level.WARN, "gap", _gap_text(item))


def _injected_line(item: Injected) -> LogLine:
    event = item.event
    text = "connection {connection} injected: {note}"
    message = UserMessage(text, connection=event.connection, note=event.note)
    return LogLine(Level.WARN, "injected", message)


def _transfer_line(transfer: Transfer) -> LogLine:
    level = Level.INFO if transfer.state is TransferState.DONE else Level.WARN
    return LogLine(level, "transfer", transfer_text(transfer))


def _unasked_line(item: UnsolicitedReply) -> LogLine:
    seen = item.seen
    template = _UNASKED.get(part_of(seen), "unasked frame of {command}: {data}")
    text = UserMessage(template, command=name_of(seen), data=frame_text(seen))
    return LogLine(Level.WARN, name_of(seen), text)


_LINES: Final[dict[type, Callable[[Any], LogLine]]] = {
    Finding: _finding_line,
    Exchange: _exchange_line,
    InvalidBytes: _undecodable_line,
    LinkChange: _link_line,
    CaptureGap: _lost_line,
    Injected: _injected_line,
    Transfer: _transfer_line,
    UnsolicitedReply: _unasked_line,
}
