"""Encodes the two messages that Foxglove and Rerun draw by default: log lines and transforms."""

from collections.abc import Iterable
from functools import cache
from math import cos, radians, sin
from typing import Any, Final

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.descriptor_pb2 import (  # type: ignore[import-untyped]  # ships no types
    FileDescriptorSet,
)
from google.protobuf.message import (  # type: ignore[import-untyped]  # as above
    DecodeError,
)

from scaraspec_recorder.sinks.rerun.arm_model import Placement

LOG: Final = "foxglove.Log"
TRANSFORMS: Final = "foxglove.FrameTransforms"

_KINDS: Final[dict[str, Any]] = {LOG: Log, TRANSFORMS: FrameTransforms}
_LEVELS: Final = {
    "DEBUG": Log.DEBUG,
    "INFO": Log.INFO,
    "WARN": Log.WARNING,
    "ERROR": Log.ERROR,
}
_NS: Final = 1_000_000_000


@cache
def descriptor_set(name: str) -> bytes:
    """Return the FileDescriptorSet of `LOG` or `TRANSFORMS`, with all dependencies."""
    found = FileDescriptorSet()
    seen: set[str] = set()

    def add(file: Any) -> None:
        if file.name not in seen:
            seen.add(file.name)
            for needed in file.dependencies:
                add(needed)
            file.CopyToProto(found.file.add())

    add(_KINDS[name].DESCRIPTOR.file)
    return _bytes(found)


def log(time_ns: int, level: str, source: str, text: str) -> bytes:
    """Encode a foxglove.Log; its level is a value of `text.Level`."""
    stamp = _stamp(time_ns)
    return _bytes(Log(timestamp=stamp, level=_LEVELS[level], name=source, message=text))


def read_log(data: bytes) -> tuple[str, str]:
    """Return the source and the text of an encoded foxglove.Log.

    Raises:
        ValueError: The bytes are not such a message.
    """
    try:
        line = Log.FromString(data)
    except DecodeError as error:
        raise ValueError(f"no log line: {error}") from None
    return str(line.name), str(line.message)


def transforms(time_ns: int, placements: Iterable[Placement]) -> bytes:
    """Encode a foxglove.FrameTransforms, in metres."""
    stamp = _stamp(time_ns)
    return _bytes(FrameTransforms(transforms=[_transform(stamp, p) for p in placements]))


def _transform(stamp: Any, placement: Placement) -> Any:
    """Return a transform as a dict, which is faster to copy than a message."""
    x, y, z = placement.shift_mm
    half = radians(placement.turn_deg) / 2
    return {
        "timestamp": stamp,
        "parent_frame_id": placement.parent,
        "child_frame_id": placement.link,
        "translation": {"x": x / 1000, "y": y / 1000, "z": z / 1000},
        "rotation": {"x": 0, "y": 0, "z": sin(half), "w": cos(half)},
    }


def _bytes(message: Any) -> bytes:
    data: bytes = message.SerializeToString()
    return data


def _stamp(time_ns: int) -> Any:
    return {"seconds": time_ns // _NS, "nanos": time_ns % _NS}
