"""`scaraspec archive` with captures and archive on an S3 server, judged by Dask workers.

Run by `make test-archive`: these tests start the servers, on loopback.
"""

import csv
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import fsspec  # type: ignore[import-untyped]  # it ships no types
import pytest
from botocore.exceptions import EndpointConnectionError  # type: ignore[import-untyped]  # it ships no types

from scaraspec.api.auditing import audit
from scaraspec.client import Client
from scaraspec.judge.verdicts import Verdict
from scaraspec_recorder.recordings.upload_store import Pace, UploadStore

pytestmark = pytest.mark.archive

_REPOSITORY = Path(__file__).parents[3]
_FIELD = _REPOSITORY / "fixtures" / "captures" / "field"
_GOOD = ("plant-a-morning-shift", "plant-a-torn", "complaint-1", "complaint-2", "complaint-4")
_ROBOTS = 4
_LIMIT_S = 120
_BIN = Path(sys.executable).parent
_QUERY = re.compile(r"^scaraspec archive query s3://robots/archive \"(.*)\"$", re.MULTILINE)


class Server:
    """A process that prints lines.

    Args:
        command: The program in the virtual environment, and its arguments.
    """

    def __init__(self, *command: str) -> None:
        self._lines = SimpleQueue[str]()
        self.process = subprocess.Popen(
            [_BIN / command[0], *command[1:]],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout
        with self.process.stdout as output:
            for line in output:
                self._lines.put(line)

    def until(self, pattern: str) -> str:
        """Wait for a line with this pattern; return its first group, or the match."""
        while not (found := re.search(pattern, self._lines.get(timeout=_LIMIT_S))):
            pass
        return found[found.re.groups and 1]

    def kill(self) -> None:
        """End the process and its children."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self._reader.join()


@pytest.fixture(scope="module")
def start() -> Iterator[Callable[..., Server]]:
    """Start a server, which ends with the tests."""
    with ExitStack() as running:

        def start(*command: str) -> Server:
            server = Server(*command)
            running.callback(server.kill)
            return server

        yield start


def start_scheduler(start: Callable[..., Server]) -> tuple[Server, str]:
    """Start a Dask scheduler; return it and its URL."""
    server = start("dask", "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    return server, server.until(r"Scheduler at: *(tcp://[\d.:]+)")


def start_workers(start: Callable[..., Server], url: str, *options: str) -> Server:
    """Start Dask workers."""
    common = ("--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard")
    server = start("dask", "worker", url, *common, *options)
    server.until("Registered to")
    return server


@pytest.fixture(scope="module")
def cloud(start: Callable[..., Server]) -> Iterator[Any]:
    """The bucket `robots` on an S3 server, as an fsspec file system."""
    import s3fs  # type: ignore[import-untyped]  # noqa: PLC0415 - it ships no types; only these tests need it

    server = start("moto_server", "--host", "127.0.0.1", "--port", "0")
    url = server.until(r"Running on (http://[\d.:]+)")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {
            "AWS_ENDPOINT_URL": url,
            "AWS_ACCESS_KEY_ID": "key",
            "AWS_SECRET_ACCESS_KEY": "secret",
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():
            patch.setenv(name, value)
        cloud = s3fs.S3FileSystem()
        cloud.mkdir("robots")
        yield cloud


@pytest.fixture(scope="module")
def scheduler(cloud: Any, start: Callable[..., Server]) -> str:  # noqa: ARG001 - the workers need its environment
    """The URL of a Dask scheduler with two worker processes."""
    _, url = start_scheduler(start)
    start_workers(start, url, "--nworkers", "2", "--memory-limit", "1GiB").until("Registered to")
    return url


def run(*arguments: str, status: int = 0) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [_BIN / "scaraspec", "archive", *arguments],
        capture_output=True,
        text=True,
        timeout=_LIMIT_S,
        check=False,
    )
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


def begin_build(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [_BIN / "scaraspec", "archive", "build", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def rows(sql: str) -> list[dict[str, str]]:
    out = run("query", "s3://robots/archive", sql, "--csv").stdout
    return list(csv.DictReader(io.StringIO(out)))


@pytest.fixture(scope="module")
def built(cloud: Any, scheduler: str) -> str:
    """What a build prints while one of the workers is killed."""
    for number in range(37):
        name = _GOOD[number % len(_GOOD)]
        at = f"robots/captures/line-{number % _ROBOTS}/{number:02}-{name}.pcapng"
        cloud.put_file(f"{_FIELD / name}.pcapng", at)
    whole = (_FIELD / "plant-a-morning-shift.pcapng").read_bytes()
    cloud.pipe_file("robots/captures/line-0/torn.pcapng", whole[:-1000])
    cloud.pipe_file("robots/captures/line-0/corrupt.pcap", bytes(range(256)))
    cloud.pipe_file("robots/captures/line-0/empty.mcap", b"")
    build = begin_build(
        "s3://robots/captures", "--to", "s3://robots/archive", "--scheduler", scheduler
    )
    ends_s = time.monotonic() + _LIMIT_S
    while len(cloud.glob("robots/archive/files/*/*/*")) < 3:
        assert time.monotonic() < ends_s
        cloud.invalidate_cache()
    os.kill(_worker_processes()[0], signal.SIGKILL)
    out, _ = build.communicate(timeout=_LIMIT_S)
    assert build.returncode == 3
    return str(out)


def _worker_processes() -> list[int]:
    """The processes of the workers: the children of the nanny that listen for tasks."""
    nannies = [
        int(entry.name)
        for entry in Path("/proc").iterdir()
        if entry.name.isdigit() and b"dask\0worker" in _read(entry / "cmdline")
    ]
    children = [
        int(child)
        for pid in nannies
        for task in Path(f"/proc/{pid}/task").iterdir()
        for child in _read(task / "children").split()
    ]
    found = [pid for pid in children if b"spawn_main" in _read(Path(f"/proc/{pid}/cmdline"))]
    assert found
    return found


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""


def test_nothing_is_lost_or_doubled(built: str) -> None:
    """Every capture has one row, although a worker was killed."""
    assert built == (
        "40 captures: 0 unchanged, 9 inconclusive, 8 no-violation-found, 21 nonconformant, "
        "2 unreadable\n"
    )
    files = rows("FROM files")
    assert len(files) == 40
    assert len({row["file"] for row in files}) == 40
    assert Counter(row["robot"] for row in files)["line-0"] == 13


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("name", _GOOD)
def test_findings_are_those_of_audit(name: str) -> None:
    results, _ = audit(_FIELD / f"{name}.pcapng", port=8877)
    expected = {
        (case.requirements[0], case.verdict.value)
        for case in results.cases
        if case.verdict not in (Verdict.PASS, Verdict.NONE)
    }
    found = rows(f"FROM findings WHERE file LIKE '%-{name}.pcapng'")
    assert {(row["requirement"], row["verdict"]) for row in found} == expected
    per_file = Counter((row["file"], row["requirement"], row["message"]) for row in found)
    exchanges = rows(
        f"SELECT file, count(*) AS n FROM exchanges WHERE file LIKE '%-{name}.pcapng' GROUP BY ALL"
    )
    assert len({row["n"] for row in exchanges}) == 1
    assert len({key[1:] for key in per_file}) * len(exchanges) == len(per_file)


@pytest.mark.usefixtures("built")
def test_a_second_build_does_nothing(scheduler: str) -> None:
    done = run(
        *("build", "s3://robots/captures", "--to", "s3://robots/archive"),
        *("--scheduler", scheduler),
    )
    assert done.stdout == "40 captures: 40 unchanged\n"


@pytest.mark.usefixtures("built")
def test_the_queries_of_the_documentation() -> None:
    """Each query in docs/archive.md returns rows."""
    queries = _QUERY.findall((_REPOSITORY / "docs" / "archive.md").read_text("utf-8"))
    assert len(queries) >= 5
    for query in queries:
        assert rows(query), query


@pytest.mark.usefixtures("built")
def test_the_report(tmp_path: Path) -> None:
    page = tmp_path / "archive.html"
    run("report", "s3://robots/archive", "--out", str(page))
    assert "s3://robots/captures/line-0/corrupt.pcap" in page.read_text("utf-8")


def test_an_object_storage_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sentence for each command."""
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "key")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    for arguments in (
        ("query", "s3://robots/a", "FROM files"),
        ("build", "s3://robots", "--to", "x"),
    ):
        errors = run(*arguments, status=2).stderr
        assert "cannot be used: Could not connect to the endpoint URL" in errors
        assert errors.count("\n") == 1


