"""Payloads: how the data of a frame is made of fields, for requests, replies and final results.

One class per form that the document draws. Decoding never raises and keeps every departure as a
complaint; encoding follows a dialect and refuses what the document forbids. Which command has
which payload stands in `commands`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from scaraspec.protocol.fields import (
    DecodeIssue,
    Defect,
    Diagnostics,
    Field,
    Flag,
    Name,
    PayloadError,
    StatusCode,
    show,
)
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.user_message import UserMessage


class Decoded(NamedTuple):
    """What a payload says, what is wrong with it, and which readings it gives away.

    `value` is None where nothing could be made of the bytes, and for payloads without data.
    """

    value: Any
    complaints: tuple[DecodeIssue, ...] = ()
    readings: tuple[tuple[str, str], ...] = ()


class Payload(ABC):
    """The data part of one kind of frame."""

    @property
    @abstractmethod
    def form(self) -> str:
        """The payload as the document would draw it, for example ``x|y|z``."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields that a caller gives values for, in order; empty where there is no data."""
        return ()

    def decode(self, data: bytes) -> Decoded:
        """Read `data`; never raises."""
        notes = Diagnostics()
        value = self.read(data, notes)
        return Decoded(value, tuple(notes.complaints), tuple(notes.readings.items()))

    def encode(self, value: Any, dialect: Dialect = DEFAULT) -> bytes:
        """Write `value` as the dialect has it.

        Raises:
            PayloadError: The value cannot be written as the document wants it.
        """
        data = self.write(value, dialect)
        if len(data) > 255:  # noqa: PLR2004 - one length byte
            raise PayloadError(
                UserMessage(
                    "{data_count} bytes of data do not fit one frame (255, L89)",
                    data_count=len(data),
                )
            )
        return data

    @abstractmethod
    def read(self, data: bytes, notes: Diagnostics) -> Any:
        """Read the value and add to `notes`."""

    @abstractmethod
    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Write the value, without looking at the total length."""


@dataclass(frozen=True, slots=True)
class Nothing(Payload):
    """No data: 数据长度为零 (L98, L641)."""

    @property
    def form(self) -> str:
        """Nothing is drawn."""
        return "–"

    def read(self, data: bytes, notes: Diagnostics) -> None:
        """Complain of any data."""
        if data:
            notes.add(
                Defect.SIZE,
                UserMessage("{data_count} bytes of data where none are due", data_count=len(data)),
            )

    def write(self, value: None, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all payloads
        """Write nothing."""
        return b""


@dataclass(frozen=True, slots=True)
class Record(Payload):
    """Fields separated by single bars (L125), made into one value.

    Args:
        parts: The fields, in order.
        make: Builds the value from the fields' values; a tuple type with the same arity. Where
            there is one field and no `make`, the value is the field's own.
    """

    parts: tuple[Field, ...]
    make: Callable[..., Any] | None = None

    @property
    def form(self) -> str:
        """Field names between bars."""
        return "|".join(part.name for part in self.parts)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The parts."""
        return self.parts

    def read(self, data: bytes, notes: Diagnostics) -> Any:
        """Split at the bars and read each field."""
        texts = split(tidy(data, notes), self.parts, notes)
        if len(texts) != len(self.parts):
            notes.add(
                Defect.FIELD_COUNT,
                UserMessage(
                    "{texts_count} fields where {parts_count} are due: {form}",
                    texts_count=len(texts),
                    parts_count=len(self.parts),
                    form=self.form,
                ),
            )
            return None
        values = [part.read(text, notes) for part, text in zip(self.parts, texts, strict=True)]
        if any(value is None for value in values):
            return None
        return self.make(*values) if self.make else values[0]

    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Join the fields by bars."""
        values = value if self.make else (value,)
        texts = [part.write(v, dialect) for part, v in zip(self.parts, values, strict=True)]
        nul = b"\0" if dialect["trailing_nul"] == "yes" else b""
        return b"|".join(texts) + nul


def tidy(data: bytes, notes: Diagnostics, *, digit: bool = True) -> bytes:
    """Take off what text must not carry: quotes (A-0-3), a trailing NUL (A-T-3).

    Alone, or before others, a NUL is a binary digit where one can stand there, and else the end
    of no text.
    """
    if data.endswith(b"\0") and (len(data) > 1 or not digit):
        notes.add(Defect.TRAILING_NUL, "a NUL byte ends the text")
        notes.readings["trailing_nul"] = "yes"
        data = data.rstrip(b"\0") or (b"\0" if digit else b"")
    for opening, closing in ((b'"', b'"'), ("“".encode(), "”".encode())):
        if len(data) > len(opening) and data.startswith(opening) and data.endswith(closing):
            notes.add(Defect.QUOTES, "the quotation marks of the examples are sent")
            data = data[len(opening) : -len(closing)]
    return data


def split(data: bytes, parts: tuple[Field, ...], notes: Diagnostics) -> list[bytes]:
    """Split at the bars, into a text for each part if that can be.

    Blanks for bars are understood, and so are blanks around bars (A-T-4), which a name or a
    password keeps: to it they belong.
    """
    count = len(parts)
    if count == 1:
        return [data]
    if data.count(b"|") == count and data.endswith(b"|"):
        notes.add(Defect.TRAILING_BAR, "a bar ends the text")
        data = data[:-1]
    if b"|" not in data and data.count(b" ") == count - 1:
        notes.add(
            Defect.SPACE_FOR_BAR,
            "blanks where bars are due (a copy of the document that lost them?)",
        )
        return data.split(b" ")
    texts = data.split(b"|")
    if len(texts) != count:
        return texts
    bare = [t if part.opaque else t.strip(b" ") for part, t in zip(parts, texts, strict=True)]
    if bare != texts:
        notes.add(Defect.BLANKS, "blanks around a bar")
    return bare


@dataclass(frozen=True, slots=True)
class Answer(Payload):
    """``1|X``, or the single ``0`` where there is no X to give (L226, L646, L672, L684)."""

    inner: Record
    none_key: str = ""
    """The reading that allows ``0||`` for a bare ``0``, where there is one."""

    @property
    def form(self) -> str:
        """Both shapes."""
        return f"1|{self.inner.form} or 0"

    @property
    def fields(self) -> tuple[Field, ...]:
        """Those of X."""
        return self.inner.fields

    def read(self, data: bytes, notes: Diagnostics) -> Any:
        """Return X, or None for ``0``."""
        data = tidy(data, notes)
        flag, bar, rest = data[:1], data[1:2], data[2:]
        if flag in (b"\0", b"\1"):
            notes.readings["runinfo_binary"] = "binary"
            if not self.none_key:
                notes.add(
                    Defect.BINARY,
                    UserMessage(
                        "the flag is the byte {flag:02X}, not an ASCII digit", flag=flag[0]
                    ),
                )
            flag = b"1" if flag == b"\1" else b"0"
        if flag == b"0" and not bar:
            if self.none_key:
                notes.readings[self.none_key] = "0"
            return None
        empty = b"|" * (len(self.inner.parts) - 1)
        if flag == b"0" and self.none_key and bar + rest == b"|" + empty:
            notes.readings[self.none_key] = "0||"
            return None
        if flag not in (b"0", b"1"):
            notes.add(
                Defect.FLAG,
                UserMessage("the flag is {flag!r}, neither '1' nor '0'", flag=show(flag)),
            )
            return None
        if flag == b"0":
            notes.add(
                Defect.FLAG, UserMessage("a '0' is followed by {data!r}", data=show(data[1:]))
            )
            return None
        if bar == b" ":
            notes.add(Defect.SPACE_FOR_BAR, "a blank where the bar after the flag is due")
        elif bar != b"|":
            notes.add(
                Defect.FIELD_COUNT,
                UserMessage("no bar after the flag in {data!r}", data=show(data)),
            )
            return None
        return self.inner.read(rest, notes)

    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Write X behind ``1|``, or ``0`` for None."""
        binary = self.none_key and dialect["runinfo_binary"] == "binary"
        if value is None:
            zero = b"\0" if binary else b"0"
            if self.none_key and dialect[self.none_key] == "0||":
                return zero + b"|" * len(self.inner.parts)
            return zero
        return (b"\1|" if binary else b"1|") + self.inner.write(value, dialect)


