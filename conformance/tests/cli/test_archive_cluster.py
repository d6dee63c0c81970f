"""`scaraspec archive` with captures and archive on an S3 server, judged by Dask workers.

Run by `make test-archive`: these tests start the servers, on loopback.
"""

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from scaraspec.api.auditing import audit
from scaraspec.judge.verdicts import Verdict

pytestmark = pytest.mark.archive

_REPOSITORY = Path(__file__).parents[3]
_FIELD = _REPOSITORY / "fixtures" / "captures" / "field"
_GOOD = ("plant-a-morning-shift", "plant-a-torn", "complaint-1", "complaint-2", "complaint-4")
_ROBOTS = 4
_LIMIT_S = 120
_BIN = Path(sys.executable).parent
_QUERY = re.compile(r"^scaraspec archive query s3://robots/archive \"(.*)\"$", re.MULTILINE)


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Any]]:
    """Start a server; it ends with the tests. Its output is in a file, which is returned."""
    folder = tmp_path_factory.mktemp("servers")
    with ExitStack() as running:

        def start(*command: str) -> Path:
            log = folder / f"{len(list(folder.iterdir()))}.log"
            with log.open("wb") as output:
                process = subprocess.Popen(
                    [_BIN / command[0], *command[1:]],
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    cwd=folder,
                    start_new_session=True,
                )
            running.callback(process.wait, _LIMIT_S)
            running.callback(os.killpg, process.pid, signal.SIGKILL)
            return log

        yield start


def until(text: str, log: Path, count: int = 1) -> str:
    """Wait until a server has printed this pattern so often; return its first group."""
    ends_s = time.monotonic() + _LIMIT_S
    while len(found := re.findall(text, log.read_text())) < count:
        assert time.monotonic() < ends_s, log.read_text()
        time.sleep(0.1)
    return str(found[0])


@pytest.fixture(scope="module")
def cloud(start: Callable[..., Any]) -> Iterator[Any]:
    """The bucket `robots` on an S3 server, as an fsspec file system."""
    import s3fs  # type: ignore[import-untyped]  # noqa: PLC0415 - it ships no types; only these tests need it

    log = start("moto_server", "--host", "127.0.0.1", "--port", "0")
    url = until(r"Running on (http://[\d.:]+)", log)
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
def scheduler(cloud: Any, start: Callable[..., Any]) -> tuple[str, Path]:  # noqa: ARG001 - the workers need its environment
    """The URL of a Dask scheduler with two worker processes, and the output of the workers."""
    url = until(
        r"Scheduler at: *(tcp://[\d.:]+)",
        start("dask", "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"),
    )
    workers = start(
        *("dask", "worker", url, "--host", "127.0.0.1", "--nworkers", "2", "--nthreads", "1"),
        *("--no-dashboard", "--memory-limit", "1GiB"),
    )
    until("Registered to", workers, count=2)
    return url, workers


def run(*arguments: str, status: int = 0) -> str:
    done = subprocess.run(
        [_BIN / "scaraspec", "archive", *arguments],
        capture_output=True,
        text=True,
        timeout=_LIMIT_S,
        check=False,
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout


def rows(sql: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(run("query", "s3://robots/archive", sql, "--csv"))))


@pytest.fixture(scope="module")
def built(cloud: Any, scheduler: tuple[str, Path]) -> str:
    """What a build prints while one of the workers is killed."""
    for number in range(37):
        name = _GOOD[number % len(_GOOD)]
        at = f"robots/captures/line-{number % _ROBOTS}/{number:02}-{name}.pcapng"
        cloud.put_file(f"{_FIELD / name}.pcapng", at)
    whole = (_FIELD / "plant-a-morning-shift.pcapng").read_bytes()
    cloud.pipe_file("robots/captures/line-0/torn.pcapng", whole[:-1000])
    cloud.pipe_file("robots/captures/line-0/corrupt.pcap", bytes(range(256)))
    cloud.pipe_file("robots/captures/line-0/empty.mcap", b"")
    url, log = scheduler
    build = subprocess.Popen(
        [
            *(_BIN / "scaraspec", "archive", "build", "s3://robots/captures"),
            *("--to", "s3://robots/archive", "--scheduler", url),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    ends_s = time.monotonic() + _LIMIT_S
    while len(cloud.glob("robots/archive/files/*/*/*")) < 3:
        assert time.monotonic() < ends_s
        cloud.invalidate_cache()
    worker = _worker_processes(log)[0]
    os.kill(worker, signal.SIGKILL)
    out, _ = build.communicate(timeout=_LIMIT_S)
    assert build.returncode == 3
    return str(out)


def _worker_processes(log: Path) -> list[int]:
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
    assert found, log.read_text()
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
def test_a_second_build_does_nothing(scheduler: tuple[str, Path]) -> None:
    out = run(
        *("build", "s3://robots/captures", "--to", "s3://robots/archive"),
        *("--scheduler", scheduler[0]),
    )
    assert out == "40 captures: 40 unchanged\n"


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


def test_a_scheduler_that_is_not_there(cloud: Any) -> None:
    """One sentence, and the archive is unchanged."""
    cloud.pipe_file("robots/one/line-9/a.pcapng", (_FIELD / "complaint-1.pcapng").read_bytes())
    done = subprocess.run(
        [
            *(_BIN / "scaraspec", "archive", "build", "s3://robots/one"),
            *("--to", "s3://robots/other", "--scheduler", "tcp://127.0.0.1:9"),
        ],
        capture_output=True,
        text=True,
        timeout=_LIMIT_S,
        check=False,
    )
    assert done.returncode == 2
    assert "tcp://127.0.0.1:9 cannot be reached" in done.stderr
    assert "Traceback" not in done.stderr
    cloud.invalidate_cache()
    assert json.loads(cloud.cat_file("robots/other/scaraspec-archive.json"))
    assert len(cloud.find("robots/other")) == 1


def test_a_process_that_is_killed(tmp_path: Path) -> None:
    """Without Dask: the capture whose process was killed has a row with this reason."""
    captures = tmp_path / "captures"
    captures.mkdir()
    large = (_FIELD / "complaint-3.pcapng").read_bytes()
    (captures / "complaint-3.pcapng").write_bytes(large)
    build = subprocess.Popen(
        [
            *(_BIN / "scaraspec", "archive", "build", str(captures)),
            *("--to", str(tmp_path / "store"), "--jobs", "1"),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    ends_s = time.monotonic() + _LIMIT_S
    while not (judging := [pid for pid in _children(build.pid) if _judges(pid)]):
        assert time.monotonic() < ends_s
    os.kill(judging[0], signal.SIGKILL)
    out, _ = build.communicate(timeout=_LIMIT_S)
    assert (build.returncode, out) == (3, "1 capture: 0 unchanged, 1 unreadable\n")
    shown = run("query", str(tmp_path / "store"), "SELECT notes FROM files")
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
