"""Collects rows for Rerun in columns: a chunk of hundreds costs little more than one row."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import rerun as rr

from scaraspec_recorder.sinks.rerun.arm_model import Box, Cylinder, Placement, Vector
from scaraspec_recorder.sinks.text import LogLine

TIMELINES: Final = ("time", "elapsed", "exchange")
_BATCH_ROWS: Final = 512

Columns = Callable[[list[Any]], Any]


class RowBatches:
    """Rows waiting to be sent, by entity.

    Args:
        stream: The stream.
        start_ns: Start of the timeline ``elapsed`` in nanoseconds since the Unix epoch.
    """

    def __init__(self, stream: rr.RecordingStream, start_ns: int) -> None:
        self._stream = stream
        self._start_ns = start_ns
        self._rows: dict[str, tuple[Columns, list[tuple[int, int, Any]]]] = {}

    def put(self, entity: str, columns: Columns, time_ns: int, number: int, value: Any) -> None:
        """Add a row with time, exchange number and value; `columns` converts the values."""
        _, rows = self._rows.setdefault(entity, (columns, []))
        rows.append((time_ns, number, value))
        if len(rows) >= _BATCH_ROWS:
            self._send(entity)

    def flush(self) -> None:
        """Send all."""
        for entity in tuple(self._rows):
            self._send(entity)

    def _send(self, entity: str) -> None:
        columns, rows = self._rows.pop(entity)
        times, numbers, values = zip(*rows, strict=True)
        time_ns = np.array(times, np.int64)
        elapsed = (time_ns - self._start_ns).astype("timedelta64[ns]")
        indexes = (
            rr.TimeColumn("time", timestamp=time_ns.astype("datetime64[ns]")),
            rr.TimeColumn("elapsed", duration=elapsed),
            rr.TimeColumn("exchange", sequence=np.array(numbers, np.int64)),
        )
        self._stream.send_columns(entity, indexes, columns(list(values)))


def scalars(values: list[float]) -> Any:
    """Numbers of a plot."""
    return rr.Scalars.columns(scalars=np.array(values, np.float64))


def states(values: list[str]) -> Any:
    """States of a lane; an empty one ends the previous state."""
    return rr.StateChange.columns(state=values)


def lines(values: list[LogLine]) -> Any:
    """Lines of a log."""
    return rr.TextLog.columns(text=[v.text for v in values], level=[v.level for v in values])


def pages(values: list[str]) -> Any:
    """Pages of Markdown."""
    return rr.TextDocument.columns(text=values, media_type=["text/markdown"] * len(values))


def points(values: list[Vector]) -> Any:
    """Points in space."""
    return rr.Points3D.columns(positions=np.array(values, np.float32))


def strips(values: list[tuple[Vector, Vector]]) -> Any:
    """Straight lines in space."""
    return rr.LineStrips3D.columns(strips=[np.array(v, np.float32) for v in values])


def placements(values: list[Placement]) -> Any:
    """Positions of links relative to their parents."""
    half = np.radians([value.turn_deg for value in values]) / 2
    zero = np.zeros_like(half)
    return rr.Transform3D.columns(
        translation=np.array([value.shift_mm for value in values], np.float32),
        quaternion=np.stack([zero, zero, np.sin(half), np.cos(half)], axis=1),
    )


def boxes(values: list[Box]) -> Any:
    """Solid boxes."""
    return rr.Boxes3D.columns(
        centers=[value.centre_mm for value in values],
        half_sizes=[[side / 2 for side in value.size_mm] for value in values],
        colors=_colours(values),
        fill_mode=["solid"] * len(values),
    )


def cylinders(values: list[Cylinder]) -> Any:
    """Solid cylinders."""
    return rr.Cylinders3D.columns(
        centers=[value.centre_mm for value in values],
        radii=[value.radius_mm for value in values],
        lengths=[value.length_mm for value in values],
        colors=_colours(values),
        fill_mode=["solid"] * len(values),
    )


def _colours(values: list[Box] | list[Cylinder]) -> Any:
    return np.array([value.colour << 8 | 0xFF for value in values], np.uint32)