@pytest.mark.usefixtures("cloud")
def test_a_recording_is_uploaded(processes: Any, tmp_path: Path) -> None:
    """An archive is built from the uploaded files."""
    url = "tcp://{}:{}".format(*processes.controller("--password", "secret"))
    out, store = tmp_path / "out", f"{tmp_path / 'archive'}"
    options = ("--listen", "127.0.0.1:0", "--out", f"{out}", "--archive", "s3://robots/uploads")
    recorder = processes.start("record", url, *options, "--no-rrd", "--rotate", "1h")
    with Client(f"tcp://{recorder.stdout.readline().split()[1]}", password="secret") as robot:
        robot.get_status()
    recorder.send_signal(signal.SIGINT)
    printed, _ = recorder.communicate(timeout=_LIMIT_S)
    assert recorder.returncode == 0, printed
    assert "files in s3://robots/uploads: 1" in printed
    run("build", "s3://robots/uploads", "--to", store)
    (capture,) = out.glob("*.mcap")
    at = f"s3://robots/uploads/127.0.0.1/{capture.name[:10]}/{capture.name}"
    found = run("query", store, "SELECT robot, file FROM files", "--csv").stdout
    assert found.splitlines()[1:] == [f"127.0.0.1,{at}"]


def test_an_interrupted_upload(cloud: Any, tmp_path: Path) -> None:
    """The bucket has nothing of it, not even a part of an object."""
    capture = tmp_path / "2026-11-20T23-59-59Z_line-3.mcap"
    capture.write_bytes(bytes(20_000_000))
    key = f"robots/interrupted/line-3/2026-11-20/{capture.name}"
    store = UploadStore("s3://robots/interrupted", "token", Pace(10**12), _interrupt_after(60))
    with pytest.raises(InterruptedError):
        store.put(capture, "line-3")
    cloud.invalidate_cache()
    assert not cloud.exists(key)
    assert not cloud.list_multipart_uploads("robots")
    whole = UploadStore("s3://robots/interrupted", "token", Pace(10**12))
    for _ in range(2):
        assert whole.put(capture, "line-3") == (f"s3://{key}", False)
    cloud.pipe_file(key, b"other")
    stored, renamed = whole.put(capture, "line-3")
    assert renamed
    assert (cloud.cat_file(key), cloud.cat_file(stored)) == (b"other", capture.read_bytes())


