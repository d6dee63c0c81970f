"""Writes a recording to capture.rrd or to a Rerun viewer.

Only derived items are drawn; capture.mcap is the reference, from which the drawing can be made
again. `blueprint` defines the layout, `rerun_rows` the encoding.
"""

import math
import os
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.commands import JointValues, PortValue, Pose, RunningProgram
from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.program_files import ProgramError, listing, parse
from scaraspec.protocol.transfer import TransferState
from scaraspec.traffic.events import Exchange, FrameSeen, Transfer
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks import text as event_text
from scaraspec_recorder.sinks.decoder import Item
from scaraspec_recorder.sinks.rerun import arm_model
from scaraspec_recorder.sinks.rerun.arm_model import Box
from scaraspec_recorder.sinks.rerun.optimizer import optimize
from scaraspec_recorder.sinks.text import LogLine
from scaraspec_recorder.spool.forwarded_chunks import LatencyTracker

try:
    # The native library logs to stderr; errors are reported here. Users can enable the log.
    os.environ.setdefault("RUST_LOG", "off")
    import rerun as rr
except ModuleNotFoundError:
    raise ImportError("drawing recordings needs rerun: pip install 'scaraspec[view]'") from None

from scaraspec_recorder.sinks.rerun import blueprint, rerun_files, rerun_rows

APPLICATION: Final = "scaraspec"
FILE_DELAY_NS: Final = 5_000_000_000
LIVE_DELAY_NS: Final = 100_000_000
_IDLE: Final = "00"
_SHOWN_NS: Final = 1_000_000_000
_MOST_NAMES: Final = 100  # names with a style, per lane
_PAGE_CHARACTERS: Final = 200_000
_PORTS: Final = range(1, 41)  # L655, L667