class Acceptance(NamedTuple):
    """A first reply: accepted, or refused for the reason that table 8-1 gives `code`."""

    accepted: bool
    code: str | None = None


class Outcome(NamedTuple):
    """A final result: done (``11``), or failed with a code of table 8-1 (``00|code``)."""

    done: bool
    code: str | None = None


_CODE = StatusCode("code")


def _read_coded(data: bytes, zero: bytes, notes: Diagnostics) -> str | None:
    """Read ``zero|code``."""
    sep, text = data[len(zero) : len(zero) + 1], data[len(zero) + 1 :]
    if sep == b" ":
        notes.add(Defect.SPACE_FOR_BAR, "a blank where the bar before the code is due (A-0-2)")
        notes.readings["err_sep"] = "space"
    elif sep != b"|":
        notes.add(
            Defect.FIELD_COUNT, UserMessage("{data!r} has no bar before its code", data=show(data))
        )
        return None
    value = _CODE.read(text, notes)
    return value if isinstance(value, str) else None


def _write_coded(zero: bytes, code: str, dialect: Dialect) -> bytes:
    sep = b" " if dialect["err_sep"] == "space" else b"|"
    return zero + sep + _CODE.write(code, dialect)


@dataclass(frozen=True, slots=True)
class FirstReply(Payload):
    """``1``, or ``0|code`` (L311-316, L399, L701-706); ``0`` alone where no reason is drawn."""

    reasoned: bool = True
    bare_key: str = ""
    """The reading that allows ``0`` alone although a reason is drawn, where there is one."""

    @property
    def form(self) -> str:
        """Both shapes."""
        return "1 or 0|code" if self.reasoned else "1 or 0"

    def read(self, data: bytes, notes: Diagnostics) -> Acceptance | None:
        """Read the acceptance or the refusal."""
        data = tidy(data, notes)
        if data in (b"1", b"\1"):
            if data == b"\1":
                notes.add(Defect.BINARY, "the flag is the byte 01, not an ASCII digit")
            return Acceptance(accepted=True)
        if data in (b"0", b"\0"):
            if data == b"\0":
                notes.add(Defect.BINARY, "the flag is the byte 00, not an ASCII digit")
            if self.bare_key:
                notes.readings[self.bare_key] = "0"
            elif self.reasoned:
                notes.add(Defect.NO_CODE, "the refusal gives no reason")
            return Acceptance(accepted=False)
        if data[:1] == b"0" and self.reasoned:
            if self.bare_key:
                notes.readings[self.bare_key] = "0|code"
            return Acceptance(accepted=False, code=_read_coded(data, b"0", notes))
        notes.add(
            Defect.FLAG, UserMessage("{data!r} is not {form}", data=show(data), form=self.form)
        )
        return Acceptance(accepted=False) if data[:1] == b"0" else None

    def write(self, value: Acceptance, dialect: Dialect) -> bytes:
        """Write the acceptance or the refusal."""
        if value.accepted:
            return b"1"
        if not self.reasoned or (self.bare_key and dialect[self.bare_key] == "0"):
            return b"0"
        if value.code is None:
            raise PayloadError("a refusal needs a code of table 8-1 (L311-316)")
        return _write_coded(b"0", value.code, dialect)


