"""The messages of a recording (protobuf package ``scara.v1``), as one typed table.

Each message is a NamedTuple; its descriptor and its encoding are derived from the annotations. The
number of a field is its position: fields are only appended, never moved, so that old files remain
readable.
"""

from collections.abc import Callable
from types import NoneType
from typing import Any, Final, NamedTuple, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

from google.protobuf import (  # type: ignore[import-untyped]  # the package ships no types
    descriptor_pb2,
    descriptor_pool,
    message_factory,
)
from google.protobuf.message import (  # type: ignore[import-untyped]  # as above
    DecodeError,
)

from scaraspec.user_message import UserMessage

PACKAGE: Final = "scara.v1"


class RawChunk(NamedTuple):
    """Raw bytes of one direction; everything else can be derived from them again.

    The time of the message is the time of reception: the kernel timestamp if `kernel_time` is true,
    otherwise the time at which the recorder read the bytes. `forwarded_ns` is the time at which
    they were forwarded; absent if unknown.
    """

    connection: str
    direction: str
    offset_bytes: int
    data: bytes
    note: str
    forwarded_ns: int | None = None
    kernel_time: bool = False


class ConnectionEvent(NamedTuple):
    """A connection was opened, half-closed, closed or reset, or a fault was injected into it."""

    connection: str
    direction: str
    offset_bytes: int
    kind: str
    note: str


class Gap(NamedTuple):
    """Bytes that are missing in the recording; the length -1 means unknown."""

    connection: str
    direction: str
    offset_bytes: int
    length_bytes: int
    note: str


class Frame(NamedTuple):
    """A frame, decoded with the command table; passwords are masked."""

    connection: str
    direction: str
    offset_bytes: int
    size_bytes: int
    opcode: int
    tagged: bool
    command: str
    part: str
    text: str
    complaints: tuple[str, ...]


class Undecodable(NamedTuple):
    """Bytes that belong to no frame; `data` has the first 4096 at most, passwords masked."""

    connection: str
    direction: str
    offset_bytes: int
    size_bytes: int
    why: str
    data: bytes


class Exchange(NamedTuple):
    """A request and its replies. Its number is the same in every output of a recording.

    Parts of the latency: `robot_ms` is from the forwarding of the request to the reception of the
    reply, `recorder_ms` is the time that the recorder added in both directions; absent if unknown.
    """

    number: int
    connection: str
    command: str
    opcode: int
    request: str
    reply: str
    result: str
    ending: str
    accepted: bool | None
    code: str
    latency_ms: float | None
    duration_s: float | None
    request_time_ns: int
    request_offset_bytes: int
    reply_offset_bytes: int | None
    result_offset_bytes: int | None
    robot_ms: float | None = None
    recorder_ms: float | None = None


class Transfer(NamedTuple):
    """A file transfer; the content of a complete file is an attachment of the same name."""

    connection: str
    upload: bool
    name: str
    size_bytes: int
    received_bytes: int
    chunks: int
    order: str
    state: str
    reason: str
    begun_ns: int
    duration_s: float
    sha256: str


class Finding(NamedTuple):
    """A requirement judged on evidence."""

    requirement: str
    verdict: str
    cause: str
    message: str
    expected: str
    observed: str
    reading: str
    places: tuple[str, ...]


Message = RawChunk | ConnectionEvent | Gap | Frame | Undecodable | Exchange | Transfer | Finding
MESSAGES: Final[tuple[type[Message], ...]] = get_args(Message)

_M = TypeVar("_M", bound=Message)
_Fields = ParamSpec("_Fields")
_PROTO = descriptor_pb2.FieldDescriptorProto
_TYPES: Final = {
    str: _PROTO.TYPE_STRING,
    bytes: _PROTO.TYPE_BYTES,
    int: _PROTO.TYPE_INT64,
    bool: _PROTO.TYPE_BOOL,
    float: _PROTO.TYPE_DOUBLE,
}


def _describe(kind: type[Message], proto: Any) -> None:
    """Fill a DescriptorProto from the annotations of a message."""
    proto.name = kind.__name__
    for number, (name, hint) in enumerate(get_type_hints(kind).items(), start=1):
        field = proto.field.add(name=name, number=number, label=_PROTO.LABEL_OPTIONAL)
        if get_origin(hint) is tuple:
            field.label = _PROTO.LABEL_REPEATED
            hint = get_args(hint)[0]  # noqa: PLW2901 - the type of the items
        elif NoneType in get_args(hint):
            hint = get_args(hint)[0]  # noqa: PLW2901 - the type of the value
            field.proto3_optional = True
            field.oneof_index = len(proto.oneof_decl)
            proto.oneof_decl.add(name=f"_{name}")
        field.type = _TYPES[hint]


def _file(kind: type[Message]) -> Any:
    """Return the .proto file of one message; messages do not depend on each other."""
    file = descriptor_pb2.FileDescriptorProto(
        name=f"scara/v1/{kind.__name__}.proto", package=PACKAGE, syntax="proto3"
    )
    _describe(kind, file.message_type.add())
    return file


_FILES: Final = {kind: _file(kind) for kind in MESSAGES}


def _make_classes() -> dict[type[Message], Any]:
    pool = descriptor_pool.DescriptorPool()
    for file in _FILES.values():
        pool.Add(file)
    return {
        kind: message_factory.GetMessageClass(pool.FindMessageTypeByName(full_name(kind)))
        for kind in MESSAGES
    }


class SchemaError(ValueError):
    """The bytes are not a valid message of the expected kind."""


def full_name(kind: type[Message]) -> str:
    """Return the protobuf name of a message, for example ``scara.v1.Frame``."""
    return f"{PACKAGE}.{kind.__name__}"


def descriptor_set(kind: type[Message]) -> bytes:
    """Return the FileDescriptorSet with which any reader can decode messages of this kind."""
    data: bytes = descriptor_pb2.FileDescriptorSet(file=[_FILES[kind]]).SerializeToString()
    return data


_CLASSES: Final[dict[Any, Any]] = _make_classes()


class _ReadField(NamedTuple):
    """How a field is read: its name, and whether it may be absent or is a list."""

    name: str
    optional: bool
    repeated: bool


_READ_FIELDS: Final = {
    kind: tuple(
        _ReadField(field.name, bool(field.containing_oneof), field.is_repeated)
        for field in proto.DESCRIPTOR.fields
    )
    for kind, proto in _CLASSES.items()
}


def encode(
    kind: Callable[_Fields, Message], /, *none: _Fields.args, **fields: _Fields.kwargs
) -> bytes:
    """Encode a message of this kind with these fields as protobuf.

    No tuple is created, for speed.
    """
    data: bytes = _CLASSES[kind](*none, **fields).SerializeToString()
    return data


def decode(kind: type[_M], data: bytes) -> _M:
    """Decode a message; missing fields have their zero value or None.

    Raises:
        SchemaError: The bytes are not a message of this kind.
    """
    try:
        proto = _CLASSES[kind].FromString(data)
    except DecodeError:
        raise SchemaError(
            UserMessage(
                "{byte_count} bytes are not a valid {package}.{message} message",
                byte_count=len(data),
                package=PACKAGE,
                message=kind.__name__,
            )
        ) from None
    values: list[Any] = []
    for name, optional, repeated in _READ_FIELDS[kind]:
        value: Any = None if optional and not proto.HasField(name) else getattr(proto, name)
        values.append(tuple(value) if repeated else value)
    return kind(*values)
