"""Audits of several captures: finds the files, and judges several at the same time."""

import multiprocessing
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from glob import glob
from pathlib import Path
from typing import Any, Final, NamedTuple

from scaraspec.operating_system import join_command
from scaraspec.report.model import Results
from scaraspec.user_message import UserMessage, sentence_of
from scaraspec_recorder.child_process import ignore_signals
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sources.joined import recordings

_SUFFIXES: Final = (".mcap", ".pcap", ".pcapng", ".cap")
_PACKED: Final = (".gz", ".zst")


class AuditedCapture(NamedTuple):
    """What was found in one capture.

    Attributes:
        files: The files of the capture.
        results: The results; None if it was not judged.
        notes: What is missing or unusual in the files.
        error: Why it was not judged; empty if it was.
    """

    files: tuple[Path, ...]
    results: Results | None
    notes: tuple[str, ...] = ()
    error: str = ""

    @property
    def title(self) -> str:
        """The files, in short."""
        from scaraspec.api.auditing import title_of  # noqa: PLC0415 - imports the MCAP writer

        return title_of(self.files)


def find_captures(paths: Iterable[Path]) -> list[tuple[Path, ...]]:
    """Return the captures in files, folders and patterns such as ``line-*/*.mcap``.

    A folder stands for the captures in it and in its subfolders: MCAP, pcap and pcapng, also
    compressed. Files of one recording that continue each other are joined, see `recordings`.

    Args:
        paths: The files, folders and patterns.

    Returns:
        For each capture its files in the order of time.

    Raises:
        CaptureError: A folder or pattern has no capture.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            files = sorted(
                file for file in path.rglob("*") if file.is_file() and is_capture(file.name)
            )
        elif path.exists() or not any(char in f"{path}" for char in "*?["):
            files = [path]
        else:
            files = sorted(Path(name) for name in glob(f"{path}", recursive=True))  # noqa: PTH207 - absolute patterns, too
        if not files:
            raise CaptureError(
                UserMessage("{path} has no capture: no .mcap, .pcap, .pcapng or .cap", path=path)
            )
        found |= dict.fromkeys(files)
    return recordings(found)


def is_capture(name: str) -> bool:
    """Whether a file has the name of a capture: MCAP, pcap or pcapng, also compressed."""
    path = Path(name.lower())
    return (path.with_suffix("") if path.suffix in _PACKED else path).suffix in _SUFFIXES


def audit_all(
    captures: Sequence[tuple[Path, ...]],
    *,
    jobs: int = 0,
    arguments: Sequence[str] = (),
    **options: Any,
) -> Iterator[AuditedCapture]:
    """Judge several captures; yield each when it is judged.

    After KeyboardInterrupt (Ctrl-C) the captures that are not judged yet are yielded with an error.

    Args:
        captures: The files of each capture, see `find_captures`.
        jobs: The number of processes; 0 for one for each processor.
        arguments: The options of ``scaraspec audit`` that repeat the audit of one capture.
        options: Other arguments of `audit`.
    """
    jobs = min(jobs or os.cpu_count() or 1, len(captures))
    # Forking would copy the threads of the caller.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=ignore_signals) as pool:
        pending = {pool.submit(_audited, files, arguments, options): files for files in captures}
        try:
            for future in as_completed([*pending]):
                yield _result_of(future, pending.pop(future))
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.kill()
            for files in pending.values():
                yield AuditedCapture(files, None, error="interrupted")


def _audited(
    files: tuple[Path, ...], arguments: Sequence[str], options: Mapping[str, Any]
) -> AuditedCapture:
    from scaraspec.api.auditing import audit  # noqa: PLC0415 - imports the MCAP writer

    reproduction = join_command(["scaraspec", "audit", *map(str, files), *arguments])
    try:
        return AuditedCapture(files, *audit(files, reproduction=reproduction, **options))
    except CaptureError as error:
        return AuditedCapture(files, None, error=sentence_of(error))


def _result_of(future: Future[AuditedCapture], files: tuple[Path, ...]) -> AuditedCapture:
    try:
        return future.result()
    except BrokenProcessPool:
        return AuditedCapture(files, None, error="the process that judged it was killed")