@dataclass(frozen=True, slots=True)
class FinalResult(Payload):
    """``11``, or ``00|code`` (L318-328): here 11 and 00 are no codes of table 8-1 (A-3-8)."""

    @property
    def form(self) -> str:
        """Both shapes."""
        return "11 or 00|code"

    def read(self, data: bytes, notes: Diagnostics) -> Outcome | None:
        """Read success or failure."""
        data = tidy(data, notes)
        if data == b"11":
            return Outcome(done=True)
        if data[:2] == b"00":
            return Outcome(done=False, code=_read_coded(data, b"00", notes))
        notes.add(
            Defect.FLAG, UserMessage("{data!r} is not {form}", data=show(data), form=self.form)
        )
        return None

    def write(self, value: Outcome, dialect: Dialect) -> bytes:
        """Write success or failure."""
        if value.done:
            return b"11"
        if value.code is None:
            raise PayloadError("a failed final result needs a code of table 8-1 (L323-328)")
        return _write_coded(b"00", value.code, dialect)


class NameListPart(NamedTuple):
    """One message of a program list: whether another follows, and its names."""

    more: bool
    names: tuple[bytes, ...]


_NAME = Name("name")


@dataclass(frozen=True, slots=True)
class NameList(Payload):
    """``0`` or ``1``, then names between bars (L246-251)."""

    @property
    def form(self) -> str:
        """One message of the list."""
        return "0|name|… or 1|name|…"

    def read(self, data: bytes, notes: Diagnostics) -> NameListPart | None:
        """Read one message; the bar after the flag is a reading (A-4.10-2)."""
        if not data:
            notes.readings["list_empty"] = "empty"
            return NameListPart(more=False, names=())
        data = tidy(data, notes)
        flag, rest = data[:1], data[1:]
        if flag not in (b"0", b"1"):
            notes.add(
                Defect.FLAG,
                UserMessage("the list begins with {flag!r}, neither '0' nor '1'", flag=show(flag)),
            )
            return None
        more = flag == b"1"
        if rest in (b"", b"|"):
            notes.readings["list_empty"] = "0|" if rest else "0"
            return NameListPart(more, ())
        barred = rest[:1] == b"|"
        notes.readings["list_prefix_sep"] = "0|a" if barred else "0a"
        body = rest[1:] if barred else rest
        if not barred and body[:1] == b" " and b"|" not in body:
            notes.add(Defect.SPACE_FOR_BAR, "blanks where bars are due")
            body = body[1:].replace(b" ", b"|")
        if body.endswith(b"|"):
            notes.add(Defect.TRAILING_BAR, "a bar ends the list")
            body = body[:-1]
        names = tuple(body.split(b"|"))
        for name in names:
            _NAME.read(name, notes)
        if len(set(names)) < len(names):
            notes.add(Defect.REPEATED_NAME, "a name stands twice in the list")
        return NameListPart(more, names)

    def write(self, value: NameListPart, dialect: Dialect) -> bytes:
        """Write one message."""
        flag = b"1" if value.more else b"0"
        if not value.names:
            return {"0": flag, "0|": flag + b"|", "empty": b""}[dialect["list_empty"]]
        bar = b"|" if dialect["list_prefix_sep"] == "0|a" else b""
        return flag + bar + b"|".join(value.names)


