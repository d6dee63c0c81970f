"""Display of recordings: few plain lines, or a dashboard on a terminal."""

import io
import os
from dataclasses import replace
from pathlib import Path
from unittest.mock import MagicMock

from rich.console import Console

from scaraspec_recorder.monitoring.dashboard import MIN_INTERVAL_S, Dashboard, LineDisplay
from scaraspec_recorder.monitoring.status import STALL_S, START_S, Status, StatusReader
from scaraspec_recorder.recording import Recording
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.spool.event_builder import ByteCounts
from scaraspec_recorder.spool.spool import WriteStall

CALM = Status(
    name="line-3",
    listen=(("127.0.0.1", 8877),),
    out_dir=Path("captures"),
    time_s=1000,
    progress=Progress(3, ByteCounts(7000), ByteCounts(500_000), ["capture.mcap"]),
    waiting_bytes=0,
    silent_s=0.2,
    free_bytes=2 * 10**12,
)


def at(time_s: float, progress: Progress | None = None, silent_s: float = 0.2) -> Status:
    """Return the status of the recording at a later time."""
    return replace(
        CALM,
        time_s=CALM.time_s + time_s,
        progress=progress or CALM.progress,
        silent_s=silent_s,
        waiting_bytes=1_500_000,
    )


def gaps(count: int) -> Progress:
    """Return a progress with this number of gaps."""
    return replace(CALM.progress, a2c=ByteCounts(7000, 100 * count, count))


def test_no_output_without_problems() -> None:
    """During an hour without problems nothing is printed."""
    reported: list[str] = []
    with LineDisplay(reported.append) as lines:
        for second in range(3600):
            lines.update([at(second)], ending=False)
    assert reported == []


def test_gaps_are_reported_at_intervals() -> None:
    """With one gap per second, the first is printed immediately, then one line every
    `MIN_INTERVAL_S`."""
    reported: list[str] = []
    with LineDisplay(reported.append) as lines:
        for second in range(60):
            lines.update([at(second, gaps(second + 1))], ending=False)
    assert reported[0] == "line-3: 1 gaps so far, 100 B not recorded"
    assert reported[1] == "line-3: 11 gaps so far, 1.1 kB not recorded"
    assert len(reported) == 60 / MIN_INTERVAL_S


def test_a_stall_is_reported_with_its_reason() -> None:
    """Start and end of a stall are reported immediately, whether or not anything was written
    recently."""
    full = replace(at(0), stall=WriteStall(995 * 10**9, "No space left on device"))
    reported: list[str] = []
    with LineDisplay(reported.append) as lines:
        lines.update([full], ending=False)
        lines.update([at(20)], ending=False)
    assert reported == [
        "line-3: writing is stalled, 1.5 MB waiting: No space left on device",
        "line-3: writing continues",
    ]
    screen = io.StringIO()
    console = Console(file=screen, width=160)
    with Dashboard(console) as dashboard:
        dashboard.update([replace(full, silent_s=5)], ending=False)
    shown = screen.getvalue()
    assert "line-3: writing is stalled for 5 s: No space left on device" in shown


def test_problems_are_reported_once() -> None:
    """Each problem has one line, also a stall of the writing and its end."""
    reported: list[str] = []
    stall = replace(CALM.progress, problems=["McapSink is disabled"])
    with LineDisplay(reported.append) as lines:
        lines.update([at(0, stall)], ending=False)
        lines.update([at(20, stall)], ending=False)
        lines.update([at(40, stall, STALL_S + 1)], ending=False)
        lines.update([at(60, stall)], ending=False)
    assert reported == [
        "line-3: McapSink is disabled",
        "line-3: writing is stalled, 1.5 MB waiting",
        "line-3: writing continues",
    ]


def test_a_slow_start_is_no_stall(tmp_path: Path) -> None:
    """The writer process is not running yet; a spool of an earlier recorder does not count."""
    (tmp_path / "checkpoint.json").write_text("{}")
    os.utime(tmp_path / "checkpoint.json", (1, 1))
    recording = Recording([("127.0.0.1", 8877)], tmp_path, MagicMock(), MagicMock())
    times_s = iter((1000, 1000 + START_S, 1001 + START_S, 1002 + START_S, 1003 + START_S))
    reader = StatusReader("line-3", recording, tmp_path, lambda: next(times_s))
    assert not reader.read_status().stalled
    assert reader.read_status().stalled
    os.utime(tmp_path / "checkpoint.json", (1001, 1001))
    assert reader.read_status().stalled
    os.utime(tmp_path / "checkpoint.json", (1002 + START_S, 1002 + START_S))
    assert not reader.read_status().stalled


def test_a_pending_connection_is_reported() -> None:
    """If it takes longer than usual."""
    said: list[str] = []
    waiting = replace(CALM.progress, connecting_since_ns=1020 * 10**9)
    with LineDisplay(said.append) as lines:
        for second in range(15, 40):
            lines.update([at(second, waiting if second >= 20 else None)], ending=False)
    assert said == ["line-3: connecting to the robot …"]
    screen = io.StringIO()
    with Dashboard(Console(file=screen, width=160)) as dashboard:
        dashboard.update([at(23, waiting)], ending=False)
    assert f"{said[0]} 3 s" in screen.getvalue()


def test_an_unreachable_robot_is_reported() -> None:
    """The line has the reason; a dashboard shows it, too."""
    reported: list[str] = []
    gone = replace(CALM.progress, unreached="Connection refused")
    with LineDisplay(reported.append) as lines:
        for second in range(40):
            lines.update([at(second, gone if second < 20 else None)], ending=False)
    assert reported == [
        "line-3: the robot cannot be reached: Connection refused",
        "line-3: the robot can be reached again",
    ]
    screen = io.StringIO()
    console = Console(file=screen, width=160)
    with Dashboard(console) as dashboard:
        dashboard.update([at(0, gone)], ending=False)
    assert reported[0] in screen.getvalue()


def test_a_slow_end_is_reported() -> None:
    """It is reported immediately, then every `MIN_INTERVAL_S` until all recordings are finished."""
    reported: list[str] = []
    with LineDisplay(reported.append) as lines:
        for second in range(25):
            lines.update([at(second)], ending=True)
        for second in range(25, 60):
            lines.update([at(second, replace(CALM.progress, finished=True))], ending=True)
    assert reported[0].startswith("stopping: ")
    assert reported[1:] == ["line-3: still writing, 1.5 MB remaining"] * 2


def test_the_dashboard_shows_everything() -> None:
    """Connections, rates, bytes, gaps, pending bytes, free space, file, problems; in 80 columns."""
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=80, color_system=None)
    busy = replace(gaps(2), a2c=ByteCounts(9000, 200, 2), problems=["out of luck"])
    with Dashboard(console) as dashboard:
        dashboard.update([CALM], ending=False)
        dashboard.update([at(2, busy, STALL_S + 7)], ending=True)
    last = screen.getvalue().rpartition("robot ")[2]
    row = "line-3 3 1.1 kB 0 B 509 kB 2 1.5 MB 2 TB"
    assert row in " ".join(last.split())
    for shown in (
        "line-3: clients at 127.0.0.1:8877, capture.mcap",
        "line-3: out of luck",
        "line-3: 200 B not recorded in 2 gaps",
        "line-3: writing is stalled for 12 s",
        "stopping: ",
    ):
        assert shown in last, last
