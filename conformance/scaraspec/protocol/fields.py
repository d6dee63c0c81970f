"""Fields: one value between two bars (the text conventions of clauses 3 and 4).

Each field reads leniently and writes strictly. Reading never raises: it returns the value that
was most likely meant, and complaints about how it was written. What a complaint costs is for the
judge. How fields make up a payload stands in `payloads`.
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
"""一般不超过 30 个字节 (L226): soft for what is received, hard for what we send (A-4.9-5)."""


class PayloadError(ValueError):
    """A value cannot be written as the document wants it; the text says which and why."""


class Defect(Enum):
    """How a payload departs from the document. The judge maps each to a requirement."""

    SIZE = "size"  # no data where some is due, data where none is, a wrong fixed length
    FIELD_COUNT = "field count"
    SPACE_FOR_BAR = "space for bar"  # written from a copy that lost the bars (A-0-1)
    QUOTES = "quotes"
    TRAILING_NUL = "trailing NUL"
    TRAILING_BAR = "trailing bar"
    BLANKS = "blanks"
    NO_CODE = "no code"  # a refusal without its reason (A-4.24-3)
    BINARY = "binary digit"  # 0x00-0x09 where an ASCII digit is due (A-T-1)
    FLAG = "flag"
    NUMBER = "number"
    RANGE = "range"
    CODE = "code"  # not two characters of table 8-1
    RESERVED_CODE = "reserved code"
    CLOCK = "clock"  # not 14 digits
    CALENDAR = "calendar"  # 14 digits that no calendar holds
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
    """One thing wrong with a payload, in a short clause of English."""

    wrong: Defect
    text: str


@dataclass(slots=True)
class Diagnostics:
    """What a reader noticed: complaints, and readings that the bytes give away."""

    complaints: list[DecodeIssue] = field(default_factory=list)
    readings: dict[str, str] = field(default_factory=dict)

    def add(self, wrong: Defect, text: str) -> None:
        """Note one complaint."""
        self.complaints.append(DecodeIssue(wrong, text))


def show(data: bytes, limit: int = 60) -> str:
    """Bytes as a reader can take them: UTF-8, else GB18030, else escapes (A-T-2); never control."""
    for encoding in ("utf-8", "gb18030"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        break
    else:
        text = data.decode("latin-1")
    text = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    return text if len(text) <= limit else text[: limit - 1] + "…"


@dataclass(frozen=True, slots=True)
class Field(ABC):
    """A named field; subclasses say how it is read and written.

    Attributes:
        opaque: Its bytes mean nothing to the protocol: blanks at its ends belong to it.
    """

    name: str
    unit: str = ""
    opaque: ClassVar[bool] = False

    @abstractmethod
    def read(self, text: bytes, notes: Diagnostics) -> Any:
        """Return the value, or None where there is none to be had; add complaints to `notes`."""

    @abstractmethod
    def write(self, value: Any, dialect: Dialect) -> bytes:
        """Return the text of `value`.

        Raises:
            PayloadError: The value has no legal text.
        """


_DECIMAL = re.compile(rb"-?[0-9]+(\.[0-9]+)?")
_INTEGER = re.compile(rb"-?[0-9]+")


@dataclass(frozen=True, slots=True)
class Number(Field):
    """A plain decimal number with "." as its mark (A-T-5); at most 3 decimals are written."""

    def read(self, text: bytes, notes: Diagnostics) -> float | None:
        """Read a number; what other notations mean is guessed for the reader, and complained of."""
        if _DECIMAL.fullmatch(text):
            return float(text)
        notes.add(
            Defect.NUMBER,
            UserMessage(
                "{self_} {text!r} is no plain decimal number", self_=self.name, text=show(text)
            ),
        )
        return None

    def write(self, value: float, dialect: Dialect) -> bytes:
        """Write a finite number; 1e6 has no exponent, -0.0 no sign."""
        if not abs(value) < 1e15:  # noqa: PLR2004 - nan fails the comparison too; beyond it floats skip integers
            raise PayloadError(
                UserMessage(
                    "{self_} must be a finite number, not {value!r}", self_=self.name, value=value
                )
            )
        if dialect["num_format"] == "one-decimal":
            return b"%.1f" % (round(value, 1) + 0.0)
        text = b"%.3f" % (round(value, 3) + 0.0)
        return text.rstrip(b"0").rstrip(b".")


@dataclass(frozen=True, slots=True)
class Integer(Field):
    """An integer within bounds, padded with zeros to `width` characters where that is drawn."""

    minimum: int = 0
    maximum: int = 255
    width: int = 1

    def read(self, text: bytes, notes: Diagnostics) -> int | None:
        """Read an integer; out of bounds it is complained of and still returned."""
        if not _INTEGER.fullmatch(text) or len(text) > 20:  # noqa: PLR2004 - more digits are no integer of this protocol
            notes.add(
                Defect.NUMBER,
                UserMessage("{self_} {text!r} is no integer", self_=self.name, text=show(text)),
            )
            return None
        value = int(text)
        if not self.minimum <= value <= self.maximum:
            notes.add(
                Defect.RANGE,
                UserMessage(
                    "{self_} {value} is outside {minimum} to {maximum}",
                    self_=self.name,
                    value=value,
                    minimum=self.minimum,
                    maximum=self.maximum,
                ),
            )
        return value

    def write(self, value: int, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write an integer within its bounds."""
        if value != int(value) or not self.minimum <= value <= self.maximum:
            raise PayloadError(
                UserMessage(
                    "{self_} must be an integer, {minimum} to {maximum}, not {value!r}",
                    self_=self.name,
                    minimum=self.minimum,
                    maximum=self.maximum,
                    value=value,
                )
            )
        return b"%0*d" % (self.width, value)


