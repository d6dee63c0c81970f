"""The layer for scapy: one class for each message of the command table; needs the extra `pcap`.

Importing this module binds `UISR` to the TCP port of controllers. Values are decoded and encoded
with the codec of this package, in its default dialect.
"""

from collections.abc import Callable, Iterable
from types import MappingProxyType
from typing import Any, ClassVar, Final

from scaraspec.protocol.commands import COMMANDS, Command, is_known_opcode, parse_frame
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import TAG, Frame, Framer, StreamItem
from scaraspec.protocol.payloads import (
    Acceptance,
    FinalResult,
    FirstReply,
    Jog,
    NameList,
    NameListPart,
    OptionalName,
    OptionalRecord,
    Outcome,
    Payload,
    Record,
)
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.protocol.redaction import mask_unframed
from scaraspec.protocol.transfer import Chunk, FileData
from scaraspec_recorder.sinks.text import SECRET

try:
    from scapy.fields import ByteField, Field, StrField, XByteField
    from scapy.layers.inet import TCP
    from scapy.packet import Packet, bind_bottom_up, bind_layers
except ImportError:
    raise ImportError(
        "the layer for scapy needs the extra: pip install 'scaraspec[pcap]'"
    ) from None

_SECRET_OPCODES: Final = frozenset(command.opcode for command in COMMANDS if command.secret)


class _Value(Field[Any, Any]):
    """A value of the payload; `secret` hides it in what scapy prints."""

    __slots__ = ("_secret",)

    def __init__(self, name: str, *, secret: bool) -> None:
        super().__init__(name, None)
        self._secret = secret

    def i2repr(self, pkt: Packet | None, x: Any) -> str:  # noqa: ARG002 - scapy's signature
        return SECRET if self._secret and x is not None else repr(x)


class _Data(StrField):
    """Bytes; scapy does not print those that may be a password."""

    def i2repr(self, pkt: Packet | None, x: Any) -> str:
        if x and isinstance(pkt, UISR) and pkt.opcode in _SECRET_OPCODES:
            return SECRET
        return repr(mask_unframed(x) if x and isinstance(pkt, InvalidBytes) else x)


class UISR(Packet):
    """A frame. Dissection returns an object of a subclass for its command and part.

    Further frames in the same bytes are its payload. The fields after `opcode` are the values of
    the command. `length` and `end` are computed if they are None. `data` replaces the values if it
    is not None; after dissection it is None unless the values would give other bytes.

    A name that scapy uses itself ends with an underscore, such as `name_` and `time_`.

    Attributes:
        row: The row of the command table; None for an undefined opcode.
        part: ``request``, ``reply`` or ``result``; empty for an undefined opcode.
    """

    name = "UISR"
    fields_desc: ClassVar[list[Any]] = [
        XByteField("start", A2C.start),
        XByteField("tag", None),
        XByteField("opcode", 0),
        ByteField("length", None),
        _Data("data", None),
        XByteField("end", None),
    ]
    match_subclass = True  # `UISR in packet` finds every message
    row: ClassVar[Command | None] = None
    part: ClassVar[str] = ""
    _message: ClassVar["_Message | None"] = None

    @classmethod
    def dispatch_hook(cls, _pkt: bytes = b"", *_: Any, **options: Any) -> type[Packet]:
        """Return the class for the first frame of these bytes."""
        if not _pkt:
            return cls
        item = _first_item(_pkt, options.get("_underlayer"))
        if not isinstance(item, Frame):
            return InvalidBytes
        parsed = parse_frame(item)
        return PACKETS[parsed.command.name, parsed.part] if parsed else UISR

    @classmethod
    def tcp_reassemble(cls, data: bytes, *_: Any) -> Packet | None:
        """Return the frames, or None while the last one is not complete; for `TCPSession`."""
        framer = Framer(_direction(data, None), recovery_filter=is_known_opcode)
        framer.feed(data)
        return None if framer.buffered_bytes else cls(data)

    def do_dissect(self, s: bytes) -> bytes:
        """Set the fields from the first frame; return the other bytes."""
        frame = _first_item(s, self.underlayer)
        assert isinstance(frame, Frame)
        values: dict[str, Any] = dict.fromkeys(field.name for field in self.fields_desc)
        values |= {
            "start": frame.direction.start,
            "tag": TAG if frame.tagged else None,
            "opcode": frame.opcode,
        }
        message = self._message
        if message:
            values |= message.values(message.payload.decode(frame.data).value)
        self.fields = values
        if self._encoded() != frame.data:
            self.fields["data"] = frame.data
        self.raw_packet_cache = None
        return s[frame.size_bytes :]

    def self_build(self) -> bytes:
        """Return the bytes of the frame.

        Raises:
            PayloadError: The document allows no encoding of the values.
        """
        data = self._data()
        start, tag, length, end = (
            self.getfieldval(name) for name in ("start", "tag", "length", "end")
        )
        if end is None:
            end = (C2A if start == C2A.start else A2C).end
        head = bytes([start] if tag is None else [start, tag])
        length = len(data) if length is None else length
        return head + bytes((self.opcode, length)) + data + bytes((end,))

    def guess_payload_class(self, payload: bytes) -> type[Packet]:  # noqa: ARG002 - scapy's signature
        """Return the class of what follows: the next frame."""
        return UISR

    def _data(self) -> bytes:
        """Return the data of the frame.

        Raises:
            PayloadError: See `self_build`.
        """
        data = self.getfieldval("data")
        if data is not None or self._message is None:
            return bytes(data or b"")
        return self._message.encode(self.getfieldval)

    def _encoded(self) -> bytes | None:
        try:
            return self._data()
        except (PayloadError, TypeError, ValueError, AttributeError):
            return None


