"""capture.rrd shows values, states and texts on three timelines, with a layout."""

import math
import pickle
import subprocess
import sys
import sysconfig
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from rerun.chunk import RrdReader
from traffic_notation import wire_events

from scaraspec.judge.judge import Judge
from scaraspec.protocol.commands import COMMANDS, Command
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.program_files import listing, parse
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.recordings.capture import capture_sink, write_rrd
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.rerun import blueprint
from scaraspec_recorder.sinks.rerun.arm_model import BASE, SEGMENTS
from scaraspec_recorder.sinks.rerun.rerun_rows import TIMELINES
from scaraspec_recorder.sinks.rerun.rerun_sink import RerunSink
from scaraspec_recorder.sinks.sink import OutputFolder, SinkFailed
from scaraspec_recorder.sinks.text import Level, LogLine
from scaraspec_recorder.sources.mcap_reader import read_mcap

RERUN = Path(sysconfig.get_path("scripts")) / "rerun"


def column(path: Path, entity: str, component: str, index: str = "time") -> list[Any]:
    """Return the values of a component in the order of a timeline."""
    found: list[tuple[Any, Any]] = []
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == f"/{entity}" and not chunk.is_static:
            batch = chunk.to_record_batch()
            times = batch.column(index).to_pylist()
            found += zip(times, batch.column(component).to_pylist(), strict=True)
    return [value[0] for _, value in sorted(found, key=lambda row: row[0])]


def static(path: Path, entity: str, component: str) -> Any:
    """Return the last logged value of a static component."""
    (value,) = (
        chunk.to_record_batch().column(component).to_pylist()[-1]
        for chunk in RrdReader(path).stream().to_chunks()
        if chunk.entity_path == f"/{entity}" and chunk.is_static
    )
    return value[0]


@pytest.fixture(scope="module")
def drawing(tmp_path_factory: pytest.TempPathFactory, shift: list[WireEvent]) -> Path:
    """Return the .rrd file of the shift."""
    path = tmp_path_factory.mktemp("rrd") / "capture.rrd"
    write_rrd(shift, path)
    return path


def test_rerun_verifies_the_file(drawing: Path) -> None:
    """The tool of Rerun reports no problem, including the footer."""
    for command in ("verify", "stats"):
        subprocess.run([RERUN, "rrd", command, drawing], check=True, capture_output=True)


def test_the_file_contains_a_layout(drawing: Path) -> None:
    """Its blueprint has the name of the application."""
    (entry,) = RrdReader(drawing).blueprints()
    assert entry.application_id == "scaraspec"


def test_joint_values(drawing: Path) -> None:
    """One point for each reply, in degrees and millimetres."""
    assert column(drawing, "joint/inner_arm", "Scalars:scalars") == [*range(0, 60, 3), 60, 60]
    assert column(drawing, "joint/wrist", "Scalars:scalars") == [*range(250, 230, -1), 230, 230]
    assert column(drawing, "temperature/rotation", "Scalars:scalars") == [27.5] * 22
    assert column(drawing, "analog/01", "Scalars:scalars") == [42.5] * 22


def test_the_drawn_arm_ends_at_the_reported_tool_position(drawing: Path) -> None:
    """The chain of links ends at the pose of 0x38, for the virtual arm."""
    entity, turn, (x, y, z) = f"arm/{BASE}", 0.0, (0.0, 0.0, 0.0)
    for segment in SEGMENTS:
        entity += f"/{segment.link}"
        shift = column(drawing, entity, "Transform3D:translation")[7]
        *_, sine, cosine = column(drawing, entity, "Transform3D:quaternion")[7]
        x += shift[0] * math.cos(turn) - shift[1] * math.sin(turn)
        y += shift[0] * math.sin(turn) + shift[1] * math.cos(turn)
        z += shift[2]
        turn += 2 * math.atan2(sine, cosine)
    tool = column(drawing, blueprint.TOOL_NOW, "Points3D:positions")[7]
    assert (x, y, z) == pytest.approx(tool, abs=0.01)
    theta_x = column(drawing, "tool/theta_x", "Scalars:scalars")[7]
    assert math.degrees(turn) == pytest.approx(theta_x, abs=0.01)


def test_states_are_drawn_at_changes(drawing: Path) -> None:
    """One row for each change, however often the client polls."""
    state = "StateChange:state"
    assert column(drawing, blueprint.ROBOT_STATUS, state) == ["01", "12", "00"]
    assert column(drawing, blueprint.PROGRAM, state) == ["pick.rob", ""]
    assert column(drawing, blueprint.TRANSFER, state) == ["upload pick.rob", ""]
    assert column(drawing, blueprint.LINK, state) == ["connected", ""]
    assert column(drawing, blueprint.input_lane(8), state) == ["1"]
    assert column(drawing, blueprint.input_lane(2), state) == ["0"]
    assert column(drawing, blueprint.output_lane(5), state) == ["0", "1", "0"]