@dataclass(frozen=True, slots=True)
class Text(Field):
    """Opaque bytes: a password (L109). Not empty, no bar (A-T-6)."""

    opaque: ClassVar[bool] = True
    maximum_bytes: int = 255

    def read(self, text: bytes, notes: Diagnostics) -> bytes:
        """Read the bytes as they are."""
        if not text:
            notes.add(Defect.SIZE, UserMessage("{self_} is empty", self_=self.name))
        elif b"|" in text:
            notes.add(
                Defect.BAR_IN_NAME,
                UserMessage("{self_} contains the separator '|'", self_=self.name),
            )
        return text

    def write(self, value: bytes, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write the bytes as they are."""
        if not 1 <= len(value) <= self.maximum_bytes:
            raise PayloadError(
                UserMessage(
                    "{self_} must have 1 to {maximum_bytes} bytes, not {value_count}",
                    self_=self.name,
                    maximum_bytes=self.maximum_bytes,
                    value_count=len(value),
                )
            )
        if b"|" in value:
            raise PayloadError(
                UserMessage("{self_} must not contain '|', the separator (L125)", self_=self.name)
            )
        return value


@dataclass(frozen=True, slots=True)
class Name(Field):
    """A program or file name (A-5-20): opaque bytes, at most 30 by L226."""

    opaque: ClassVar[bool] = True

    def read(self, text: bytes, notes: Diagnostics) -> bytes:
        """Read the bytes as they are."""
        if not text:
            notes.add(Defect.EMPTY_NAME, UserMessage("{self_} is empty", self_=self.name))
        if b"|" in text:
            notes.add(
                Defect.BAR_IN_NAME,
                UserMessage(
                    "{self_} {text!r} contains the separator '|'", self_=self.name, text=show(text)
                ),
            )
        if len(text) > NAME_MAX_BYTES:
            notes.add(
                Defect.LONG_NAME,
                UserMessage(
                    "{self_} has {text_count} bytes, more than 30",
                    self_=self.name,
                    text_count=len(text),
                ),
            )
        if b"/" in text or b"\\" in text or b"\0" in text or text in (b".", b".."):
            notes.add(
                Defect.PATH_IN_NAME,
                UserMessage("{self_} {text!r} has path elements", self_=self.name, text=show(text)),
            )
        return text

    def write(self, value: bytes, dialect: Dialect) -> bytes:
        """Write a name that every reading of the document takes."""
        maximum = 255 if dialect["name_max"] == "255" else NAME_MAX_BYTES
        if not 1 <= len(value) <= maximum:
            raise PayloadError(
                UserMessage(
                    "{self_} must have 1 to {maximum} bytes, not {value_count}",
                    self_=self.name,
                    maximum=maximum,
                    value_count=len(value),
                )
            )
        if any(c in value for c in (b"|", b"/", b"\\", b"\0")) or value in (b".", b".."):
            raise PayloadError(
                UserMessage(
                    "{self_} {value!r} has a separator or path element in it",
                    self_=self.name,
                    value=show(value),
                )
            )
        return value


@dataclass(frozen=True, slots=True)
class Flag(Field):
    """``1`` or ``0``."""

    def read(self, text: bytes, notes: Diagnostics) -> bool | None:
        """Read the flag; a binary 0 or 1 is understood and complained of (A-T-1)."""
        if text in (b"1", b"0"):
            return text == b"1"
        if text in (b"\x00", b"\x01"):
            notes.add(
                Defect.BINARY,
                UserMessage(
                    "{self_} is the byte {text:02X}, not an ASCII digit",
                    self_=self.name,
                    text=text[0],
                ),
            )
            return text == b"\x01"
        notes.add(
            Defect.FLAG,
            UserMessage(
                "{self_} is {text!r}, neither '1' nor '0'", self_=self.name, text=show(text)
            ),
        )
        return None

    def write(self, value: bool, dialect: Dialect) -> bytes:  # noqa: ARG002, FBT001 - one signature for all fields
        """Write the flag."""
        return b"1" if value else b"0"


@dataclass(frozen=True, slots=True)
class Clock(Field):
    """YYYYMMDDHHMMSS (L169, L186), read and written as a naive `datetime` (A-4.5-1)."""

    def read(self, text: bytes, notes: Diagnostics) -> datetime | None:
        """Read a calendar time."""
        if len(text) != 14 or not text.isdigit():  # noqa: PLR2004 - YYYYMMDDHHMMSS
            notes.add(
                Defect.CLOCK,
                UserMessage(
                    "{self_} {text!r} is not 14 digits YYYYMMDDHHMMSS",
                    self_=self.name,
                    text=show(text),
                ),
            )
            return None
        year, *rest = int(text[:4]), *(int(text[i : i + 2]) for i in range(4, 14, 2))
        month, day, hour, minute, second = rest
        try:
            return datetime(year, month, day, hour, minute, second)  # noqa: DTZ001 - the document names no zone
        except ValueError:
            notes.add(
                Defect.CALENDAR,
                UserMessage(
                    "{self_} {text} is no time of the calendar", self_=self.name, text=show(text)
                ),
            )
            return None

    def write(self, value: datetime, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write a calendar time; fractions of a second are cut."""
        return b"%04d" % value.year + b"%02d" * 5 % (
            value.month,
            value.day,
            value.hour,
            value.minute,
            value.second,
        )


@dataclass(frozen=True, slots=True)
class RunTime(Field):
    """DDHHMMSS (L226), read and written in whole seconds; saturates after 99 days (A-4.9-3)."""

    def read(self, text: bytes, notes: Diagnostics) -> int | None:
        """Read a duration in seconds."""
        if len(text) != 8 or not text.isdigit():  # noqa: PLR2004 - DDHHMMSS
            notes.add(
                Defect.RUN_TIME,
                UserMessage(
                    "{self_} {text!r} is not 8 digits DDHHMMSS", self_=self.name, text=show(text)
                ),
            )
            return None
        days, hours, minutes, seconds = (int(text[i : i + 2]) for i in range(0, 8, 2))
        if hours > 23 or minutes > 59 or seconds > 59:  # noqa: PLR2004 - a day, an hour, a minute
            notes.add(
                Defect.RUN_TIME,
                UserMessage("{self_} {text} does not carry over", self_=self.name, text=show(text)),
            )
        return ((days * 24 + hours) * 60 + minutes) * 60 + seconds

    def write(self, value: int, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write a duration in seconds."""
        minutes, seconds = divmod(min(int(value), 100 * 86400 - 1), 60)
        hours, minutes = divmod(minutes, 60)
        days, hours = divmod(hours, 24)
        return b"%02d%02d%02d%02d" % (days, hours, minutes, seconds)


@dataclass(frozen=True, slots=True)
class Address(Field):
    """An IPv4 address in dotted decimal (L150); zero padding is tolerated (A-4.3-2)."""

    def read(self, text: bytes, notes: Diagnostics) -> str | None:
        """Read an address; it is returned without padding."""
        parts = text.split(b".")
        if (
            len(parts) != 4  # noqa: PLR2004 - IPv4
            or not all(p.isdigit() and len(p) <= 3 and int(p) <= 255 for p in parts)  # noqa: PLR2004 - IPv4
        ):
            notes.add(
                Defect.ADDRESS,
                UserMessage(
                    "{self_} {text!r} is no dotted IPv4 address", self_=self.name, text=show(text)
                ),
            )
            return None
        return ".".join(str(int(p)) for p in parts)

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write an address."""
        notes = Diagnostics()
        if self.read(value.encode(), notes) is None:
            raise PayloadError(notes.complaints[0].text)
        return value.encode()


@dataclass(frozen=True, slots=True)
class StatusCode(Field):
    """Two characters of table 8-1 (L214, L1014), returned in upper case (A-T-7)."""

    def read(self, text: bytes, notes: Diagnostics) -> str | None:
        """Read a code."""
        code = errors.lookup(show(text))
        if code is None:
            notes.add(
                Defect.CODE,
                UserMessage(
                    "{self_} {text!r} is no code of table 8-1", self_=self.name, text=show(text)
                ),
            )
            return None
        if code in errors.RESERVED:
            notes.add(
                Defect.RESERVED_CODE,
                UserMessage(
                    "{self_} {code_text} is reserved in table 8-1",
                    self_=self.name,
                    code_text=code.text,
                ),
            )
        return code.text

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write a code."""
        if errors.lookup(value) is None:
            raise PayloadError(
                UserMessage(
                    "{self_} {value!r} is no code of table 8-1", self_=self.name, value=value
                )
            )
        return value.encode()


@dataclass(frozen=True, slots=True)
class Bits(Field):
    """One digit a port, the highest port leftmost (L651, L684); a string as on the wire."""

    count: int = 8

    def read(self, text: bytes, notes: Diagnostics) -> str | None:
        """Read the digits."""
        if len(text) != self.count or text.strip(b"01"):
            notes.add(
                Defect.BITS,
                UserMessage(
                    "{self_} {text!r} is not {count} digits 0 or 1",
                    self_=self.name,
                    text=show(text),
                    count=self.count,
                ),
            )
            return None
        return text.decode()

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write the digits."""
        if len(value) != self.count or value.strip("01"):
            raise PayloadError(
                UserMessage(
                    "{self_} must be {count} digits 0 or 1, not {value!r}",
                    self_=self.name,
                    count=self.count,
                    value=value,
                )
            )
        return value.encode()


_VERSION = re.compile(rb"[0-9]+\.[0-9]+\.[0-9]+")


@dataclass(frozen=True, slots=True)
class Version(Field):
    """A version text; three dotted integers are drawn (L203), any text is tolerated (A-4.7-1)."""

    def read(self, text: bytes, notes: Diagnostics) -> str:
        """Read the text."""
        if not text:
            notes.add(Defect.SIZE, UserMessage("{self_} is empty", self_=self.name))
        elif not _VERSION.fullmatch(text):
            notes.add(
                Defect.VERSION,
                UserMessage(
                    "{self_} {text!r} has not the form 1.0.0", self_=self.name, text=show(text)
                ),
            )
        return show(text, limit=255)

    def write(self, value: str, dialect: Dialect) -> bytes:  # noqa: ARG002 - one signature for all fields
        """Write the text."""
        if not 1 <= len(value.encode()) <= 255:  # noqa: PLR2004 - one length byte
            raise PayloadError(UserMessage("{self_} must have 1 to 255 bytes", self_=self.name))
        return value.encode()