@dataclass(frozen=True, slots=True)
class OptionalName(Payload):
    """The default program's name; empty or ``0`` where none is set (A-4.12-2)."""

    @property
    def form(self) -> str:
        """A name or nothing."""
        return "name or nothing"

    def read(self, data: bytes, notes: Diagnostics) -> bytes:
        """Return the name, empty where there is none."""
        data = tidy(data, notes, digit=False)
        if data in (b"", b"0"):
            notes.readings["default_none"] = "0" if data else "empty"
            return b""
        _NAME.read(data, notes)
        return data

    def write(self, value: bytes, dialect: Dialect) -> bytes:
        """Write the name or the sign for none."""
        if not value:
            return b"0" if dialect["default_none"] == "0" else b""
        return value


class JogDirection(Enum):
    """The axis and sense of a jog, by its number in the list (L605-608)."""

    PLUS_Y = 1
    MINUS_Y = 2
    PLUS_X = 3
    MINUS_X = 4

    def __str__(self) -> str:
        sign, _, axis = self.name.partition("_")
        return ("+" if sign == "PLUS" else "-") + axis.lower()


@dataclass(frozen=True, slots=True)
class Jog(Payload):
    """One byte, 1 to 4, as an ASCII digit or binary (L600-608; A-4.28-1)."""

    @property
    def form(self) -> str:
        """One digit."""
        return "1|2|3|4 (one byte: +y, -y, +x, -x)"

    def read(self, data: bytes, notes: Diagnostics) -> JogDirection | None:
        """Read the direction; the two notations do not overlap."""
        if len(data) != 1:
            notes.add(
                Defect.SIZE,
                UserMessage("{data_count} bytes where exactly one is due", data_count=len(data)),
            )
            return None
        number = data[0] - 0x30 if data[0] >= 0x30 else data[0]  # noqa: PLR2004 - ASCII '0'
        if not 1 <= number <= 4:  # noqa: PLR2004 - L605-608
            notes.add(
                Defect.RANGE,
                UserMessage("direction {upper} is none of 1 to 4", upper=data.hex().upper()),
            )
            return None
        notes.readings["jog_byte"] = "ascii" if data[0] >= 0x30 else "binary"  # noqa: PLR2004 - as above
        return JogDirection(number)

    def write(self, value: JogDirection, dialect: Dialect) -> bytes:
        """Write the direction."""
        return bytes((value.value + (0 if dialect["jog_byte"] == "binary" else 0x30),))


FLAG = Record((Flag("done"),))
"""``1`` success, ``0`` failure."""
