"""Layout of a recording in the viewer, and the style of each series and lane.

Belongs here: names, units, colours, layout and entity paths. `rerun_sink` writes the data.
"""

from collections.abc import Iterable, Iterator
from itertools import cycle
from typing import Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from scaraspec.protocol import errors
from scaraspec.protocol.commands import COMMANDS
from scaraspec_recorder.sinks.rerun.rerun_rows import TIMELINES

ARM: Final = "arm"
TOOL_NOW: Final = "tool/position"
TOOL_PATH: Final = "tool/path"

ROBOT_STATUS: Final = "state/robot"
COMMAND: Final = "state/command"
PROGRAM: Final = "state/program"
TRANSFER: Final = "state/transfer"
LINK: Final = "state/link"
FINDING: Final = "state/finding"
CASE: Final = "state/case"

EVENTS: Final = "log/events"
EXCHANGES: Final = "log/exchanges"

SESSION_PAGE: Final = "pages/session"
PROGRAM_PAGE: Final = "pages/program"

LEGEND: Final = """\
## What is shown
- **Arm**: drawn as an arm of 200 + 200 mm, in the joint angles that the controller reports (0x3C).
  The document gives no geometry, so another robot has another shape. **Tool path**: where the
  controller says that the tool is (0x38).
- **States**: the robot's status (0x09), the two-stage command in flight, from request to final
  result, the program that runs (0x0A) until the robot is idle, the file transfer, the link, and
  each violation for a second, and in a certification the case that runs; ports on a page of their
  own.
- **Plots**: reported values, each until the next one.
- **Reply latency**: the robot's, and beside it what the recorder in between has added.
- **Log**: findings, bytes that are no frame, gaps, commands. Queries are under *All exchanges*.
- Timelines: `time` (clock of the recorder), `elapsed`, `exchange` (number of the request).
"""
"""Markdown text that explains the layout to new users."""

INPUTS, OUTPUTS = 8, 16
"""How many digital ports the protocol shows (L651, L684)."""

_RED, _ORANGE, _YELLOW, _GREEN, _TEAL, _BLUE, _VIOLET, _GREY = (
    0xE53935,
    0xFB8C00,
    0xFDD835,
    0x43A047,
    0x26A69A,
    0x42A5F5,
    0xAB47BC,
    0x78909C,
)

SERIES: Final = {
    "joint/inner_arm": ("inner arm °", _RED),
    "joint/outer_arm": ("outer arm °", _ORANGE),
    "joint/rotation": ("rotation °", _VIOLET),
    "tool/theta_x": ("tool theta_x °", _BLUE),
    "tool/x": ("tool x mm", _RED),
    "tool/y": ("tool y mm", _GREEN),
    "tool/z": ("tool z mm", _BLUE),
    "joint/wrist": ("wrist mm", _YELLOW),
    "temperature/inner_arm": ("inner arm °C", _RED),
    "temperature/outer_arm": ("outer arm °C", _ORANGE),
    "temperature/wrist": ("wrist °C", _YELLOW),
    "temperature/rotation": ("rotation °C", _VIOLET),
}
"""Lines of the plots: entity, its name with the unit, its colour."""

ADDED_LATENCY: Final = "latency/recorder"

LATENCY: Final = {
    "latency/queries": ("queries ms", _TEAL),
    "latency/commands": ("commands ms", _ORANGE),
    "latency/chunks": ("file chunks ms", _VIOLET),
    ADDED_LATENCY: ("added by the recorder ms", _GREY),
}
"""Points of the latency plot: from a request's last byte to the reply's first."""

DURATION: Final = "duration/two_stage"
"""How long two-stage commands executed, in seconds."""


def input_lane(port: int) -> str:
    """Return the entity path of a digital input."""
    return f"io/input/{port:02}"


def output_lane(port: int) -> str:
    """Return the entity path of a digital output."""
    return f"io/output/{port:02}"


def analog_series(port: int) -> str:
    """Return the entity path of an analog input."""
    return f"analog/{port:02}"


def styles() -> Iterator[tuple[str, Any]]:
    """Yield the static styles of all series and lanes."""
    for entity, (name, colour) in SERIES.items():
        yield (
            entity,
            rr.SeriesLines(
                names=name, colors=_rgba(colour), widths=1.5, interpolation_mode="StepAfter"
            ),
        )
    for entity, (name, colour) in LATENCY.items():
        yield entity, rr.SeriesPoints(names=name, colors=_rgba(colour), marker_sizes=2.5)
    yield DURATION, rr.SeriesPoints(names="execution s", colors=_rgba(_BLUE), marker_sizes=4)
    yield TOOL_NOW, rr.Points3D.from_fields(colors=_rgba(_YELLOW), radii=7)
    yield TOOL_PATH, rr.LineStrips3D.from_fields(colors=_rgba(_YELLOW), radii=1.2)
    yield ROBOT_STATUS, _lane({c.text: (f"{c.text} {c.meaning}", colour) for c, colour in _codes()})
    yield COMMAND, _lane({c.name: (c.name, _command_colour(c.name)) for c in COMMANDS})
    yield LINK, _lane({"connected": ("connected", _GREEN), "reset": ("reset", _RED)})
    for lane in (*map(input_lane, range(1, INPUTS + 1)), *map(output_lane, range(1, OUTPUTS + 1))):
        yield lane, _lane({"0": ("0", 0x455A64), "1": ("1", _GREEN)})