def test_the_executing_command_is_shown_until_its_final_result(drawing: Path) -> None:
    """An emergency stop covers the run that it ends; a gap hides executing commands."""
    assert column(drawing, blueprint.COMMAND, "StateChange:state") == [
        "run_program",
        "emergency_stop",
        "run_program",
        "",
    ]


def test_the_log_has_no_password(drawing: Path) -> None:
    """One line per exchange and event; queries have a lower level than commands."""
    exchanges = column(drawing, blueprint.EXCHANGES, "TextLog:text")
    levels = column(drawing, blueprint.EXCHANGES, "TextLog:level")
    events = "\n".join(column(drawing, blueprint.EVENTS, "TextLog:text"))
    assert exchanges[0] == "login (password) → ok (2.0 ms)"
    assert levels.count("DEBUG") > levels.count("INFO") > 0
    assert any("refused 01 running a program" in text for text in exchanges)
    for words in ("no frame (stray)", "37 bytes from the controller are missing", "complete"):
        assert words in events
    assert "sesame" not in "".join(exchanges) + events


def test_a_mark_has_its_own_time(tmp_path: Path, talk: Any) -> None:
    """The time of the mark is kept, also before anything else is drawn."""
    path, line = tmp_path / "marked.rrd", LogLine(Level.WARN, "trigger", "signal: asked for")
    talk.mark(A2C, Kind.OPENED, "a > b")
    sink = RerunSink.to_file(path)
    sink.mark(talk.time_ns - 2_000, line)
    sink.write(talk.events[0])
    sink.mark(talk.time_ns + 1_000, line._replace(text="later"))
    sink.close({})
    assert column(path, blueprint.EVENTS, "TextLog:text") == ["signal: asked for", "later"]


def test_an_uploaded_program_is_a_page(drawing: Path, program_file: bytes) -> None:
    """The page has its listing, from the time at which it was complete."""
    (page,) = column(drawing, blueprint.PROGRAM_PAGE, "TextDocument:text")
    assert listing(parse(program_file)) in page


def test_the_session_page_shows_the_conclusion(drawing: Path) -> None:
    """The page also has the dialects and an explanation of the views."""
    page = static(drawing, blueprint.SESSION_PAGE, "TextDocument:text")
    assert "- **conclusion**: " in page
    assert "- **controller speaks**: " in page
    assert blueprint.LEGEND in page


def test_every_row_is_on_every_timeline(drawing: Path) -> None:
    """No timeline lacks data; exchanges are numbered from 1."""
    for chunk in RrdReader(drawing).stream().to_chunks():
        if not chunk.is_static:
            assert set(chunk.timeline_names) == set(TIMELINES)
    numbers = [
        number
        for chunk in RrdReader(drawing).stream().to_chunks()
        if chunk.entity_path == f"/{blueprint.EXCHANGES}"
        for number in chunk.to_record_batch().column("exchange").to_pylist()
    ]
    assert sorted(numbers) == list(range(1, len(numbers) + 1))


def test_every_series_has_a_name_with_its_unit(drawing: Path) -> None:
    """A user can identify every line."""
    for entity, (name, _) in blueprint.SERIES.items():
        assert static(drawing, entity, "SeriesLines:names") == name
        assert name.split()[-1] in ("°", "mm", "°C")


def test_latency_of_robot_and_recorder(
    passed: list[WireEvent], drawing: Path, tmp_path: Path
) -> None:
    """Each has its own points; if unknown, the sum is in the series of the robot."""
    path = tmp_path / "capture.rrd"
    write_rrd(passed, path)
    queries = column(path, "latency/queries", "Scalars:scalars")
    assert {round(value, 6) for value in queries} == {1.98}
    added = column(path, blueprint.ADDED_LATENCY, "Scalars:scalars")
    assert {round(value, 6) for value in added} == {0.04}
    complete = column(drawing, "latency/queries", "Scalars:scalars")
    assert {round(value, 6) for value in complete} == {2.0}
    assert not column(drawing, blueprint.ADDED_LATENCY, "Scalars:scalars")


