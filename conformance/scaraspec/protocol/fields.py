"""Fields: one value between two bars (the text conventions of clauses 3 and 4).

Each field is decoded leniently and encoded strictly. Decoding never raises: it returns the value
that was most likely intended, and an issue for each deviation from the document. The judge decides
the verdict on an issue. Payloads, which consist of fields, are in `payloads`.
"""

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from typing import Any, ClassVar, Final

from scaraspec.protocol import errors
from scaraspec.protocol.readings import Dialect
from scaraspec.user_message import UserMessage

NAME_MAX_BYTES: Final = 30
"""一般不超过 30 个字节 (L226): a recommendation for received names, a limit for ours (A-4.9-5)."""


class PayloadError(ValueError):
    """A value cannot be encoded as the document requires; the message names it and the reason."""


class Defect(Enum):
    """How a payload deviates from the document. The judge maps each defect to a requirement."""

    SIZE = "size"  # missing data, unexpected data, or a wrong fixed length
    FIELD_COUNT = "field count"
    SPACE_FOR_BAR = "space for bar"  # the document prints spaces for lost bars (A-0-1)
    QUOTES = "quotes"
    TRAILING_NUL = "trailing NUL"
    TRAILING_BAR = "trailing bar"
    BLANKS = "blanks"
    NO_CODE = "no code"  # a refusal without an error code (A-4.24-3)
    BINARY = "binary digit"  # 0x00-0x09 in place of an ASCII digit (A-T-1)
    FLAG = "flag"
    NUMBER = "number"
    RANGE = "range"
    CODE = "code"  # not two characters of table 8-1
    RESERVED_CODE = "reserved code"
    CLOCK = "clock"  # not 14 digits
    CALENDAR = "calendar"  # 14 digits that are not a valid date and time
    RUN_TIME = "run time"
    ADDRESS = "address"
    BITS = "bits"
    VERSION = "version"
    EMPTY_NAME = "empty name"
    REPEATED_NAME = "repeated name"
    LONG_NAME = "long name"
    BAR_IN_NAME = "bar in name"
    PATH_IN_NAME = "path in name"
    CHUNK = "chunk"  # fileData whose length or position is out of bounds

    __hash__ = object.__hash__


@dataclass(frozen=True, slots=True)
class DecodeIssue:
    """One deviation of a payload from the document, with a short description."""

    defect: Defect
    text: str


@dataclass(slots=True)
class Diagnostics:
    """What a decoder found: issues, and the readings of open points that the bytes show."""

    issues: list[DecodeIssue] = field(default_factory=list)
    readings: dict[str, str] = field(default_factory=dict)

    def add(self, defect: Defect, text: str) -> None:
        """Add one issue."""
        self.issues.append(DecodeIssue(defect, text))


SHOWN_CHARACTERS: Final = 60
"""Bytes are shown as text of at most so many characters."""


