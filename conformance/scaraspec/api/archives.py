"""Archives: judges many captures and stores their tables, which are then queried with SQL."""

import logging
import multiprocessing
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from datetime import date
from functools import partial
from importlib import import_module
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple
from urllib.parse import unquote

from scaraspec.api.auditing import audit
from scaraspec.api.audits import is_capture
from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.report.files import write_whole
from scaraspec.report.model import Tool
from scaraspec.tables.archive.errors import ArchiveError
from scaraspec.tables.archive.query import query
from scaraspec.tables.archive.report import render
from scaraspec.tables.archive.store import ARCHIVED, PartName, Store, Stored, download, find_sources
from scaraspec.tables.files import TableFolder
from scaraspec.tables.rows import RowBuilder
from scaraspec.tables.schema import FileRow
from scaraspec.traffic.events import TrafficEvent
from scaraspec.translation import Language
from scaraspec.user_message import UserMessage
from scaraspec_recorder.child_process import ignore_signals
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.upload_store import SHA256
from scaraspec_recorder.sinks.file_names import is_recording_name

UNREADABLE: Final = "unreadable"
"""The verdict about a capture that could not be judged; `notes` has the reason."""

_ROBOT_OF: Final = re.compile(r"[^_]+_(.*)\.mcap")
_UPLOADED: Final = re.compile(
    rf"(?P<robot>[^/]+)/(?P<day>[\d-]{{10}})/({SHA256}/)?(?P=day)T[^/_]+_(?P=robot)(-\d+)?\.mcap$"
)
_KILLED: Final = "the process that judged it was killed, perhaps because it needed too much memory"
_PAUSED_CHECKS: Final = 3
_CHECK_S: Final = 10.0


class Archived(NamedTuple):
    """What became of one capture.

    Attributes:
        url: Its path or URL.
        verdict: The verdict; `unreadable` if it could not be judged.
        reason: Why it could not be judged; else empty.
        stored: Whether the archive has it now.
    """

    url: str
    verdict: str
    reason: str = ""
    stored: bool = True


class _Task(NamedTuple):
    """Judges and stores one capture; another process runs it."""

    name: PartName
    store: str
    earlier: tuple[str, ...]
    port: int | None

    @property
    def url(self) -> str:
        """The capture."""
        return self.name.source.url


class Build(NamedTuple):
    """What a build does.

    Attributes:
        total: The number of captures.
        unchanged: How many of them are in the archive already.
        archived: Yields the others, each when it is stored.
    """

    total: int
    unchanged: int
    archived: Iterator[Archived]


def build_archive(  # noqa: PLR0913 - independent options
    sources: Sequence[str],
    store: str,
    *,
    robot: str = "",
    port: int | None = DEFAULT_PORT,
    jobs: int = 0,
    scheduler: str = "",
) -> Build:
    """Judge captures, and store their tables in an archive.

    A capture is judged again only if it, the options or the version of scaraspec have changed. Each
    file is judged by itself. Captures that no longer exist stay in the archive.

    Args:
        sources: Files, folders and patterns: paths, or URLs that fsspec knows.
        store: The archive, which is created if it does not exist.
        robot: The robot of all captures. Empty for the name in the file name of a recording, or of
            the folder that has the capture.
        port: The controller's TCP port in packet captures; None for all connections of this
            protocol.
        jobs: The number of processes; 0 for one for each processor.
        scheduler: The address of a Dask scheduler, such as ``tcp://10.0.0.1:8786``, whose workers
            judge the captures; they must reach `sources` and `store` by the same names.

    Raises:
        ArchiveError: A source or the store cannot be used.
        ImportError: The extra `archive` is not installed.
    """
    found = [*find_sources(sources, is_capture)]
    stored = Store(store, create=True).stored()
    options = {"port": f"{port}", "robot": robot, "version": f"{Tool.own().version}"}
    tasks = []
    for source in found:
        name = PartName(source, source.state(options), robot or _robot_of(source.url))
        earlier = stored.get(source.key, Stored())
        if name.state not in earlier.states:
            tasks.append(_Task(name, store, tuple(earlier.parts), port))
    run = partial(_on_dask, scheduler=scheduler) if scheduler else partial(_in_processes, jobs=jobs)
    return Build(len(found), len(found) - len(tasks), run(tasks))


def _robot_of(url: str) -> str:
    path = PurePosixPath(url)
    if uploaded := _UPLOADED.search(url):
        return uploaded["robot"]
    named = _ROBOT_OF.fullmatch(path.name) if is_recording_name(path.name) else None
    return named[1] if named else unquote(path.parent.name) or "robot"


def _archive(task: _Task) -> Archived:
    """Judge the capture of a task and store its tables."""
    with TemporaryDirectory(prefix="scaraspec-archive-") as name:
        reason, folder = "", Path(name, "judged")
        try:
            file = _write_tables(task, folder)
        except (CaptureError, ArchiveError) as error:
            reason, folder = f"{error}", Path(name, "unread")
            file = _write_unread(task, folder, reason)
        return _store(task, file, folder, reason)


def _archive_killed(task: _Task) -> Archived:
    """Store that the process which judged the capture was killed."""
    with TemporaryDirectory(prefix="scaraspec-archive-") as name:
        file = _write_unread(task, Path(name), _KILLED)
        return _store(task, file, Path(name), _KILLED)


def _store(task: _Task, file: FileRow, folder: Path, reason: str) -> Archived:
    try:
        Store(task.store).put(task.name, file, folder, task.earlier)
    except ArchiveError as error:
        return Archived(file.file, f"{file.verdict}", f"{error}", stored=False)
    return Archived(file.file, f"{file.verdict}", reason)


