"""Sink of a single capture (capture.mcap, capture.rrd), and conversion of a capture to .rrd."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings.marks import with_marks
from scaraspec_recorder.recordings.recording_files import make_files, session_metadata
from scaraspec_recorder.recordings.trigger_command import TriggerCommand
from scaraspec_recorder.sinks.clock_watch import ClockWatch
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.redaction import make_redactor
from scaraspec_recorder.sinks.sink import OutputFolder


def capture_sink(  # noqa: PLR0913 - independent options
    folder: OutputFolder,
    *,
    session: Mapping[str, str] | None = None,
    needs_login: bool = True,
    draw: bool = True,
    redact: bool = False,
    triggers: tuple[str, ...] = (),
    on_trigger: tuple[str, ...] = (),
    robot: str = "",
) -> Decoder:
    """Create the sink that writes capture.mcap and capture.rrd into a folder (a `SinkFactory`).

    Args:
        folder: Output folder.
        session: Metadata of the session, such as the addresses.
        needs_login: False for a serial link (L83).
        draw: Whether to write capture.rrd too.
        redact: Whether to mask passwords in the raw bytes, too.
        triggers: Conditions that write a mark into the recording, see `triggers`.
        on_trigger: Command to run when a trigger fires; empty for none.
        robot: The robot's name, passed to the command.

    Raises:
        OSError: A file cannot be created.
        ImportError: The extra for Rerun is not installed.
    """
    metadata = {
        **session_metadata(session or {}, needs_login=needs_login, redact=redact),
        **folder.take_metadata(),
    }
    paths, outputs = make_files(folder, "capture", metadata, draw=draw, optimized=True)
    command = TriggerCommand(on_trigger, robot, lambda: paths[0]) if on_trigger else None
    marked = with_marks(outputs, triggers, folder, command)
    redactor = make_redactor(folder) if redact else None
    return Decoder(marked, Judge(needs_login=needs_login), redactor, ClockWatch())


def write_rrd(
    events: Iterable[WireEvent],
    path: Path,
    *,
    needs_login: bool = True,
    cases: Iterable[tuple[int, str]] = (),
) -> None:
    """Write an existing capture of any format to a new .rrd file.

    Args:
        events: The capture.
        path: The file.
        needs_login: False for a serial link (L83).
        cases: For the capture of a certification, the times in nanoseconds since the Unix epoch at
            which a case began, with its id, or at which it ended, with an empty text; in order.

    Raises:
        CaptureError: `events` cannot be read.
        OSError: The file cannot be written.
        ImportError: The extra for Rerun is not installed.
    """
    from scaraspec_recorder.sinks.rerun.rerun_sink import RerunSink  # noqa: PLC0415 - an optional extra

    sink = RerunSink.to_file(path)
    sink.draw_cases(cases)
    decoder = Decoder([sink], Judge(needs_login=needs_login))
    for event in events:
        decoder.write(event)
    decoder.close()