def show(data: bytes, limit: int = SHOWN_CHARACTERS) -> str:
    """Return bytes as printable text: UTF-8, else GB18030, else Latin-1 (A-T-2).

    Unprintable characters are escaped. A text longer than `limit` characters is cut.
    """
    for encoding in ("utf-8", "gb18030"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        break
    else:
        text = data.decode("latin-1")
    if not text.isprintable():
        text = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    return text if len(text) <= limit else text[: limit - 1] + "…"


@dataclass(frozen=True, slots=True)
class Field(ABC):
    """A named field; each subclass defines one text format.

    Attributes:
        name: The name of the field.
        unit: The unit of the value, empty if it has none.
        opaque: The protocol does not interpret the bytes: spaces at the ends belong to the value.
    """

    name: str
    unit: str = ""
    opaque: ClassVar[bool] = False

    @abstractmethod
    def read(self, text: bytes, diagnostics: Diagnostics) -> Any:
        """Decode the value, or return None if that is impossible; add issues to `diagnostics`."""

    @abstractmethod
    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Encode the value.

        Raises:
            PayloadError: The document allows no encoding of this value.
        """


_DECIMAL = re.compile(rb"-?[0-9]+(\.[0-9]+)?")
_INTEGER = re.compile(rb"-?[0-9]+")


@dataclass(frozen=True, slots=True)
class Number(Field):
    """A plain decimal number with a decimal point (A-T-5), encoded with at most 3 decimals."""

    def read(self, text: bytes, diagnostics: Diagnostics) -> float | None:
        """Decode a number; any other notation is an issue and has no value."""
        if _DECIMAL.fullmatch(text):
            return float(text)
        diagnostics.add(
            Defect.NUMBER,
            UserMessage(
                "{field} {text!r} is not a plain decimal number", field=self.name, text=show(text)
            ),
        )
        return None

    def write(self, value: float, dialect: Dialect) -> bytes:
        """Encode a finite number without an exponent; -0.0 has no sign."""
        if not abs(value) < 1e15:  # noqa: PLR2004 - nan fails the comparison, too; larger floats skip integers
            raise PayloadError(
                UserMessage(
                    "{field} must be a finite number, not {value!r}", field=self.name, value=value
                )
            )
        if dialect["num_format"] == "one-decimal":
            return b"%.1f" % (round(value, 1) + 0.0)
        text = b"%.3f" % (round(value, 3) + 0.0)
        return text.rstrip(b"0").rstrip(b".")


@dataclass(frozen=True, slots=True)
class Integer(Field):
    """An integer within bounds, padded with zeros to `width` characters."""

    minimum: int = 0
    maximum: int = 255
    width: int = 1

    def read(self, text: bytes, diagnostics: Diagnostics) -> int | None:
        """Decode an integer; a value out of bounds is an issue and is returned."""
        if not _INTEGER.fullmatch(text) or len(text) > 20:  # noqa: PLR2004 - no integer of this protocol has more digits
            diagnostics.add(
                Defect.NUMBER,
                UserMessage("{field} {text!r} is not an integer", field=self.name, text=show(text)),
            )
            return None
        value = int(text)
        if not self.minimum <= value <= self.maximum:
            diagnostics.add(
                Defect.RANGE,
                UserMessage(
                    "{field} {value} is out of range: {minimum} to {maximum}",
                    field=self.name,
                    value=value,
                    minimum=self.minimum,
                    maximum=self.maximum,
                ),
            )
        return value

    def write(self, value: int, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Encode an integer within its bounds."""
        if value != int(value) or not self.minimum <= value <= self.maximum:
            raise PayloadError(
                UserMessage(
                    "{field} must be an integer from {minimum} to {maximum}, not {value!r}",
                    field=self.name,
                    minimum=self.minimum,
                    maximum=self.maximum,
                    value=value,
                )
            )
        return b"%0*d" % (self.width, value)


@dataclass(frozen=True, slots=True)
class Text(Field):
    """Opaque bytes, such as a password (L109): not empty, without a bar (A-T-6)."""

    opaque: ClassVar[bool] = True
    maximum_bytes: int = 255

    def read(self, text: bytes, diagnostics: Diagnostics) -> bytes:
        """Return the bytes unchanged."""
        if not text:
            diagnostics.add(Defect.SIZE, UserMessage("{field} is empty", field=self.name))
        elif b"|" in text:
            diagnostics.add(
                Defect.BAR_IN_NAME,
                UserMessage("{field} contains the separator '|'", field=self.name),
            )
        return text

    def write(self, value: bytes, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Return the bytes unchanged."""
        if not 1 <= len(value) <= self.maximum_bytes:
            raise PayloadError(
                UserMessage(
                    "{field} must have 1 to {maximum_bytes} bytes, not {byte_count}",
                    field=self.name,
                    maximum_bytes=self.maximum_bytes,
                    byte_count=len(value),
                )
            )
        if b"|" in value:
            raise PayloadError(
                UserMessage("{field} must not contain '|', the separator (L125)", field=self.name)
            )
        return value


@dataclass(frozen=True, slots=True)
class Name(Field):
    """A program or file name (A-5-20): opaque bytes, at most 30 (L226)."""

    opaque: ClassVar[bool] = True

    def read(self, text: bytes, diagnostics: Diagnostics) -> bytes:
        """Return the bytes unchanged."""
        if not text:
            diagnostics.add(Defect.EMPTY_NAME, UserMessage("{field} is empty", field=self.name))
        if b"|" in text:
            diagnostics.add(
                Defect.BAR_IN_NAME,
                UserMessage(
                    "{field} {text!r} contains the separator '|'", field=self.name, text=show(text)
                ),
            )
        if len(text) > NAME_MAX_BYTES:
            diagnostics.add(
                Defect.LONG_NAME,
                UserMessage(
                    "{field} has {byte_count} bytes, more than 30",
                    field=self.name,
                    byte_count=len(text),
                ),
            )
        if b"/" in text or b"\\" in text or b"\0" in text or text in (b".", b".."):
            diagnostics.add(
                Defect.PATH_IN_NAME,
                UserMessage(
                    "{field} {text!r} contains a path element", field=self.name, text=show(text)
                ),
            )
        return text

    def write(self, value: bytes, dialect: Dialect) -> bytes:
        """Encode a name that every reading of the document allows."""
        maximum = 255 if dialect["name_max"] == "255" else NAME_MAX_BYTES
        if not 1 <= len(value) <= maximum:
            raise PayloadError(
                UserMessage(
                    "{field} must have 1 to {maximum} bytes, not {byte_count}",
                    field=self.name,
                    maximum=maximum,
                    byte_count=len(value),
                )
            )
        if any(c in value for c in (b"|", b"/", b"\\", b"\0")) or value in (b".", b".."):
            raise PayloadError(
                UserMessage(
                    "{field} {value!r} contains a separator or path element",
                    field=self.name,
                    value=show(value),
                )
            )
        return value


@dataclass(frozen=True, slots=True)
class Flag(Field):
    """``1`` or ``0``."""

    def read(self, text: bytes, diagnostics: Diagnostics) -> bool | None:
        """Decode the flag; a binary 0 or 1 is an issue and is returned (A-T-1)."""
        if text in (b"1", b"0"):
            return text == b"1"
        if text in (b"\x00", b"\x01"):
            diagnostics.add(
                Defect.BINARY,
                UserMessage(
                    "{field} is the byte {byte:02X}, not an ASCII digit",
                    field=self.name,
                    byte=text[0],
                ),
            )
            return text == b"\x01"
        diagnostics.add(
            Defect.FLAG,
            UserMessage("{field} is {text!r}, not '1' or '0'", field=self.name, text=show(text)),
        )
        return None

    def write(self, value: bool, dialect: Dialect) -> bytes:  # noqa: ARG002, FBT001 - one signature for all fields
        """Encode the flag."""
        return b"1" if value else b"0"


@dataclass(frozen=True, slots=True)
class Clock(Field):
    """YYYYMMDDHHMMSS (L169, L186); the value is a naive `datetime` (A-4.5-1)."""

    def read(self, text: bytes, diagnostics: Diagnostics) -> datetime | None:
        """Decode a date and time."""
        if len(text) != 14 or not text.isdigit():  # noqa: PLR2004 - YYYYMMDDHHMMSS
            diagnostics.add(
                Defect.CLOCK,
                UserMessage(
                    "{field} {text!r} is not 14 digits (YYYYMMDDHHMMSS)",
                    field=self.name,
                    text=show(text),
                ),
            )
            return None
        year, *rest = int(text[:4]), *(int(text[i : i + 2]) for i in range(4, 14, 2))
        month, day, hour, minute, second = rest
        try:
            return datetime(year, month, day, hour, minute, second)  # noqa: DTZ001 - the document names no zone
        except ValueError:
            diagnostics.add(
                Defect.CALENDAR,
                UserMessage(
                    "{field} {text} is not a valid date and time", field=self.name, text=show(text)
                ),
            )
            return None

    def write(self, value: datetime, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Encode a date and time; fractions of a second are cut."""
        return b"%04d" % value.year + b"%02d" * 5 % (
            value.month,
            value.day,
            value.hour,
            value.minute,
            value.second,
        )


@dataclass(frozen=True, slots=True)
class RunTime(Field):
    """DDHHMMSS (L226); the value is in whole seconds and saturates after 99 days (A-4.9-3)."""

    def read(self, text: bytes, diagnostics: Diagnostics) -> int | None:
        """Decode a duration in seconds."""
        if len(text) != 8 or not text.isdigit():  # noqa: PLR2004 - DDHHMMSS
            diagnostics.add(
                Defect.RUN_TIME,
                UserMessage(
                    "{field} {text!r} is not 8 digits (DDHHMMSS)", field=self.name, text=show(text)
                ),
            )
            return None
        days, hours, minutes, seconds = (int(text[i : i + 2]) for i in range(0, 8, 2))
        if hours > 23 or minutes > 59 or seconds > 59:  # noqa: PLR2004 - a day, an hour, a minute
            diagnostics.add(
                Defect.RUN_TIME,
                UserMessage(
                    "{field} {text} has an hour above 23, or a minute or second above 59",
                    field=self.name,
                    text=show(text),
                ),
            )
        return ((days * 24 + hours) * 60 + minutes) * 60 + seconds

    def write(self, value: int, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Encode a duration in seconds."""
        minutes, seconds = divmod(min(int(value), 100 * 86400 - 1), 60)
        hours, minutes = divmod(minutes, 60)
        days, hours = divmod(hours, 24)
        return b"%02d%02d%02d%02d" % (days, hours, minutes, seconds)


@dataclass(frozen=True, slots=True)
class Address(Field):
    """An IPv4 address in dotted decimal (L150); zero padding is tolerated (A-4.3-2)."""

    def read(self, text: bytes, diagnostics: Diagnostics) -> str | None:
        """Decode an address; the value has no zero padding."""
        parts = text.split(b".")
        if (
            len(parts) != 4  # noqa: PLR2004 - IPv4
            or not all(p.isdigit() and len(p) <= 3 and int(p) <= 255 for p in parts)  # noqa: PLR2004 - IPv4
        ):
            diagnostics.add(
                Defect.ADDRESS,
                UserMessage(
                    "{field} {text!r} is not a dotted IPv4 address",
                    field=self.name,
                    text=show(text),
                ),
            )
            return None
        return ".".join(str(int(p)) for p in parts)

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Encode an address."""
        diagnostics = Diagnostics()
        if self.read(value.encode(), diagnostics) is None:
            raise PayloadError(diagnostics.issues[0].text)
        return value.encode()


@dataclass(frozen=True, slots=True)
class StatusCode(Field):
    """A code of table 8-1: two characters (L214, L1014); the value is in upper case (A-T-7)."""

    def read(self, text: bytes, diagnostics: Diagnostics) -> str | None:
        """Decode a code."""
        code = errors.lookup(show(text))
        if code is None:
            diagnostics.add(
                Defect.CODE,
                UserMessage(
                    "{field} {text!r} is not a code of table 8-1", field=self.name, text=show(text)
                ),
            )
            return None
        if code in errors.RESERVED:
            diagnostics.add(
                Defect.RESERVED_CODE,
                UserMessage(
                    "{field} {code_text} is reserved in table 8-1",
                    field=self.name,
                    code_text=code.text,
                ),
            )
        return code.text

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Encode a code."""
        if errors.lookup(value) is None:
            raise PayloadError(
                UserMessage(
                    "{field} {value!r} is not a code of table 8-1", field=self.name, value=value
                )
            )
        return value.encode()


@dataclass(frozen=True, slots=True)
class Bits(Field):
    """One digit per port, the highest port leftmost (L651, L684); the value is the string."""

    count: int = 8

    def read(self, text: bytes, diagnostics: Diagnostics) -> str | None:
        """Decode the digits."""
        if len(text) != self.count or text.strip(b"01"):
            diagnostics.add(
                Defect.BITS,
                UserMessage(
                    "{field} {text!r} is not {count} digits 0 or 1",
                    field=self.name,
                    text=show(text),
                    count=self.count,
                ),
            )
            return None
        return text.decode()

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Encode the digits."""
        if len(value) != self.count or value.strip("01"):
            raise PayloadError(
                UserMessage(
                    "{field} must have {count} digits 0 or 1, not {value!r}",
                    field=self.name,
                    count=self.count,
                    value=value,
                )
            )
        return value.encode()


_VERSION = re.compile(rb"[0-9]+\.[0-9]+\.[0-9]+")


@dataclass(frozen=True, slots=True)
class Version(Field):
    """A version text: three dotted integers (L203); any other text is tolerated (A-4.7-1)."""

    def read(self, text: bytes, diagnostics: Diagnostics) -> str:
        """Decode the text."""
        if not text:
            diagnostics.add(Defect.SIZE, UserMessage("{field} is empty", field=self.name))
        elif not _VERSION.fullmatch(text):
            diagnostics.add(
                Defect.VERSION,
                UserMessage(
                    "{field} {text!r} does not have the form 1.0.0",
                    field=self.name,
                    text=show(text),
                ),
            )
        return show(text, limit=255)

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Encode the text."""
        if not 1 <= len(value.encode()) <= 255:  # noqa: PLR2004 - one length byte
            raise PayloadError(UserMessage("{field} must have 1 to 255 bytes", field=self.name))
        return value.encode()