def _write_tables(task: _Task, folder: Path) -> FileRow:
    """Judge a capture and write its tables; return its row in `files`.

    Raises:
        CaptureError: The capture cannot be read.
        ArchiveError: It cannot be copied to this machine.
    """
    builder = RowBuilder(task.url)
    with (
        TemporaryDirectory(prefix="scaraspec-archive-") as copies,
        closing(TableFolder(folder, "parquet", ARCHIVED)) as tables,
    ):

        def write(item: TrafficEvent | Finding) -> None:
            if row := builder.take(item):
                tables.add(row)

        path = Path(download(task.name.source, copies))
        results, notes = audit(path, port=task.port, observe=write)
        whole = not (results.session and results.session.incomplete)
        verdict = results.verdict.value
        *sessions, file = builder.finish(results.session, whole=whole, notes=notes, verdict=verdict)
        for row in (*sessions, file):
            tables.add(row)
    assert isinstance(file, FileRow)
    return file


def _write_unread(task: _Task, folder: Path, reason: str) -> FileRow:
    """Write the tables of a capture that was not judged; return its row in `files`."""
    file = FileRow(
        file=task.url,
        begun_ns=None,
        ended_ns=None,
        whole=False,
        notes=reason,
        verdict=UNREADABLE,
    )
    with closing(TableFolder(folder, "parquet", ARCHIVED)) as tables:
        tables.add(file)
    return file


def _in_processes(tasks: Sequence[_Task], jobs: int) -> Iterator[Archived]:
    """Run tasks in processes of this machine; yield each result.

    If a process is killed, the rest runs one by one until it is known whose process it was.
    """
    left = dict.fromkeys(tasks)
    jobs = min(jobs or os.cpu_count() or 1, len(tasks))
    one_by_one = jobs == 1
    while left:
        try:
            for task, result in _pool_results([*left], 1 if one_by_one else jobs):
                del left[task]
                yield result
        except BrokenProcessPool:
            if one_by_one:
                killed = next(iter(left))
                del left[killed]
                yield _archive_killed(killed)
            one_by_one = not one_by_one or jobs == 1


def _pool_results(tasks: Sequence[_Task], jobs: int) -> Iterator[tuple[_Task, Archived]]:
    # Forking would copy the threads of the caller.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=ignore_signals) as pool:
        try:
            if jobs == 1:
                for task in tasks:
                    yield task, pool.submit(_archive, task).result()
                return
            futures: dict[Future[Archived], _Task] = {
                pool.submit(_archive, task): task for task in tasks
            }
            for future in as_completed(futures):
                yield futures[future], future.result()
        except (KeyboardInterrupt, GeneratorExit):
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.kill()
            raise


def _on_dask(tasks: Sequence[_Task], scheduler: str) -> Iterator[Archived]:
    """Run tasks on the workers of a Dask scheduler; yield each result.

    Raises:
        ArchiveError: The scheduler cannot be reached or has ended, or all its workers are paused.
        ImportError: Dask is not installed.
    """
    if not tasks:
        return
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise ImportError("--scheduler needs the extra: pip install 'scaraspec[dask]'") from None
    # It logs tracebacks of what is reported in one sentence here; each of its loggers has a level.
    for name in [*logging.root.manager.loggerDict]:
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(scheduler, timeout=_CHECK_S)
    except (OSError, ValueError) as error:
        raise ArchiveError(
            UserMessage("{scheduler} cannot be reached: {error}", scheduler=scheduler, error=error)
        ) from None
    with client:
        try:
            yield from _dask_results(distributed, client, tasks)
        except CancelledError:
            raise ArchiveError(
                UserMessage("{scheduler} has ended: start the build again", scheduler=scheduler)
            ) from None


def _dask_results(distributed: Any, client: Any, tasks: Sequence[_Task]) -> Iterator[Archived]:
    """Submit tasks, and yield each result.

    Raises:
        ArchiveError: All workers are paused.
        CancelledError: The scheduler has ended.
    """
    paused = 0
    pending = {client.submit(_archive, task, pure=False): task for task in tasks}
    while pending:
        try:
            done, _ = distributed.wait([*pending], timeout=_CHECK_S, return_when="FIRST_COMPLETED")
        except TimeoutError:
            paused = paused + 1 if _all_paused(client) else 0
            if paused == _PAUSED_CHECKS:
                client.cancel([*pending])
                raise ArchiveError(
                    "all workers of the scheduler are paused: give them more memory"
                ) from None
            continue
        for future in done:
            task = pending.pop(future)
            try:
                yield future.result()
            except distributed.KilledWorker:
                yield _archive_killed(task)


def _all_paused(client: Any) -> bool:
    workers: Mapping[str, Mapping[str, Any]] = client.scheduler_info(n_workers=-1)["workers"]
    return bool(workers) and all(each.get("status") == "paused" for each in workers.values())


def query_archive(store: str, sql: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Run a query on an archive; return the names of its columns, and its rows.

    Args:
        store: The path or URL of the archive.
        sql: A statement of DuckDB; see `scaraspec.tables.archive.query.VIEWS`.

    Raises:
        ArchiveError: The archive cannot be used, or the query is wrong.
        ImportError: The extra `archive` is not installed.
    """
    return query(Store(store), sql)


def archive_report(
    store: str, file: Path, *, since: date | None = None, language: Language | None = None
) -> None:
    """Write a page about all robots in an archive: verdicts by day, new findings, latency.

    Args:
        store: The path or URL of the archive.
        file: The page to write.
        since: Kinds of findings that first occurred on this day (UTC) or later are new. None for
            the last seven days of the archive.
        language: The language that is shown first; None for the display language.

    Raises:
        ArchiveError: The archive cannot be used, or has no capture yet.
        ImportError: The extra `archive` is not installed.
        OSError: The page cannot be written.
    """
    write_whole(file, render(Store(store), since, language))
