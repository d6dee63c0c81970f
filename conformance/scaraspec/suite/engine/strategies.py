"""Hypothesis strategies derived from the command table: what a correct peer may send.

Every command and every field type has a strategy. A field type without one raises an error.
"""

from datetime import datetime
from functools import singledispatch
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from scaraspec.protocol import errors, fields, payloads
from scaraspec.protocol.commands import COMMANDS, Command
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, Chunk, FileData

NAME_CHARACTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-"

names = st.text(NAME_CHARACTERS, min_size=1, max_size=26).map(lambda s: f"{s}.rob".encode())
"""File names that are valid in every reading of the document (A-5-20)."""


@singledispatch
def values(field: fields.Field) -> SearchStrategy[Any]:
    """Return a strategy for the whole documented domain of a field."""
    raise TypeError(f"{type(field).__name__} has no strategy: add one to this module")


@values.register
def _(field: fields.Number) -> SearchStrategy[float]:  # noqa: ARG001 - chosen by its type
    return st.integers(-10_000_000, 10_000_000).map(lambda thousandths: thousandths / 1000)


@values.register
def _(field: fields.Integer) -> SearchStrategy[int]:
    return st.integers(field.minimum, field.maximum)


@values.register
def _(field: fields.Text) -> SearchStrategy[bytes]:
    printable = st.characters(min_codepoint=0x21, max_codepoint=0x7E, exclude_characters="|\"'")
    return st.text(printable, min_size=1, max_size=min(field.maximum_bytes, 30)).map(str.encode)


@values.register
def _(field: fields.Name) -> SearchStrategy[bytes]:  # noqa: ARG001 - chosen by its type
    return names


@values.register
def _(field: fields.Flag) -> SearchStrategy[bool]:  # noqa: ARG001 - chosen by its type
    return st.booleans()


@values.register
def _(field: fields.Clock) -> SearchStrategy[datetime]:  # noqa: ARG001 - chosen by its type
    first, last = datetime(2000, 1, 1), datetime(2099, 12, 31, 23, 59, 59)  # noqa: DTZ001 - the document names no zone
    return st.datetimes(first, last).map(lambda t: t.replace(microsecond=0))


@values.register
def _(field: fields.RunTime) -> SearchStrategy[int]:  # noqa: ARG001 - chosen by its type
    return st.integers(0, 100 * 86400 - 1)


@values.register
def _(field: fields.Address) -> SearchStrategy[str]:  # noqa: ARG001 - chosen by its type
    return st.ip_addresses(v=4).map(str)


@values.register
def _(field: fields.StatusCode) -> SearchStrategy[str]:  # noqa: ARG001 - chosen by its type
    return st.sampled_from([c.text for c in errors.TABLE_8_1.values() if c not in errors.RESERVED])


@values.register
def _(field: fields.Bits) -> SearchStrategy[str]:
    return st.text("01", min_size=field.count, max_size=field.count)


@values.register
def _(field: fields.Version) -> SearchStrategy[str]:  # noqa: ARG001 - chosen by its type
    return st.tuples(*[st.integers(0, 999)] * 3).map(lambda v: ".".join(map(str, v)))


chunks = st.builds(
    lambda data, before, after: Chunk(before + len(data) + after, before, len(data), data),
    st.binary(min_size=1, max_size=BUFFER_BYTES),
    st.integers(0, 2**20),
    st.integers(0, 2**20),
)
"""Chunks within the bounds of their file."""


_refusals = st.sampled_from(sorted(c.text for c in errors.REFUSALS))
_failures = st.sampled_from(sorted(c.text for c in errors.FAILURES))


@singledispatch
def payload_values(payload: payloads.Payload) -> SearchStrategy[Any]:
    """Return a strategy for the values of a payload."""
    raise TypeError(f"{type(payload).__name__} has no strategy: add one to this module")


@payload_values.register
def _(payload: payloads.NoData) -> SearchStrategy[None]:  # noqa: ARG001 - chosen by its type
    return st.none()


@payload_values.register
def _(payload: payloads.Record) -> SearchStrategy[Any]:
    make = payload.factory
    if make is None:
        return values(payload.parts[0])
    return st.tuples(*map(values, payload.parts)).map(lambda v: make(*v))


@payload_values.register
def _(payload: payloads.OptionalRecord) -> SearchStrategy[Any]:
    return st.none() | payload_values(payload.inner)


@payload_values.register
def _(payload: payloads.FirstReply) -> SearchStrategy[payloads.Acceptance]:
    refused = _refusals if payload.has_code else st.none()
    return st.just(payloads.Acceptance(accepted=True)) | refused.map(
        lambda code: payloads.Acceptance(accepted=False, code=code)
    )


@payload_values.register
def _(payload: payloads.FinalResult) -> SearchStrategy[payloads.Outcome]:  # noqa: ARG001 - chosen by its type
    return st.just(payloads.Outcome(done=True)) | _failures.map(
        lambda code: payloads.Outcome(done=False, code=code)
    )


@payload_values.register
def _(payload: payloads.NameList) -> SearchStrategy[payloads.NameListPart]:  # noqa: ARG001 - chosen by its type
    some = st.lists(names, unique=True, max_size=7).map(tuple)
    return st.builds(payloads.NameListPart, st.booleans(), some)


@payload_values.register
def _(payload: payloads.OptionalName) -> SearchStrategy[bytes]:  # noqa: ARG001 - chosen by its type
    return st.just(b"") | names


@payload_values.register
def _(payload: payloads.Jog) -> SearchStrategy[payloads.JogDirection]:  # noqa: ARG001 - chosen by its type
    return st.sampled_from(payloads.JogDirection)


@payload_values.register
def _(payload: FileData) -> SearchStrategy[Chunk]:  # noqa: ARG001 - chosen by its type
    return chunks


def _frames_of(command: Command, direction: Direction) -> SearchStrategy[Frame]:
    is_request = direction is command.initiator
    payload = command.request if is_request else command.reply
    first = payload_values(payload).map(
        lambda value: Frame(direction, command.opcode, payload.encode(value))
    )
    if is_request or command.result is None:
        return first
    result = command.result
    return first | payload_values(result).map(
        lambda value: Frame(direction, command.opcode, result.encode(value), tagged=True)
    )


def frames(direction: Direction) -> SearchStrategy[Frame]:
    """Return a strategy for the frames of all commands that a correct peer may send."""
    return st.one_of([_frames_of(command, direction) for command in COMMANDS])