def names(texts: Iterable[str]) -> Any:
    """Return the style of a lane of names; it avoids the colours of good and bad states."""
    colours = cycle((_BLUE, _TEAL, _VIOLET))
    return _lane({text: (text, colour) for text, colour in zip(texts, colours, strict=False)})


def violations(texts: Iterable[str]) -> Any:
    """Return the style of the lane of violations."""
    return _lane({text: (text, _RED) for text in texts})


def _codes() -> Iterator[tuple[errors.Code, int]]:
    colours = {errors.Kind.IDLE: _GREY, errors.Kind.RUNNING: _GREEN}
    for code in errors.TABLE_8_1.values():
        yield code, colours.get(code.kind, _RED)


def _command_colour(name: str) -> int:
    if name == "emergency_stop":
        return _RED
    return _GREEN if name in ("run_program", "simulate_program") else _BLUE


def _lane(states: dict[str, tuple[str, int]]) -> Any:
    return rr.StateConfiguration(
        values=list(states),
        labels=[label for label, _ in states.values()],
        colors=np.array([colour << 8 | 0xFF for _, colour in states.values()], np.uint32),
    )


def _rgba(colour: int) -> Any:
    return np.array([colour << 8 | 0xFF], np.uint32)


_SO_FAR: Final = [
    rrb.VisibleTimeRange(
        timeline,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    for timeline in TIMELINES
]

_AXIS: Final = rrb.TimeAxis(link="LinkToGlobal")
"""A shared time axis for all plots and lanes."""


def layout() -> Any:
    """Return the layout: arm, states and plots in one view, next to the log and the pages."""
    arm = rrb.Spatial3DView(
        origin="/",
        contents=[f"/{ARM}/**", f"/{TOOL_NOW}", f"/{TOOL_PATH}"],
        name="Arm (shape of the virtual arm) and tool path (as reported), mm",
        line_grid=rrb.LineGrid3D(spacing=100.0),
        eye_controls=rrb.EyeControls3D(position=(640, -640, 620), look_target=(140, 0, 240)),
        overrides={TOOL_PATH: rrb.VisibleTimeRanges(_SO_FAR)},
    )
    states = rrb.Tabs(
        rrb.StateTimelineView(origin="/state", name="States", time_view=_AXIS),
        rrb.StateTimelineView(origin="/io", name="Inputs and outputs", time_view=_AXIS),
    )
    plots = rrb.Vertical(
        _plot("Angles °", "joint/inner_arm", "joint/outer_arm", "joint/rotation", "tool/theta_x"),
        _plot("Positions mm", "tool/x", "tool/y", "tool/z", "joint/wrist"),
        rrb.Tabs(
            _plot("Reply latency ms", *LATENCY),
            _plot("Motor temperatures °C", *(s for s in SERIES if s.startswith("temperature/"))),
            _plot("Execution s", DURATION),
            _plot("Analog inputs", "analog/**"),
        ),
    )
    words = rrb.Tabs(
        _log("Log", "/log/**", "INFO", "WARN", "ERROR"),
        _log("All exchanges", f"/{EXCHANGES}", "DEBUG", "INFO", "WARN", "ERROR"),
        rrb.TextDocumentView(origin=PROGRAM_PAGE, name="Program"),
        rrb.TextDocumentView(origin=SESSION_PAGE, name="Session"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(arm, words, row_shares=[3, 2]),
            rrb.Vertical(states, plots, row_shares=[1, 3]),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(timeline="time", state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _plot(name: str, *entities: str) -> Any:
    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"/{entity}" for entity in entities],
        name=name,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop),
        axis_x=_AXIS,
    )


def _log(name: str, contents: str, *levels: str) -> Any:
    return rrb.TextLogView(
        contents=contents,
        name=name,
        rows=rrb.TextLogRows(filter_by_log_level=levels),
        columns=rrb.TextLogColumns(  # a column is as wide as its name: `time` would be truncated
            timeline_columns=["elapsed"], text_log_columns=["LogLevel", "Body"]
        ),
    )