class RerunSink:
    """Draws one recording.

    Args:
        stream: A connected stream with its layout, see `to_file`.
        session: Session metadata, such as the addresses.
        delay_ns: Maximum age of a row before it is sent.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        session: Mapping[str, str] | None = None,
        delay_ns: int = FILE_DELAY_NS,
    ) -> None:
        self._stream = stream
        self._session = dict(session or {})
        self._delay_ns = delay_ns
        self._file: rerun_files.RerunFile | None = None
        self._optimized: Path | None = None
        self._batches: rerun_rows.RowBatches | None = None
        self._sent_ns = 0
        self._now_ns = 0
        self._number = 0
        self._lanes: dict[str, str] = {}
        self._names: dict[str, list[str]] = {
            lane: [] for lane in (blueprint.PROGRAM, blueprint.TRANSFER, blueprint.FINDING)
        }
        self._cases = deque[tuple[int, str]]()  # not drawn yet
        self._found_ns = 0  # when the last violation was found
        self._in_flight: dict[int, str] = {}  # two-stage commands, by identity of the request
        self._connected: set[str] = set()
        self._latencies = LatencyTracker()
        self._tool: arm_model.Vector | None = None
        self._links: dict[str, str] = {}  # the entity of each link of the arm, once it is drawn
        for entity, style in blueprint.styles():
            stream.log(entity, style, static=True)
        known: dict[str, Any] = {"tool": f"scaraspec {version('scaraspec')}", **self._session}
        stream.send_property("session", rr.AnyValues(**known))
        self._session_page({})

    @classmethod
    def to_file(
        cls,
        path: Path,
        session: Mapping[str, str] | None = None,
        *,
        optimized: bool = True,
        footer: bool = True,
    ) -> "RerunSink":
        """Draw into a new file; an existing one is replaced.

        Args:
            path: The file.
            session: Session metadata, such as the addresses.
            optimized: Whether to optimize the file when it is complete.
            footer: Whether to write a footer; the optimizer creates one itself.

        Raises:
            OSError: From every method, if the file cannot be written.
        """
        file = rerun_files.RerunFile(APPLICATION, path, blueprint.layout(), footer=footer)
        sink = cls(file.stream, session)
        sink._file, sink._optimized = file, path if optimized else None
        return sink

    @classmethod
    def to_viewer(cls, url: str) -> "RerunSink":
        """Draw in a viewer."""
        stream = rerun_files.connect(APPLICATION, url, blueprint.layout())
        return cls(stream, delay_ns=LIVE_DELAY_NS)

    def wait(self, timeout_s: float) -> None:
        """Wait until all sent data has arrived.

        Raises:
            RuntimeError: The timeout has expired.
        """
        self._stream.flush(timeout_sec=timeout_s)

    def write(self, event: WireEvent) -> None:
        """Draw the connection state of a raw event; its bytes are not drawn."""
        self._begin_cases(event.time_ns)
        self._now_ns = event.time_ns
        self._latencies.write(event)
        self._begin(event.time_ns)
        self._end_finding(event.time_ns)
        ended = event.kind in (Kind.CLOSED, Kind.RESET)
        if ended is (event.connection in self._connected):
            self._link(event)

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Draw an item derived from a raw event."""
        self._number = number
        match item:
            case FrameSeen():
                self._frame(item)
            case Exchange():
                self._exchange(item)
            case Transfer():
                self._transfer(item)
            case Finding(verdict=Verdict.FAIL):
                self._finding(item)
        if line:
            log = blueprint.EXCHANGES if isinstance(item, Exchange) else blueprint.EVENTS
            self._put(log, rerun_rows.lines, line)

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Draw a line of the log that does not come from a raw event."""
        self._begin(time_ns)
        self._put(blueprint.EVENTS, rerun_rows.lines, line, time_ns)

    def draw_cases(self, cases: Iterable[tuple[int, str]]) -> None:
        """Draw the cases of a certification, too; an empty text ends the case before it."""
        self._cases.extend(cases)
        ids = dict.fromkeys(case for _, case in self._cases if case)
        self._stream.log(blueprint.CASE, blueprint.names(ids), static=True)

    def tick(self, now_ns: int) -> None:
        """Send rows that have reached their maximum age."""
        if self._batches and not 0 <= now_ns - self._sent_ns < self._delay_ns:
            self._sent_ns = now_ns
            self._batches.flush()
            if self._file:  # a viewer may be slower
                self._file.flush()

    def close(self, summary: Mapping[str, str]) -> None:
        """Send all rows, write the summary, and optimize the file."""
        self._begin_cases(math.inf)
        if self._batches:
            self._batches.flush()
        self._session_page(summary)
        self._batches = None
        if not self._file:
            self._stream.flush()
            self._stream.disconnect()
            return
        del self._stream  # release requires that no reference remains
        self._file.flush()
        self._file.close()
        if self._optimized:
            optimize(self._optimized)

    def _begin_cases(self, until_ns: float) -> None:
        """Draw the cases that have begun or ended."""
        while self._cases and self._cases[0][0] <= until_ns:
            time_ns, case = self._cases.popleft()
            self._begin(time_ns)
            self._state(blueprint.CASE, case, time_ns)

    def _begin(self, time_ns: int) -> None:
        """Start the timelines, unless they have started."""
        if self._batches is None:
            self._batches = rerun_rows.RowBatches(self._stream, time_ns)
            self._stream.send_recording_start_time_nanos(time_ns)

    def _put(
        self, entity: str, columns: rerun_rows.Columns, value: Any, time_ns: int | None = None
    ) -> None:
        assert self._batches, "an item came before its raw event"
        time_ns = self._now_ns if time_ns is None else time_ns
        self._batches.put(entity, columns, time_ns, self._number, value)

    def _state(self, lane: str, value: str, time_ns: int | None = None) -> None:
        """Draw a state if it changes."""
        if self._lanes.get(lane, "") != value:
            self._lanes[lane] = value
            known = self._names.get(lane)
            if known is not None and value not in ("", *known) and len(known) < _MOST_NAMES:
                known.append(value)
                style = blueprint.violations if lane == blueprint.FINDING else blueprint.names
                self._stream.log(lane, style(known), static=True)
            self._put(lane, rerun_rows.states, value, time_ns)

    def _session_page(self, summary: Mapping[str, str]) -> None:
        facts = [f"- **{key}**: {value}" for key, value in {**self._session, **summary}.items()]
        page = "\n".join(("# Session", *facts, "", blueprint.LEGEND))
        document = rr.TextDocument(page, media_type="text/markdown")
        self._stream.log(blueprint.SESSION_PAGE, document, static=True)

    def _link(self, event: WireEvent) -> None:
        """Draw that a connection was opened or closed."""
        self._connected ^= {event.connection}
        count = len(self._connected)
        if count > 1:
            state = f"{count} connections"
        elif count:
            state = "connected"
        else:
            state = "reset" if event.kind is Kind.RESET else ""
        self._state(blueprint.LINK, state)

    def _finding(self, finding: Finding) -> None:
        """Draw a violation, until the next one or for a second."""
        self._found_ns = self._now_ns
        self._state(blueprint.FINDING, finding.requirement)

    def _end_finding(self, now_ns: int) -> None:
        self._state(blueprint.FINDING, "", min(now_ns, self._found_ns + _SHOWN_NS))

    def _frame(self, seen: FrameSeen) -> None:
        self._latencies.frame(seen)
        parsed = seen.parsed
        if parsed and parsed.part == "request" and parsed.command.two_stage:
            self._in_flight[id(seen)] = parsed.command.name
            self._state(blueprint.COMMAND, parsed.command.name)

    def _exchange(self, exchange: Exchange) -> None:
        if self._in_flight.pop(id(exchange.request), None):
            self._state(blueprint.COMMAND, next(reversed(self._in_flight.values()), ""))
        command = exchange.command
        latency = self._latencies.exchange(exchange)
        latency_ns = latency.robot_ns if latency else exchange.latency_ns
        if latency_ns is not None:
            query = command and command.hazard is Hazard.READ_ONLY
            series = "chunks" if exchange.chunk else "queries" if query else "commands"
            self._put(f"latency/{series}", rerun_rows.scalars, latency_ns / 1e6)
        if latency:
            self._put(blueprint.ADDED_LATENCY, rerun_rows.scalars, latency.recorder_ns / 1e6)
        if exchange.duration_ns is not None:
            self._put(blueprint.DURATION, rerun_rows.scalars, exchange.duration_ns / 1e9)
        if exchange.name in ("upload_name", "download_name") and exchange.transfer:
            what = "upload" if exchange.transfer.upload else "download"
            self._state(blueprint.TRANSFER, f"{what} {show(exchange.transfer.name)}")
        drawer = self._DRAWERS.get(exchange.name)
        if exchange.reply_value is None and exchange.name != "get_running_program":
            return  # a refusal; "no program runs" is a state
        if drawer and exchange.reply and not event_text.defect_texts(exchange.reply):
            drawer(self, exchange)

    def _transfer(self, transfer: Transfer) -> None:
        self._state(blueprint.TRANSFER, "")
        if transfer.state is TransferState.DONE and transfer.whole_content:
            with suppress(ProgramError):
                text = listing(parse(bytes(transfer.content)))[:_PAGE_CHARACTERS]
                page = f"# {show(transfer.name)}\n\n```\n{text}```\n"
                self._put(blueprint.PROGRAM_PAGE, rerun_rows.pages, page)

    def _status(self, exchange: Exchange) -> None:
        self._state(blueprint.ROBOT_STATUS, str(exchange.reply_value).upper())
        if exchange.reply_value == _IDLE:
            self._state(blueprint.PROGRAM, "")

    def _program(self, exchange: Exchange) -> None:
        answer = exchange.reply_value
        name = show(answer.name) if isinstance(answer, RunningProgram) else ""
        self._state(blueprint.PROGRAM, name)

    def _temperatures(self, exchange: Exchange) -> None:
        self._series("temperature", exchange.reply_value)

    def _series(self, group: str, values: Any) -> None:
        """Draw the fields of a named tuple that have a line in a plot."""
        for name, value in zip(values._fields, values, strict=True):
            if f"{group}/{name}" in blueprint.SERIES:
                self._put(f"{group}/{name}", rerun_rows.scalars, value)

    def _joints(self, exchange: Exchange) -> None:
        joints = exchange.reply_value
        assert isinstance(joints, JointValues)
        self._series("joint", joints)
        if not self._links:
            self._build_arm()
        for placement in arm_model.place(joints):
            self._put(self._links[placement.link], rerun_rows.placements, placement)

    def _build_arm(self) -> None:
        """Draw the arm's links with the first joint values."""
        self._links[arm_model.BASE] = f"{blueprint.ARM}/{arm_model.BASE}"
        for segment in arm_model.SEGMENTS:
            self._links[segment.link] = f"{self._links[segment.parent]}/{segment.link}"
        shapes = {arm_model.BASE: arm_model.BASE_SHAPES}
        shapes |= {segment.link: segment.shapes for segment in arm_model.SEGMENTS}
        for link, entity in self._links.items():
            for number, shape in enumerate(shapes[link]):
                columns = rerun_rows.boxes if isinstance(shape, Box) else rerun_rows.cylinders
                self._put(f"{entity}/shape_{number}", columns, shape)

    def _tool_pose(self, exchange: Exchange) -> None:
        pose = exchange.reply_value
        assert isinstance(pose, Pose)
        self._series("tool", pose)
        here = (pose.x, pose.y, pose.z)
        self._put(blueprint.TOOL_NOW, rerun_rows.points, here)
        if self._tool and self._tool != here:
            self._put(blueprint.TOOL_PATH, rerun_rows.strips, (self._tool, here))
        self._tool = here

    def _inputs(self, exchange: Exchange) -> None:
        for port, bit in enumerate(reversed(exchange.reply_value), start=1):  # leftmost: 8 (L651)
            self._state(blueprint.input_lane(port), bit)

    def _outputs(self, exchange: Exchange) -> None:
        for port, bit in enumerate(reversed(exchange.reply_value), start=1):  # leftmost: 16 (L684)
            self._state(blueprint.output_lane(port), bit)

    def _output(self, exchange: Exchange) -> None:
        output = exchange.request_value
        if exchange.accepted and isinstance(output, PortValue) and output.port in _PORTS:
            self._state(blueprint.output_lane(output.port), str(output.value))

    def _analog(self, exchange: Exchange) -> None:
        if exchange.request_value in _PORTS:
            self._put(
                blueprint.analog_series(exchange.request_value),
                rerun_rows.scalars,
                exchange.reply_value,
            )

    # Functions, not bound methods: those would create a reference cycle.
    _DRAWERS: Final[Mapping[str, Callable[["RerunSink", Exchange], None]]] = {
        "get_status": _status,
        "get_running_program": _program,
        "get_motor_temperatures": _temperatures,
        "get_joint_angles": _joints,
        "get_tool_coordinates": _tool_pose,
        "get_digital_inputs": _inputs,
        "get_digital_outputs": _outputs,
        "set_digital_output": _output,
        "get_analog_input": _analog,
    }
