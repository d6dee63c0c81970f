"""Payloads: the data of a frame as a sequence of fields, for requests, replies and final results.

There is one class for each form that the document shows. Decoding never raises and reports each
deviation as an issue. Encoding follows a dialect and raises an error for values that the document
forbids. The command table in `commands` assigns the payloads to the commands.
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
    """A decoded payload: its value, its issues, and the readings of open points that it shows.

    `value` is None if the bytes cannot be decoded, and for payloads without data.
    """

    value: Any
    issues: tuple[DecodeIssue, ...] = ()
    readings: tuple[tuple[str, str], ...] = ()


class Payload(ABC):
    """The data part of one kind of frame."""

    @property
    @abstractmethod
    def form(self) -> str:
        """The form in the notation of the document, for example ``x|y|z``."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields for which the caller supplies values, in order; empty without data."""
        return ()

    def decode(self, data: bytes) -> Decoded:
        """Decode `data`; never raises."""
        diagnostics = Diagnostics()
        value = self.read(data, diagnostics)
        return Decoded(value, tuple(diagnostics.issues), tuple(diagnostics.readings.items()))

    def encode(self, value: Any, dialect: Dialect = DEFAULT) -> bytes:
        """Encode `value` in the given dialect.

        Raises:
            PayloadError: The document allows no encoding of this value.
        """
        data = self.write(value, dialect)
        if len(data) > 255:  # noqa: PLR2004 - one length byte
            raise PayloadError(
                UserMessage(
                    "{byte_count} bytes of data do not fit into one frame (255, L89)",
                    byte_count=len(data),
                )
            )
        return data

    @abstractmethod
    def read(self, data: bytes, diagnostics: Diagnostics) -> Any:
        """Decode the value and add issues and readings to `diagnostics`."""

    @abstractmethod
    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Encode the value, without checking the total length."""


@dataclass(frozen=True, slots=True)
class NoData(Payload):
    """No data: 数据长度为零 (L98, L641)."""

    @property
    def form(self) -> str:
        """A dash: there is no data."""
        return "–"

    def read(self, data: bytes, diagnostics: Diagnostics) -> None:
        """Report any data as an issue."""
        if data:
            diagnostics.add(
                Defect.SIZE,
                UserMessage(
                    "{byte_count} bytes of data, but none are expected", byte_count=len(data)
                ),
            )

    def write(self, value: None, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all payloads
        """Return no bytes."""
        return b""


@dataclass(frozen=True, slots=True)
class Record(Payload):
    """Fields separated by single bars (L125), combined into one value.

    Args:
        parts: The fields, in order.
        factory: Builds the value from the values of the fields; a tuple type of the same arity.
            Without a `factory`, there must be one field, and the value is that of the field.
    """

    parts: tuple[Field, ...]
    factory: Callable[..., Any] | None = None

    @property
    def form(self) -> str:
        """The field names, separated by bars."""
        return "|".join(part.name for part in self.parts)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The parts."""
        return self.parts

    def read(self, data: bytes, diagnostics: Diagnostics) -> Any:
        """Split at the bars and decode each field."""
        texts = split_fields(normalize(data, diagnostics), self.parts, diagnostics)
        if len(texts) != len(self.parts):
            diagnostics.add(
                Defect.FIELD_COUNT,
                UserMessage(
                    "{observed_count} fields, but {expected_count} are expected: {form}",
                    observed_count=len(texts),
                    expected_count=len(self.parts),
                    form=self.form,
                ),
            )
            return None
        values = [
            part.read(text, diagnostics) for part, text in zip(self.parts, texts, strict=True)
        ]
        if any(value is None for value in values):
            return None
        return self.factory(*values) if self.factory else values[0]

    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Join the encoded fields with bars."""
        values = value if self.factory else (value,)
        texts = [part.write(v, dialect) for part, v in zip(self.parts, values, strict=True)]
        nul = b"\0" if dialect["trailing_nul"] == "yes" else b""
        return b"|".join(texts) + nul


def normalize(data: bytes, diagnostics: Diagnostics, *, digit: bool = True) -> bytes:
    """Remove quotation marks (A-0-3) and trailing NULs (A-T-3), and report them as issues.

    Args:
        data: The data of a frame.
        diagnostics: Receives the issues.
        digit: The data may consist of one binary digit: the first byte is kept even if it is NUL.
    """
    if data.endswith(b"\0") and (len(data) > 1 or not digit):
        diagnostics.add(Defect.TRAILING_NUL, "the text ends with a NUL byte")
        diagnostics.readings["trailing_nul"] = "yes"
        data = data.rstrip(b"\0") or (b"\0" if digit else b"")
    for opening, closing in ((b'"', b'"'), ("“".encode(), "”".encode())):
        if len(data) > len(opening) and data.startswith(opening) and data.endswith(closing):
            diagnostics.add(Defect.QUOTES, "the data contains the quotation marks of the examples")
            data = data[len(opening) : -len(closing)]
    return data


def split_fields(data: bytes, parts: tuple[Field, ...], diagnostics: Diagnostics) -> list[bytes]:
    """Split the data at the bars, if possible into one text for each part.

    Spaces in place of bars and spaces around bars are issues (A-T-4) and are removed. A name or a
    password keeps its spaces, because they belong to the value.
    """
    count = len(parts)
    if count == 1:
        return [data]
    if data.count(b"|") == count and data.endswith(b"|"):
        diagnostics.add(Defect.TRAILING_BAR, "the text ends with a bar")
        data = data[:-1]
    if b"|" not in data and data.count(b" ") == count - 1:
        diagnostics.add(
            Defect.SPACE_FOR_BAR,
            "spaces in place of bars (perhaps copied from the document, where bars are lost)",
        )
        return data.split(b" ")
    texts = data.split(b"|")
    if len(texts) != count or b" " not in data:
        return texts
    bare = [t if part.opaque else t.strip(b" ") for part, t in zip(parts, texts, strict=True)]
    if bare != texts:
        diagnostics.add(Defect.BLANKS, "spaces around a bar")
    return bare


@dataclass(frozen=True, slots=True)
class OptionalRecord(Payload):
    """``1|X``, or ``0`` if there is no X (L226, L646, L672, L684)."""

    inner: Record
    none_reading: str = ""
    """The open point on whether ``0`` or ``0||`` is sent, empty if there is none."""

    @property
    def form(self) -> str:
        """Both forms."""
        return f"1|{self.inner.form} or 0"

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields of X."""
        return self.inner.fields

    def read(self, data: bytes, diagnostics: Diagnostics) -> Any:
        """Return X, or None for ``0``."""
        data = normalize(data, diagnostics)
        flag, bar, rest = data[:1], data[1:2], data[2:]
        if flag in (b"\0", b"\1"):
            diagnostics.readings["runinfo_binary"] = "binary"
            if not self.none_reading:
                diagnostics.add(
                    Defect.BINARY,
                    UserMessage(
                        "the flag is the byte {flag:02X}, not an ASCII digit", flag=flag[0]
                    ),
                )
            flag = b"1" if flag == b"\1" else b"0"
        if flag == b"0" and not bar:
            if self.none_reading:
                diagnostics.readings[self.none_reading] = "0"
            return None
        empty = b"|" * (len(self.inner.parts) - 1)
        if flag == b"0" and self.none_reading and bar + rest == b"|" + empty:
            diagnostics.readings[self.none_reading] = "0||"
            return None
        if flag not in (b"0", b"1"):
            diagnostics.add(
                Defect.FLAG,
                UserMessage("the flag is {flag!r}, not '1' or '0'", flag=show(flag)),
            )
            return None
        if flag == b"0":
            diagnostics.add(
                Defect.FLAG,
                UserMessage("unexpected data {data!r} after the flag '0'", data=show(data[1:])),
            )
            return None
        if bar == b" ":
            diagnostics.add(Defect.SPACE_FOR_BAR, "a space in place of the bar after the flag")
        elif bar != b"|":
            diagnostics.add(
                Defect.FIELD_COUNT,
                UserMessage("no bar after the flag in {data!r}", data=show(data)),
            )
            return None
        return self.inner.read(rest, diagnostics)

    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Return ``1|`` and the encoded X, or ``0`` for None."""
        binary = self.none_reading and dialect["runinfo_binary"] == "binary"
        if value is None:
            zero = b"\0" if binary else b"0"
            if self.none_reading and dialect[self.none_reading] == "0||":
                return zero + b"|" * len(self.inner.parts)
            return zero
        return (b"\1|" if binary else b"1|") + self.inner.write(value, dialect)


class Acceptance(NamedTuple):
    """A first reply: accepted, or refused with a code of table 8-1."""

    accepted: bool
    code: str | None = None


class Outcome(NamedTuple):
    """A final result: done (``11``), or failed with a code of table 8-1 (``00|code``)."""

    done: bool
    code: str | None = None


_CODE = StatusCode("code")


def _read_coded(data: bytes, zero: bytes, diagnostics: Diagnostics) -> str | None:
    """Decode ``zero|code``."""
    sep, text = data[len(zero) : len(zero) + 1], data[len(zero) + 1 :]
    if sep == b" ":
        diagnostics.add(Defect.SPACE_FOR_BAR, "a space in place of the bar before the code (A-0-2)")
        diagnostics.readings["err_sep"] = "space"
    elif sep != b"|":
        diagnostics.add(
            Defect.FIELD_COUNT, UserMessage("{data!r} has no bar before its code", data=show(data))
        )
        return None
    value = _CODE.read(text, diagnostics)
    return value if isinstance(value, str) else None


def _write_coded(zero: bytes, code: str, dialect: Dialect) -> bytes:
    sep = b" " if dialect["err_sep"] == "space" else b"|"
    return zero + sep + _CODE.write(code, dialect)


@dataclass(frozen=True, slots=True)
class FirstReply(Payload):
    """``1``, or ``0|code`` (L311-316, L399, L701-706).

    A refusal is ``0`` alone if `has_code` is false.
    """

    has_code: bool = True
    bare_reading: str = ""
    """The open point on whether a refusal is ``0`` alone or ``0|code``, empty if there is none."""

    @property
    def form(self) -> str:
        """Both forms."""
        return "1 or 0|code" if self.has_code else "1 or 0"

    def read(self, data: bytes, diagnostics: Diagnostics) -> Acceptance | None:
        """Decode the acceptance or the refusal."""
        data = normalize(data, diagnostics)
        if data in (b"1", b"\1"):
            if data == b"\1":
                diagnostics.add(Defect.BINARY, "the flag is the byte 01, not an ASCII digit")
            return Acceptance(accepted=True)
        if data in (b"0", b"\0"):
            if data == b"\0":
                diagnostics.add(Defect.BINARY, "the flag is the byte 00, not an ASCII digit")
            if self.bare_reading:
                diagnostics.readings[self.bare_reading] = "0"
            elif self.has_code:
                diagnostics.add(Defect.NO_CODE, "the refusal has no error code")
            return Acceptance(accepted=False)
        if data[:1] == b"0" and self.has_code:
            if self.bare_reading:
                diagnostics.readings[self.bare_reading] = "0|code"
            return Acceptance(accepted=False, code=_read_coded(data, b"0", diagnostics))
        diagnostics.add(
            Defect.FLAG,
            UserMessage("{data!r} does not have the form {form}", data=show(data), form=self.form),
        )
        return Acceptance(accepted=False) if data[:1] == b"0" else None

    def write(self, value: Acceptance, dialect: Dialect) -> bytes:
        """Encode the acceptance or the refusal."""
        if value.accepted:
            return b"1"
        if not self.has_code or (self.bare_reading and dialect[self.bare_reading] == "0"):
            return b"0"
        if value.code is None:
            raise PayloadError("a refusal needs a code of table 8-1 (L311-316)")
        return _write_coded(b"0", value.code, dialect)


@dataclass(frozen=True, slots=True)
class FinalResult(Payload):
    """``11``, or ``00|code`` (L318-328); 11 and 00 are not codes of table 8-1 here (A-3-8)."""

    @property
    def form(self) -> str:
        """Both forms."""
        return "11 or 00|code"

    def read(self, data: bytes, diagnostics: Diagnostics) -> Outcome | None:
        """Decode success or failure."""
        data = normalize(data, diagnostics)
        if data == b"11":
            return Outcome(done=True)
        if data[:2] == b"00":
            return Outcome(done=False, code=_read_coded(data, b"00", diagnostics))
        diagnostics.add(
            Defect.FLAG,
            UserMessage("{data!r} does not have the form {form}", data=show(data), form=self.form),
        )
        return None

    def write(self, value: Outcome, dialect: Dialect) -> bytes:
        """Encode success or failure."""
        if value.done:
            return b"11"
        if value.code is None:
            raise PayloadError("a failed final result needs a code of table 8-1 (L323-328)")
        return _write_coded(b"00", value.code, dialect)


class NameListPart(NamedTuple):
    """One message of a program list: whether another message follows, and the names."""

    more: bool
    names: tuple[bytes, ...]


_NAME = Name("name")


@dataclass(frozen=True, slots=True)
class NameList(Payload):
    """``0`` or ``1``, then names separated by bars (L246-251)."""

    @property
    def form(self) -> str:
        """The form of one message."""
        return "0|name|… or 1|name|…"

    def read(self, data: bytes, diagnostics: Diagnostics) -> NameListPart | None:
        """Decode one message; the bar after the flag is an open point (A-4.10-2)."""
        if not data:
            diagnostics.readings["list_empty"] = "empty"
            return NameListPart(more=False, names=())
        data = normalize(data, diagnostics)
        flag, rest = data[:1], data[1:]
        if flag not in (b"0", b"1"):
            diagnostics.add(
                Defect.FLAG,
                UserMessage("the list begins with {flag!r}, not '0' or '1'", flag=show(flag)),
            )
            return None
        more = flag == b"1"
        if rest in (b"", b"|"):
            diagnostics.readings["list_empty"] = "0|" if rest else "0"
            return NameListPart(more, ())
        barred = rest[:1] == b"|"
        diagnostics.readings["list_prefix_sep"] = "0|a" if barred else "0a"
        body = rest[1:] if barred else rest
        if not barred and body[:1] == b" " and b"|" not in body:
            diagnostics.add(Defect.SPACE_FOR_BAR, "spaces in place of bars")
            body = body[1:].replace(b" ", b"|")
        if body.endswith(b"|"):
            diagnostics.add(Defect.TRAILING_BAR, "the list ends with a bar")
            body = body[:-1]
        names = tuple(body.split(b"|"))
        for name in names:
            _NAME.read(name, diagnostics)
        if len(set(names)) < len(names):
            diagnostics.add(Defect.REPEATED_NAME, "the list contains a name twice")
        return NameListPart(more, names)

    def write(self, value: NameListPart, dialect: Dialect) -> bytes:
        """Encode one message."""
        flag = b"1" if value.more else b"0"
        if not value.names:
            return {"0": flag, "0|": flag + b"|", "empty": b""}[dialect["list_empty"]]
        bar = b"|" if dialect["list_prefix_sep"] == "0|a" else b""
        return flag + bar + b"|".join(value.names)


@dataclass(frozen=True, slots=True)
class OptionalName(Payload):
    """The name of the default program; empty or ``0`` if none is set (A-4.12-2)."""

    @property
    def form(self) -> str:
        """A name or nothing."""
        return "name or nothing"

    def read(self, data: bytes, diagnostics: Diagnostics) -> bytes:
        """Return the name, empty if none is set."""
        data = normalize(data, diagnostics, digit=False)
        if data in (b"", b"0"):
            diagnostics.readings["default_none"] = "0" if data else "empty"
            return b""
        _NAME.read(data, diagnostics)
        return data

    def write(self, value: bytes, dialect: Dialect) -> bytes:
        """Return the name, or the encoding of no name."""
        if not value:
            return b"0" if dialect["default_none"] == "0" else b""
        return value


class JogDirection(Enum):
    """The axis and direction of a jog; the value is its number in the document (L605-608)."""

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

    def read(self, data: bytes, diagnostics: Diagnostics) -> JogDirection | None:
        """Decode the direction; the two notations do not overlap."""
        if len(data) != 1:
            diagnostics.add(
                Defect.SIZE,
                UserMessage(
                    "{byte_count} bytes, but exactly one is expected", byte_count=len(data)
                ),
            )
            return None
        number = data[0] - 0x30 if data[0] >= 0x30 else data[0]  # noqa: PLR2004 - ASCII '0'
        if not 1 <= number <= 4:  # noqa: PLR2004 - L605-608
            diagnostics.add(
                Defect.RANGE,
                UserMessage(
                    "direction {direction} is not one of 1 to 4", direction=data.hex().upper()
                ),
            )
            return None
        diagnostics.readings["jog_byte"] = "ascii" if data[0] >= 0x30 else "binary"  # noqa: PLR2004 - as above
        return JogDirection(number)

    def write(self, value: JogDirection, dialect: Dialect) -> bytes:
        """Encode the direction."""
        return bytes((value.value + (0 if dialect["jog_byte"] == "binary" else 0x30),))


FLAG = Record((Flag("done"),))
"""``1`` success, ``0`` failure."""
