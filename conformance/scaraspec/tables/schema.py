"""The tables of a capture: their columns, types and units. Every output format has this schema.

The version changes if a column is renamed, is removed or gets another meaning. Times are
nanoseconds since the Unix epoch in Python, and UTC times in files. Text has no passwords.
"""

from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, Final, NamedTuple, get_args, get_type_hints

SCHEMA: Final = "scaraspec.tables/1"
"""Name and version of the schema."""

TIME: Final = "time"
"""Marks a column that is a time."""

_File = Annotated[str, "The capture."]
_Connection = Annotated[str, "The connection within the capture."]
_Direction = Annotated[str, "`A2C`: from the client to the controller; `C2A`: to the client."]
_Offset = Annotated[int, "Position of the first byte in this direction of the connection."]
_Certain = Annotated[bool, "Whether no loss and no injected fault can have affected it."]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileRow:
    """A capture."""

    file: _File
    begun_ns: Annotated[int | None, TIME, "Time of the first event; empty without events."]
    ended_ns: Annotated[int | None, TIME, "Time of the last event; empty without events."]
    whole: Annotated[
        bool, "Whether the file is not damaged; `losses` has bytes that were not captured."
    ]
    notes: Annotated[str, "What is missing or unusual, one sentence for each."]
    verdict: Annotated[
        str | None, "The verdict of `audit`, or `unreadable`; empty if the file was not judged."
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionRow:
    """A connection of a client."""

    file: _File
    connection: _Connection
    begun_ns: Annotated[int, TIME, "Time of the first event."]
    ended_ns: Annotated[int, TIME, "Time of the last event."]
    ending: Annotated[str, "`closed`, `reset`, `half-closed`, or `open` at the end of the capture."]
    addresses: Annotated[str, "Addresses of client and controller, if known."]
    client_bytes: Annotated[int, "Bytes that the client sent, without losses."]
    controller_bytes: Annotated[int, "Bytes that the controller sent, without losses."]
    frames: Annotated[int, "Frames in both directions."]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeRow:
    """A request with everything that answers it."""

    file: _File
    number: Annotated[int, "Counts the exchanges of the file in the order of their ends, from 1."]
    connection: _Connection
    time_ns: Annotated[int, TIME, "When the request was complete."]
    side: Annotated[str, "Who sent the request: `client` or `controller`."]
    command: Annotated[str, "The command, or the undefined opcode."]
    arguments: Annotated[str, "The data of the request as text."]
    reply: Annotated[str | None, "The first reply as text; empty if there is none."]
    result: Annotated[str | None, "The final result as text; empty if there is none."]
    accepted: Annotated[bool | None, "Whether the first reply accepts it; empty without a flag."]
    code: Annotated[str | None, "Code of table 8-1 of a refusal or of a failed command."]
    ending: Annotated[
        str, "`answered`, `unanswered`, `unfinished`, `cut off`, `hung up` or `unseen`."
    ]
    latency_s: Annotated[float | None, "From the request to the first reply, in seconds."]
    duration_s: Annotated[float | None, "From the first reply to the final result, in seconds."]
    offset_bytes: Annotated[int, "Position of the request in its direction of the connection."]
    certain: _Certain


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferRow:
    """A file transfer."""

    file: _File
    connection: Annotated[str | None, "Empty if the capture began during the transfer."]
    time_ns: Annotated[int, TIME, "When the controller accepted the name, or the name was sent."]
    upload: Annotated[bool, "Whether the file goes to the controller."]
    name: Annotated[str, "Name of the file on the controller."]
    state: Annotated[str, "`done`, `failed`, or `active` if its end is not known."]
    reason: Annotated[str, "Why it failed, or why its end is not known."]
    size_bytes: Annotated[int | None, "Size that the first chunk states; empty without a chunk."]
    received_bytes: Annotated[int, "Bytes whose chunks were acknowledged."]
    chunks: Annotated[int, "Chunks that were sent."]
    duration_s: Annotated[float, "In seconds."]
    certain: _Certain


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingRow:
    """A requirement judged on evidence, other than a pass."""

    file: _File
    connection: Annotated[str | None, "The connection within the capture."]
    time_ns: Annotated[int | None, TIME, "When the last byte of the last evidence was seen."]
    side: Annotated[str, "About `client`, `controller`, `both`, `network` or `recording`."]
    requirement: Annotated[str, "For example `4.15/3`."]
    verdict: Annotated[str, "`tolerated`, `inconclusive`, `fail` or `error`."]
    cause: Annotated[str, "What is responsible for the verdict."]
    message: Annotated[str, "One sentence."]
    reading: Annotated[str | None, "The listed reading that decided, such as `endian=big`."]
    direction: Annotated[str | None, "Direction of the last evidence."]
    offset_bytes: Annotated[int | None, "Position of the last evidence."]
    length_bytes: Annotated[int | None, "Length of the last evidence."]


@dataclass(frozen=True, slots=True, kw_only=True)
class LossRow:
    """Bytes that passed but are not in the capture."""

    file: _File
    connection: _Connection
    time_ns: Annotated[int, TIME, "When the loss was noticed."]
    direction: _Direction
    offset_bytes: _Offset
    length_bytes: Annotated[int | None, "Empty if the number of bytes is not known."]
    reason: Annotated[str, "Why the bytes are missing."]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameRow:
    """A frame; written only on request."""

    file: _File
    connection: _Connection
    time_ns: Annotated[int, TIME, "When the last byte of the frame was seen."]
    direction: _Direction
    offset_bytes: _Offset
    length_bytes: Annotated[int, "Length of the frame."]
    command: Annotated[str, "The command, or the undefined opcode."]
    part: Annotated[str, "`request`, `reply` or `result`; empty for an undefined opcode."]
    text: Annotated[str, "The data as text."]


Row = FileRow | SessionRow | ExchangeRow | TransferRow | FindingRow | LossRow | FrameRow

TABLES: Final[dict[str, type[Row]]] = {
    "files": FileRow,
    "sessions": SessionRow,
    "exchanges": ExchangeRow,
    "transfers": TransferRow,
    "findings": FindingRow,
    "losses": LossRow,
    "frames": FrameRow,
}
"""The class of the rows of each table, by its name."""

NAMES: Final = {kind: name for name, kind in TABLES.items()}
"""The name of the table of each class."""


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        name: Its name; that of a time ends with ``_ns`` in Python, and without it in files.
        field: The attribute of the row.
        type: The type of its values, one of `str`, `int`, `float` and `bool`.
        optional: Whether a value may be missing.
        is_time: Whether it is a time.
        text: What it means.
    """

    name: str
    field: str
    type: type
    optional: bool
    is_time: bool
    text: str


@cache
def columns(table: str) -> tuple[Column, ...]:
    """Return the columns of a table, in order.

    Raises:
        KeyError: There is no such table.
    """
    kind = TABLES[table]
    hints = get_type_hints(kind, include_extras=True)
    return tuple(_column(field.name, hints[field.name]) for field in fields(kind))


def _column(field: str, hint: Any) -> Column:
    declared, *marks = get_args(hint)
    kinds = get_args(declared) or (declared,)
    is_time = TIME in marks
    name = field.removesuffix("_ns") if is_time else field
    return Column(name, field, kinds[0], type(None) in kinds, is_time, marks[-1])
