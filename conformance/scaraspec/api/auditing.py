"""Audit: judges a capture file and returns the results."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Conclusion
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.report.audit import from_audit
from scaraspec.report.model import Results, Role, Subject
from scaraspec.report.session import SessionStats
from scaraspec_recorder.sources.capture import McapCapture, open_capture

_EVENTS_PER_UPDATE: Final = 1000


def audit(
    file: Path,
    *,
    dialect: Dialect = DEFAULT,
    port: int | None = None,
    serial: bool = False,
    progress: Callable[[int], None] = lambda _count: None,
) -> tuple[Results, tuple[str, ...]]:
    """Judge a capture: an MCAP recording, or a pcap or pcapng of any client and controller.

    Args:
        file: The capture.
        dialect: The readings that the controller claims.
        port: The controller's TCP port in packet captures; None for all connections.
        serial: Whether the link was serial (L83), even if the file does not state it.
        progress: Called from time to time with the number of events judged so far.

    Returns:
        The results, and one sentence for each defect of the file. If the file's byte counts are
        wrong, the results are inconclusive at best.

    Raises:
        CaptureError: The file cannot be read.
    """
    capture = open_capture(file, port=port)
    needs_login = capture.needs_login and not serial
    judge, stats = Judge(dialect, needs_login=needs_login), SessionStats()
    for number, event in enumerate(capture):
        for item in judge.feed(event):
            stats.add(item)
        if number % _EVENTS_PER_UPDATE == 0:
            progress(number)
    for item in judge.close():
        stats.add(item)
    results = from_audit(
        judge,
        stats,
        subject=Subject(Role.CAPTURE, file=str(file)),
        claims=dialect.differences(),
        replay=f"scaraspec audit {file}",
    )
    counts_match = not (isinstance(capture, McapCapture) and capture.summary.wrong_accounts)
    if not counts_match and results.verdict is not Conclusion.NONCONFORMANT:
        results = replace(results, verdict=Conclusion.INCONCLUSIVE)
    has_frames = results.session and results.session.frames
    if results.verdict.good and not has_frames:
        results = replace(results, verdict=Conclusion.NOTHING_TESTED)
    return results, tuple(capture.summary.notes)
