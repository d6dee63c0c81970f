"""Judge a capture file, for `scaraspec audit` and `scaraspec demo`."""

from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, TextColumn, TimeElapsedColumn

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Conclusion
from scaraspec.protocol.readings import Dialect
from scaraspec.report.audit import from_audit
from scaraspec.report.model import Results, Role, Subject
from scaraspec.report.session import SessionStats
from scaraspec_recorder.sources.capture import McapCapture, open_capture

_EVENTS_PER_UPDATE = 1000


def audit(
    file: Path, *, dialect: Dialect, port: int | None, serial: bool = False
) -> tuple[Results, tuple[str, ...]]:
    """Judge a capture.

    Args:
        file: The capture.
        dialect: The readings that the controller claims.
        port: The controller's TCP port in packet captures; None for all connections.
        serial: Whether the link was serial (L83), even if the file does not state it.

    Returns:
        The results, and one sentence for each defect of the file. If the file's byte counts are
        wrong, the results are inconclusive at best.

    Raises:
        CaptureError: The file cannot be read.
    """
    capture = open_capture(file, port=port)
    needs_login = capture.needs_login and not serial
    judge, stats = Judge(dialect, needs_login=needs_login), SessionStats()
    columns = (TextColumn("judging {task.completed} events"), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("judging", total=None)
        for number, event in enumerate(capture):
            for item in judge.feed(event):
                stats.add(item)
            if number % _EVENTS_PER_UPDATE == 0:
                bar.update(task, completed=number)
    for item in judge.close():
        stats.add(item)
    claims = dialect.differences()
    results = from_audit(
        judge,
        stats,
        subject=Subject(Role.CAPTURE, file=str(file)),
        claims=claims,
        replay=f"scaraspec audit {file}",
    )
    accounted = not (isinstance(capture, McapCapture) and capture.summary.wrong_accounts)
    if not accounted and results.verdict is not Conclusion.NONCONFORMANT:
        results = replace(results, verdict=Conclusion.INCONCLUSIVE)
    has_frames = results.session and results.session.frames
    if results.verdict is Conclusion.CONFORMANT and not has_frames:
        results = replace(results, verdict=Conclusion.NOTHING_TESTED)
    return results, tuple(capture.summary.notes)