def test_rows_are_sent_in_batches(
    shift: list[WireEvent], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At most every five seconds of the clock: the cost is per chunk."""
    monkeypatch.setattr("scaraspec_recorder.sinks.rerun.rerun_sink.optimize", lambda _: True)
    path = tmp_path / "capture.rrd"
    decoder = Decoder([RerunSink.to_file(path)], Judge())
    for event in shift:
        decoder.write(event)
        decoder.tick(event.time_ns)
    decoder.close()
    chunks = [c for c in RrdReader(path).stream().to_chunks() if c.entity_path == "/joint/wrist"]
    assert len([c for c in chunks if not c.is_static]) <= 4
    assert column(path, "joint/wrist", "Scalars:scalars")[:3] == [250, 249, 248]


def test_the_sink_overwrites_no_file(shift: list[WireEvent], tmp_path: Path) -> None:
    """After a failure a new sink in another process writes new files."""
    make = pickle.loads(pickle.dumps(partial(capture_sink, session={"robot": "line 3"})))
    files: list[str] = []
    for _ in range(2):
        sink = make(OutputFolder(tmp_path, files))
        for event in shift:
            sink.write(event)
        sink.close()
    assert files == ["capture.mcap", "capture.rrd", "capture-2.mcap", "capture-2.rrd"]
    assert {path.name for path in tmp_path.iterdir()} == set(files)
    for name in files[::2]:
        assert list(read_mcap(tmp_path / name)) == shift
    assert "- **robot**: line 3" in static(
        tmp_path / files[3], blueprint.SESSION_PAGE, "TextDocument:text"
    )


def test_a_failed_creation_leaves_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is retried while a disk is full; existing files are kept."""

    def refuse(*_: object, **__: object) -> None:
        raise SinkFailed("full")

    (tmp_path / "capture.rrd").write_bytes(b"mine")
    monkeypatch.setattr(RerunSink, "to_file", refuse)
    with pytest.raises(SinkFailed):
        capture_sink(OutputFolder(tmp_path, []))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"mine"]


def test_the_error_has_the_reason_of_the_system(tmp_path: Path) -> None:
    """An example is "No such file or directory"."""
    with pytest.raises(FileNotFoundError, match="No such file or directory"):
        RerunSink.to_file(tmp_path / "gone" / "capture.rrd")


def test_colours_of_names(shift: list[WireEvent], drawing: Path) -> None:
    """Programs have neutral colours; each has its own colour, up to a limit."""
    assert static(drawing, blueprint.PROGRAM, "StateConfiguration:labels") == "pick.rob"
    sink = RerunSink.to_file(drawing.with_name("many.rrd"), optimized=False)
    sink.write(shift[0])
    for number in range(200):
        sink._state(blueprint.PROGRAM, f"{number}.rob")
    sink.close({})
    assert len(sink._names[blueprint.PROGRAM]) == 100


def test_hostile_numbers_are_not_drawn(talk: Any, tmp_path: Path) -> None:
    """Invalid payloads and ports that no robot has create no entity."""
    talk.ask("get_analog_input", 40, 1.0)
    talk.send(A2C, Frame(A2C, 0x44, b"99999999").encode())
    talk.send(C2A, Frame(C2A, 0x44, b"1|5").encode())
    path = tmp_path / "capture.rrd"
    write_rrd(talk.events, path)
    drawn = {chunk.entity_path for chunk in RrdReader(path).stream().to_chunks()}
    assert {entity for entity in drawn if entity.startswith("/analog")} == {"/analog/40"}


@pytest.mark.parametrize(
    "command", [c for c in COMMANDS if c.initiator is A2C], ids=lambda c: c.name
)
def test_refusals_are_not_drawn_as_values(talk: Any, tmp_path: Path, command: Command) -> None:
    """A robot that replies ``0`` to every command is drawn without errors."""
    talk.send(A2C, Frame(A2C, command.opcode, b"1").encode())
    talk.send(C2A, Frame(C2A, command.opcode, b"0").encode())
    write_rrd(talk.events, tmp_path / "capture.rrd")


def test_a_recording_without_events(tmp_path: Path) -> None:
    """The file opens with its session page."""
    path = tmp_path / "capture.rrd"
    write_rrd([], path)
    assert "conclusion" in static(path, blueprint.SESSION_PAGE, "TextDocument:text")


def test_closed_files_leave_no_threads(shift: Any, tmp_path: Path) -> None:
    """A recorder that rotates for weeks must not accumulate threads."""
    threads = Path("/proc/self/task")
    if not threads.exists():
        pytest.skip("only Linux lists the threads of all libraries")
    running = []
    for number in range(4):
        write_rrd(shift[:10], tmp_path / f"{number}.rrd")
        running.append(len(list(threads.iterdir())))
    assert running[-1] <= running[0]


def test_missing_rerun() -> None:
    """The error is one sentence with the command that installs the extra."""
    code = (
        "import sys; sys.modules['rerun'] = None\n"
        "try: import scaraspec_recorder.sinks.rerun.rerun_sink\n"
        "except ImportError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    expected = "drawing recordings needs rerun: pip install 'scaraspec[view]'\n"
    assert done.stdout == expected


def test_a_violation_is_shown_for_a_second(tmp_path: Path) -> None:
    """It has a lane of its own; the lane of the program ends when the robot is idle."""
    path = tmp_path / "a.rrd"
    session = """
        login
        > get_running_program
        < get_running_program 1|a.rob|00000001
        > reset
        < reset 1
        <90 reset 11
        <90 reset 11
        +3
        > get_status
        < get_status 00
    """
    write_rrd(wire_events(session), path)
    state = "StateChange:state"
    assert column(path, blueprint.FINDING, state) == ["3/18", ""]
    assert column(path, blueprint.PROGRAM, state) == ["a.rob", ""]