def _interrupt_after(pieces: int) -> Callable[[], None]:
    left = iter(range(pieces))

    def interrupt() -> None:
        if next(left, None) is None:
            raise InterruptedError

    return interrupt


def test_a_store_that_ends_during_an_upload(
    start: Callable[..., Server], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error is reported after the attempts of the library."""
    server = start("moto_server", "--host", "127.0.0.1", "--port", "0")
    monkeypatch.setenv("AWS_ENDPOINT_URL", server.until(r"Running on (http://[\d.:]+)"))
    fsspec.filesystem("s3", skip_instance_cache=True).mkdir("robots")
    capture = tmp_path / "2026-11-20T23-59-59Z_line-3.mcap"
    capture.write_bytes(bytes(20_000_000))
    left = iter(range(60))

    def end_server() -> None:
        if next(left, None) is None:
            server.kill()

    fsspec.filesystem("s3").clear_instance_cache()
    store = UploadStore("s3://robots", "token", Pace(10**12), end_server)
    with pytest.raises(EndpointConnectionError):
        store.put(capture, "line-3")


@pytest.fixture
def captures(tmp_path: Path) -> Path:
    """A folder with many captures."""
    folder = tmp_path / "captures"
    folder.mkdir()
    for number in range(20):
        for name in _GOOD:
            shutil.copy(_FIELD / f"{name}.pcapng", folder / f"{number}-{name}.pcapng")
    return folder


def test_a_scheduler_that_is_not_there(captures: Path, tmp_path: Path) -> None:
    """One sentence, and the archive is empty."""
    store = tmp_path / "store"
    refused = ("build", f"{captures}", "--to", f"{store}", "--scheduler", "tcp://127.0.0.1:9")
    assert "tcp://127.0.0.1:9 cannot be reached" in run(*refused, status=2).stderr
    assert [path.name for path in store.iterdir()] == ["scaraspec-archive.json"]


def test_a_scheduler_that_ends(
    captures: Path, tmp_path: Path, start: Callable[..., Server]
) -> None:
    """One sentence; the next build archives the rest."""
    server, url = start_scheduler(start)
    start_workers(start, url)
    store = tmp_path / "store"
    build = begin_build(f"{captures}", "--to", f"{store}", "--scheduler", url)
    ends_s = time.monotonic() + _LIMIT_S
    while not list(store.glob("files/*/*/*.parquet")):
        assert time.monotonic() < ends_s
    server.kill()
    _, errors = build.communicate(timeout=_LIMIT_S)
    assert build.returncode == 2
    assert f"{url} has ended: start the build again" in errors
    assert "Traceback" not in errors
    run("build", f"{captures}", "--to", f"{store}")
    count = "SELECT count(*), count(DISTINCT file) FROM files"
    assert run("query", f"{store}", count, "--csv").stdout.splitlines()[1] == "100,100"


def test_workers_without_memory(
    captures: Path, tmp_path: Path, start: Callable[..., Server]
) -> None:
    """The build does not wait forever."""
    _, url = start_scheduler(start)
    start_workers(start, url, "--no-nanny", "--memory-limit", "100MB")
    done = run(
        "build", f"{captures}", "--to", f"{tmp_path / 'store'}", "--scheduler", url, status=2
    )
    assert "all workers of the scheduler are paused" in done.stderr


def test_a_process_that_is_killed(tmp_path: Path) -> None:
    """Without Dask: the capture whose process was killed has a row with this reason."""
    captures, store = tmp_path / "captures", f"{tmp_path / 'store'}"
    captures.mkdir()
    shutil.copy(_FIELD / "complaint-3.pcapng", captures)
    build = begin_build(f"{captures}", "--to", store, "--jobs", "1")
    ends_s = time.monotonic() + _LIMIT_S
    while not (judging := [pid for pid in _children(build.pid) if _judges(pid)]):
        assert time.monotonic() < ends_s
    os.kill(judging[0], signal.SIGKILL)
    out, _ = build.communicate(timeout=_LIMIT_S)
    assert (build.returncode, out) == (3, "1 capture: 0 unchanged, 1 unreadable\n")
    shown = run("query", store, "SELECT notes FROM files").stdout
    assert "the process that judged it was killed" in shown


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task")
    return [
        int(child)
        for task in (tasks.iterdir() if tasks.exists() else ())
        for child in _read(task / "children").split()
    ]


def _judges(pid: int) -> bool:
    return b"spawn_main" in _read(Path(f"/proc/{pid}/cmdline"))
