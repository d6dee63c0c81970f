"""Search for a password in recordings, with the readers of mcap and of Rerun.

Everything is searched that a reader can get: file names, metadata, attachments, messages in
decompressed chunks, and the columns of an .rrd file. The password is searched as it is, in
hexadecimal digits, base64, UTF-16 and with escapes.
"""

import base64
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pyarrow as pa  # type: ignore[import-untyped]  # it ships no types
from mcap.reader import make_reader
from rerun.chunk import RrdReader

from scaraspec_recorder.sources.mcap_reader import read_mcap


def forms(password: bytes) -> set[bytes]:
    """Return how a password may look."""
    text = password.decode("latin-1")
    found = {
        password,
        text.encode("utf-8"),
        text.encode("utf-16-le"),
        text.encode("utf-16-be"),
        text.encode("utf-32-le"),
        repr(password)[2:-1].encode(),
        text.encode("unicode_escape"),
        json.dumps(text)[1:-1].encode(),
        password.hex().encode(),
        password.hex().upper().encode(),
    }
    for encode in (base64.b64encode, base64.urlsafe_b64encode):
        for before in range(3):  # bytes before it in the same group of three
            whole = before + len(password) - (before + len(password)) % 3
            encoded = encode((bytes(before) + password)[:whole])
            found.add(encoded[4 if before else 0 :])
    return found


def occurrences(password: bytes, pieces: Iterable[tuple[str, bytes]]) -> list[str]:
    """Return the places of a password in named pieces of data."""
    wanted = forms(password)
    found = []
    for place, data in pieces:
        digits = re.sub(rb"\\x|0x|[\s:,-]", b"", data)  # of a hexadecimal dump
        if any(form in data or form in digits for form in wanted):
            found.append(place)
    return found


def contents(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the contents of all recordings in a folder, and all other files as they are."""
    for path in sorted(folder.rglob("*")):
        yield path.name, path.name.encode()
        if path.suffix == ".mcap":
            yield from _mcap(path)
        elif path.suffix == ".rrd":
            yield from _rrd(path)
        elif path.is_file():
            yield path.name, path.read_bytes()


def _mcap(path: Path) -> Iterator[tuple[str, bytes]]:
    with path.open("rb") as file:
        reader = make_reader(file)
        for metadata in reader.iter_metadata():
            yield f"metadata {metadata.name}", repr(metadata.metadata).encode()
        for attachment in reader.iter_attachments():
            yield f"attachment {attachment.name}", attachment.data
        for _, channel, message in reader.iter_messages():
            yield channel.topic, message.data
    streams: dict[str, bytearray] = {}  # a password may be split
    for event in read_mcap(path):
        stream = f"{event.direction.value} of connection {event.connection}"
        streams.setdefault(stream, bytearray()).extend(event.data)
    yield from ((stream, bytes(data)) for stream, data in streams.items())


def _rrd(path: Path) -> Iterator[tuple[str, bytes]]:
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        yield chunk.entity_path, chunk.entity_path.encode()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
            for buffer in array.buffers():
                if buffer:
                    yield f"{chunk.entity_path} {name}", buffer.to_pybytes()
