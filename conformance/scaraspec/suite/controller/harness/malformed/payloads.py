"""Malformed: invalid payloads, class by class, for the request of every command.

The frames around them are valid. A malformed payload stays close to the valid value of the case, so
that a controller that accepts it does little. The cases judge the reaction. `firm` means that no
reading of the document permits the controller to act.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import singledispatch
from typing import Any, Final, NamedTuple

from scaraspec.protocol import fields
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.fields import Field
from scaraspec.protocol.frames import MAX_DATA_BYTES
from scaraspec.protocol.payloads import Jog, NoData, Payload, Record
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import FileData
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import NoReply


class Malformed(NamedTuple):
    """One malformed payload.

    Attributes:
        kind: The name of its class: ``comma-decimal``.
        data: The bytes.
        field: The malformed field; empty for the payload as a whole.
        firm: Whether every reading forbids to act on it. Otherwise a receiver may be lenient, for
            example with an exponent or a trailing NUL (A-T-3 to A-T-5).
    """

    kind: str
    data: bytes
    field: str = ""
    firm: bool = True

    def __str__(self) -> str:
        return f"{self.kind} in {self.field}" if self.field else self.kind


def malformed(name: str, value: Any = None, dialect: Dialect = DEFAULT) -> tuple[Malformed, ...]:
    """Return every malformed payload for a request, of at most 255 bytes each.

    Args:
        name: The command.
        value: A valid value; None for requests without data.
        dialect: The readings for encoding.
    """
    return tuple(_payload(BY_NAME[name].request, value, dialect))


class MalformedResult(NamedTuple):
    """The reaction to a malformed request.

    Attributes:
        answer: The reply; None if the subject did not reply or closed the connection (A-3-9).
        line: The connection to continue with.
    """

    answer: ReceivedFrame | None
    line: OutgoingConnection

    @property
    def accepted(self) -> bool:
        """Whether the subject has accepted it."""
        return self.answer is not None and self.answer.accepted is True

    def __str__(self) -> str:
        return "silence" if self.answer is None else f"{self.answer}"


def send_malformed(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, wrong: Malformed
) -> MalformedResult:
    """Send a malformed request.

    Raises:
        NoReply: The subject does not answer any more.
    """
    line = ensure_open(subject, line)
    opcode = line.send(name, data=wrong.data).opcode
    try:
        came = line.sync()
    except NoReply:
        line.pump()
        if line.ending is None:
            raise
        came = line.inbox
    for seen in came:
        if seen.frame.opcode == opcode and not seen.frame.tagged:
            return MalformedResult(ReceivedFrame(seen, seen.value), ensure_open(subject, line))
    return MalformedResult(_wait_for_late_reply(subject, line, name), ensure_open(subject, line))


def _wait_for_late_reply(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> ReceivedFrame | None:
    """Return a reply that comes after the reply to a later request (3/24).

    After one missing reply to a command, the suite does not wait for it again.
    """
    if line.ending is None and name not in subject.traits.no_late_reply:
        with suppress(NoReply):
            return line.reply(name)
        subject.traits.no_late_reply.add(name)
    return None


# ---------------------------------------------------------------------- classes of one field


class _Class(NamedTuple):
    """One way to alter a field, from its text and the bytes that are free in the frame."""

    kind: str
    alter: Callable[[bytes, int], bytes]
    firm: bool = True


def _by(text: bytes) -> Callable[[bytes, int], bytes]:
    return lambda _text, _room: text


def _before(more: bytes) -> Callable[[bytes, int], bytes]:
    return lambda text, _room: more + text


def _after(more: bytes) -> Callable[[bytes, int], bytes]:
    return lambda text, _room: text + more


def _zeros(text: bytes, room_bytes: int) -> bytes:
    """Add as many leading zeros as fit."""
    sign = b"-" * text.startswith(b"-")
    return sign + b"0" * room_bytes + text[len(sign) :]


def _underscore(text: bytes, _: int) -> bytes:
    """Insert ``0_`` before the digits; the value is unchanged if a lenient parser accepts it."""
    sign = b"-" * text.startswith(b"-")
    return sign + b"0_" + text[len(sign) :]


def _binary(text: bytes, _: int) -> bytes:
    """Return the integer as a binary literal, such as ``0b101``."""
    sign, digits = text[: text.startswith(b"-")], text.lstrip(b"-").partition(b".")[0]
    return sign + f"{int(digits):#b}".encode()


def _full_width(text: bytes, _: int) -> bytes:
    return "".join(chr(ord(c) + 0xFEE0) if c.isdigit() else c for c in text.decode()).encode()


_NUMBER: Final = (
    _Class("empty", _by(b"")),
    _Class("letters", _by(b"abc")),
    _Class("letter-behind", _after(b"x")),
    _Class("comma-decimal", lambda text, _: text.partition(b".")[0] + b",5"),
    _Class("two-points", lambda text, _: text.partition(b".")[0] + b".0.0"),
    _Class("nan", _by(b"nan")),
    _Class("inf", _by(b"inf")),
    _Class("capital-nan", _by(b"NaN")),  # some languages parse these as numbers
    _Class("infinity", _by(b"Infinity")),
    _Class("null", _by(b"null")),
    _Class("true", _by(b"true")),
    _Class("binary-digits", _binary),
    _Class("suffix", _after(b"f")),
    _Class("underscore", _underscore),
    _Class("two-signs", _before(b"--")),
    _Class("sign-behind", _after(b"-")),
    _Class("below-zero", _before(b"/")),  # the characters next to the digits
    _Class("above-nine", _after(b":")),
    _Class("sign-alone", _by(b"-")),
    _Class("point-alone", _by(b".")),
    _Class("nul-inside", _after(b"\x001")),
    _Class("second-line", _after(b"\nx")),  # in some regular expressions $ matches here
    _Class("non-ascii", _after("°".encode())),
    _Class("plus", lambda text, _: b"+" + text.lstrip(b"-"), firm=False),
    _Class("exponent", _after(b"e0"), firm=False),
    _Class("blank-before", _before(b" "), firm=False),
    _Class("full-width", _full_width, firm=False),
    _Class("huge", _by(b"9" * 40), firm=False),
    _Class("over-long", _zeros, firm=False),
)
"""A plain decimal number (A-T-5); the other forms that strtod of C accepts are not failures."""

_INTEGER: Final = (
    *(c for c in _NUMBER if c.kind != "two-points"),
    _Class("decimal", _after(b".5"), firm=False),
)
_TIME: Final = (
    _Class("empty", _by(b"")),
    _Class("one-short", lambda text, _: text[:-1]),
    _Class("one-long", _after(b"0")),
    _Class("date-alone", lambda text, _: text[:8]),
    _Class("without-seconds", lambda text, _: text[:12]),
    _Class("without-century", lambda text, _: text[2:]),
    _Class("over-long", lambda text, room: text + b"0" * room),
    _Class("letters", _by(b"YYYYMMDDHHMMSS")),
    _Class("letter-inside", lambda text, _: text[:13] + b"x"),
    _Class("sign", lambda text, _: text[:8] + b"-" + text[9:]),
    _Class("plus-inside", lambda text, _: text[:8] + b"+" + text[9:]),
    _Class("behind-nine", lambda text, _: text[:8] + b":" + text[9:]),
    _Class("behind-nine-within", lambda text, _: text[:10] + b"0:" + text[12:]),
    _Class("blank-inside", lambda text, _: text[:8] + b" " + text[9:]),
    _Class("second-line", _after(b"\nx")),
    _Class("nul-inside", lambda text, _: text[:8] + b"\0" + text[9:]),
    _Class("separators", _by(b"2024-06-15 120000")),
    _Class("non-ascii", lambda text, _: text[:13] + b"\xb2"),
    _Class("full-width", _full_width),
    _Class("month-00", lambda text, _: text[:4] + b"00" + text[6:]),
    _Class("month-13", lambda text, _: text[:4] + b"13" + text[6:]),
    _Class("day-00", lambda text, _: text[:6] + b"00" + text[8:]),
    _Class("day-32", lambda text, _: text[:4] + b"0132" + text[8:]),
    _Class("31-april", lambda text, _: text[:4] + b"0431" + text[8:]),
    _Class("31-june", lambda text, _: text[:4] + b"0631" + text[8:]),
    _Class("31-september", lambda text, _: text[:4] + b"0931" + text[8:]),
    _Class("31-november", lambda text, _: text[:4] + b"1131" + text[8:]),
    _Class("30-february", lambda text, _: b"20240230" + text[8:]),
    _Class("29-february-of-a-common-year", lambda text, _: b"20230229" + text[8:]),
    _Class("29-february-2100", lambda text, _: b"21000229" + text[8:], firm=False),
    _Class("hour-24", lambda text, _: text[:8] + b"24" + text[10:]),
    _Class("minute-60", lambda text, _: text[:10] + b"60" + text[12:]),
    _Class("second-60", lambda text, _: text[:12] + b"60", firm=False),
    _Class("second-61", lambda text, _: text[:12] + b"61"),
    _Class("year-0000", lambda text, _: b"0000" + text[4:], firm=False),
    _Class("trailing-nul", _after(b"\0"), firm=False),
)
"""14 digits of a moment that exists (L169); second 60 may be a leap second (A-4.5-2)."""

_ADDRESS: Final = (
    _Class("empty", _by(b"")),
    _Class("letters", _by(b"a.b.c.d")),
    _Class("three-parts", lambda text, _: text.rpartition(b".")[0]),
    _Class("five-parts", _after(b".1")),
    _Class("empty-part", lambda text, _: text.rpartition(b".")[0] + b"."),
    _Class("part-256", lambda text, _: text.rpartition(b".")[0] + b".256"),
    _Class("part-1000", lambda text, _: text.rpartition(b".")[0] + b".1000"),
    _Class("part-999", lambda text, _: b"999." + text.partition(b".")[2]),
    _Class("negative", lambda text, _: text.rpartition(b".")[0] + b".-1"),
    _Class("huge", lambda text, _: text.rpartition(b".")[0] + b".4294967297"),
    _Class("hexadecimal", lambda text, _: text.rpartition(b".")[0] + b".0x1"),
    _Class("exponent", lambda text, _: text.rpartition(b".")[0] + b".1e1"),
    _Class("letter-behind", _after(b"x")),
    _Class("point-behind", _after(b".")),
    _Class("second-line", _after(b"\nx")),
    _Class("commas", lambda text, _: text.replace(b".", b",")),
    _Class("non-ascii", _after("。".encode())),
    _Class("nul-inside", _after(b"\x001")),
    _Class("over-long", _zeros, firm=False),
    _Class("blank-before", _before(b" "), firm=False),
)
"""Dotted decimals of four parts up to 255 (L150); padding is tolerated (A-4.3-2)."""

_TEXT: Final = (
    _Class("empty", _by(b""), firm=False),
    _Class("over-long", lambda text, room: text + b"x" * room, firm=False),
)
"""A password; its valid characters are open (A-4.1-3)."""

_NAME: Final = (
    *_TEXT,
    _Class("bar-inside", lambda text, _: text[:1] + b"|" + text[1:], firm=False),
    _Class("nul-inside", lambda text, _: text[:1] + b"\0" + text[1:], firm=False),
    _Class("control", lambda text, _: text[:1] + b"\x07\n" + text[1:], firm=False),
    _Class("non-ascii", lambda text, _: "程序".encode("gb18030") + text, firm=False),
    _Class("no-text", lambda text, _: b"\xff\xfe\xaa\xcc" + text, firm=False),
    _Class("dots", _by(b".."), firm=False),
    _Class("dot", _by(b"."), firm=False),
    _Class("path-up", _before(b"../"), firm=False),
    _Class("backslash-path", _before(b"..\\"), firm=False),
    _Class("root", _before(b"/"), firm=False),
    _Class("directory", _before(b"programs/"), firm=False),
    _Class("placeholders", _before(b"%s%n"), firm=False),
)
"""A file name; its valid characters are open (A-5-20), the effect on other files is not."""


@singledispatch
def _classes(field: Field) -> tuple[_Class, ...]:
    raise TypeError(f"{type(field).__name__} has no malformed classes: add some here")


_classes.register(fields.Number)(lambda _: _NUMBER)
_classes.register(fields.Integer)(lambda _: _INTEGER)
_classes.register(fields.Clock)(lambda _: _TIME)
_classes.register(fields.Address)(lambda _: _ADDRESS)
_classes.register(fields.Text)(lambda _: _TEXT)
_classes.register(fields.Name)(lambda _: _NAME)


# ---------------------------------------------------------------------- classes of a payload


@singledispatch
def _payload(payload: Payload, value: Any, dialect: Dialect) -> Iterator[Malformed]:  # noqa: ARG001 - one signature for all payloads
    raise TypeError(f"{type(payload).__name__} has no malformed classes: add some here")


@_payload.register
def _(_: NoData, value: None, dialect: Dialect) -> Iterator[Malformed]:  # noqa: ARG001 - as above
    """Yield unexpected data. A controller may ignore the data or the whole request (A-3-12)."""
    for kind, data in (
        ("one-digit", b"0"),
        ("nul", b"\0"),
        ("text", b"status"),
        ("bar", b"|"),
        ("delimiters", b"\xaa\xcc\xcc\xaa"),
        ("full", bytes(range(MAX_DATA_BYTES))),
    ):
        yield Malformed(kind, data, firm=False)


@_payload.register
def _(payload: Record, value: Any, dialect: Dialect) -> Iterator[Malformed]:
    values = value if payload.factory else (value,)
    texts = [part.write(v, dialect) for part, v in zip(payload.parts, values, strict=True)]
    if len(texts) > 1:
        yield from _structures(texts)
    for index, part in enumerate(payload.parts):
        room_bytes = MAX_DATA_BYTES - len(b"|".join(texts))
        for kind, alter, firm in _classes(part):
            altered = [*texts[:index], alter(texts[index], room_bytes), *texts[index + 1 :]]
            if (data := b"|".join(altered)) != b"|".join(texts):
                yield Malformed(kind, data, part.name, firm)


def _structures(texts: list[bytes]) -> Iterator[Malformed]:
    """Yield payloads with missing or additional fields, or with other separators (A-0-1)."""
    good = b"|".join(texts)
    yield Malformed("empty-payload", b"")
    yield Malformed("first-missing", b"|".join(texts[1:]))
    yield Malformed("last-missing", b"|".join(texts[:-1]))
    for count in range(1, len(texts) - 1):
        yield Malformed(f"first-{count}-alone", b"|".join(texts[:count]))
    yield Malformed("extra", b"|".join([*texts, texts[-1]]))
    yield Malformed("two-extra", b"|".join([*texts, *texts[-1:] * 2]))
    yield Malformed(
        "many-extra", b"|".join([*texts, *[b"1"] * ((MAX_DATA_BYTES - len(good)) // 2)])
    )
    yield Malformed("bar-before", b"|" + good)
    yield Malformed("bars-alone", b"|" * (len(texts) - 1))
    yield Malformed("double-bar", good.replace(b"|", b"||", 1))
    for kind, separator in (
        ("no-bars", b""),
        ("blanks-for-bars", b" "),
        ("commas-for-bars", b","),
        ("semicolons-for-bars", b";"),
        ("tabs-for-bars", b"\t"),
        ("nuls-for-bars", b"\0"),
        ("full-width-bars", "｜".encode()),
    ):
        yield Malformed(kind, separator.join(texts))
    yield Malformed("binary", b"\x00\x00\xc8\x42" * len(texts))
    yield Malformed("bar-behind", good + b"|", firm=False)
    yield Malformed("trailing-nul", good + b"\0", firm=False)
    yield Malformed("line-end", good + b"\r\n", firm=False)
    yield Malformed("quotes", b'"' + good + b'"', firm=False)
    yield Malformed("blanks-around-bars", b" | ".join(texts), firm=False)


@_payload.register
def _(_: Jog, value: Any, dialect: Dialect) -> Iterator[Malformed]:  # noqa: ARG001 - as above
    """Yield values that are not one byte from 1 to 4 (L600-608)."""
    for kind, data in (
        ("empty-payload", b""),
        ("zero", b"0"),
        ("binary-zero", b"\0"),
        ("five", b"5"),
        ("binary-five", b"\5"),
        ("letter", b"x"),
        ("sign", b"-"),
        ("highest-byte", b"\xff"),
        ("two-digits", b"11"),
        ("padded", b"01"),
        ("words", b"+y"),
        ("over-long", b"1" * MAX_DATA_BYTES),
    ):
        yield Malformed(kind, data)


@_payload.register
def _(_: FileData, value: Any, dialect: Dialect) -> Iterator[Malformed]:
    """Yield chunks that are cut or too long. The cases of clause 5 send numbers out of bounds."""
    whole = FileData().encode(value, dialect)
    for kind, data in (
        ("empty-payload", b""),
        ("one-byte", whole[:1]),
        ("header-cut", whole[:11]),
        ("text", b"1|0|1|x"),
    ):
        yield Malformed(kind, data)
    yield Malformed("over-long", whole.ljust(MAX_DATA_BYTES, b"\0"), firm=False)