class InvalidBytes(Packet):
    """Bytes that belong to no frame, up to the next frame."""

    name = "UISR invalid bytes"
    fields_desc: ClassVar[list[Any]] = [_Data("data", b"")]

    def do_dissect(self, s: bytes) -> bytes:
        """Take the bytes before the next frame."""
        item = _first_item(s, self.underlayer)
        self.fields = {"data": s[: item.size_bytes]}
        return s[item.size_bytes :]

    def guess_payload_class(self, payload: bytes) -> type[Packet]:  # noqa: ARG002 - scapy's signature
        """Return the class of what follows: the next frame."""
        return UISR


class _Message:
    """The values of a payload as separate fields.

    Args:
        payload: The payload.
    """

    def __init__(self, payload: Payload) -> None:
        self.payload = payload
        self._factory: Callable[..., Any] | None = None
        names: Iterable[str] = (field.name for field in payload.fields)
        match payload:
            case Record() | OptionalRecord():
                inner = payload if isinstance(payload, Record) else payload.inner
                self._factory = inner.factory
            case FirstReply():
                self._factory, names = Acceptance, Acceptance._fields
            case FinalResult():
                self._factory, names = Outcome, Outcome._fields
            case NameList():
                self._factory, names = NameListPart, NameListPart._fields
            case FileData():
                self._factory, names = Chunk, Chunk._fields
            case OptionalName():
                names = ("name",)
            case Jog():
                names = ("direction",)
        self._names = tuple(f"{name}_" if hasattr(UISR, name) else name for name in names)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the fields."""
        return self._names

    def values(self, value: Any) -> dict[str, Any]:
        """Return the values of the fields."""
        if value is None:
            return dict.fromkeys(self._names)
        parts = value if self._factory else (value,)
        return dict(zip(self._names, parts, strict=False))

    def encode(self, value_of: Callable[[str], Any]) -> bytes:
        """Return the data.

        Raises:
            PayloadError: The document allows no encoding of the values.
        """
        values = [value_of(name) for name in self._names]
        if all(value is None for value in values):
            return self.payload.encode(None)
        return self.payload.encode(self._factory(*values) if self._factory else values[0])


def _first_item(data: bytes, underlayer: Packet | None) -> StreamItem:
    framer = Framer(_direction(data, underlayer), recovery_filter=is_known_opcode)
    return (framer.feed(data) + framer.finish())[0]


def _direction(data: bytes, underlayer: Packet | None) -> Direction:
    """Return the sender: by the port or by the frame before, else by the first byte."""
    if isinstance(underlayer, TCP) and DEFAULT_PORT in (underlayer.sport, underlayer.dport):
        return C2A if underlayer.sport == DEFAULT_PORT else A2C
    if isinstance(underlayer, UISR):
        return C2A if underlayer.start == C2A.start else A2C
    return C2A if data[:1] == bytes((C2A.start,)) else A2C


def _packet_class(command: Command, part: str, payload: Payload) -> type[UISR]:
    """Return the class of a message."""
    direction = command.initiator if part == "request" else command.initiator.opposite
    message = _Message(payload)
    name = "".join(word.capitalize() for word in (*command.name.split("_"), part))
    secret = command.secret and part == "request"
    members = {
        "name": f"UISR {command.name} {part}",
        "__doc__": f"{command.title}: {part}, {payload.form}.",
        "fields_desc": [
            XByteField("start", direction.start),
            XByteField("tag", TAG if part == "result" else None),
            XByteField("opcode", command.opcode),
            ByteField("length", None),
            *(_Value(value, secret=secret) for value in message.names),
            _Data("data", None),
            XByteField("end", None),
        ],
        "row": command,
        "part": part,
        "_message": message,
    }
    return type(name, (UISR,), members)


PACKETS: Final = MappingProxyType(
    {
        (command.name, part): _packet_class(command, part, payload)
        for command in COMMANDS
        for part, payload in (
            ("request", command.request),
            ("reply", command.reply),
            ("result", command.result),
        )
        if payload is not None
    }
)
"""The class of each message, by command and part."""

bind_bottom_up(TCP, UISR, sport=DEFAULT_PORT)
bind_bottom_up(TCP, UISR, dport=DEFAULT_PORT)
bind_layers(TCP, UISR, dport=DEFAULT_PORT)
