"""`scaraspec record --archive`: finished files in a folder, from which an archive is built."""

import csv
import io
import json
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from scaraspec.cli.main import group
from scaraspec.client import Client

pytestmark = pytest.mark.runs

PASSWORD = "a-secret-of-this-test"
TIMEOUT_S = 60


class Recorder:
    """A recorder of the virtual controller that uploads to a folder.

    Args:
        processes: Starts processes.
        folder: The folder of the test.
        options: Further options.
    """

    def __init__(self, processes: Any, folder: Path, *options: str) -> None:
        self.out, self.store = folder / "out", folder / "store"
        self.processes = processes
        controller = processes.controller("--password", PASSWORD)
        self.process = processes.start(
            *("record", "tcp://{}:{}".format(*controller), "--listen", "127.0.0.1:0", "--no-rrd"),
            *("--out", f"{self.out}", "--archive", f"file://{self.store}", *options),
        )
        self.address = self.process.stdout.readline().split()[1]

    def talk(self) -> None:
        """Send a request through the recorder, and wait until its file is finished."""
        before = self._finished()
        with Client(f"tcp://{self.address}", password=PASSWORD) as robot:
            robot.get_status()
        while self._finished() == before:
            assert self.process.poll() is None

    def _finished(self) -> str:
        index = self.out / "contents.jsonl"
        return index.read_text() if index.exists() else ""

    def end(self, *, status: int = 0) -> str:
        """End the recorder; return the rest of its output."""
        self.process.send_signal(signal.SIGINT)
        printed, _ = self.process.communicate(timeout=TIMEOUT_S)
        assert self.process.returncode == status, printed
        return str(printed)

    @property
    def recorded(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in self.out.glob("*.mcap")}

    @property
    def stored(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in self.store.rglob("*.mcap")}


@pytest.fixture
def recorder(processes: Any, tmp_path: Path) -> Callable[..., Recorder]:
    """Starts a recorder; the store exists."""
    (tmp_path / "store").mkdir()
    return lambda *options: Recorder(processes, tmp_path, *options)


def archive(*arguments: object) -> list[dict[str, str]]:
    done = CliRunner().invoke(group, ["archive", *map(str, arguments)])
    assert done.exit_code == 0, done.output
    return list(csv.DictReader(io.StringIO(done.stdout)))


def test_an_archive_is_built_from_the_store(
    recorder: Callable[..., Recorder], tmp_path: Path
) -> None:
    """Each connection is a file of its own, also two in one second; the robot is the same."""
    robot = recorder("--rotate", "connection")
    robot.talk()
    robot.talk()
    assert f"files in file://{robot.store}: 2" in robot.end()
    assert robot.stored == robot.recorded
    assert len(robot.stored) == 2
    assert {path.stat().st_mode & 0o777 for path in robot.store.rglob("*.mcap")} == {0o600}
    archive("build", f"file://{robot.store}", "--to", tmp_path / "archive", "--jobs", 1)
    sql = "SELECT robot, count(*) AS n FROM exchanges WHERE command = 'get_status' GROUP BY ALL"
    assert archive("query", tmp_path / "archive", sql, "--csv") == [
        {"robot": "127.0.0.1", "n": "2"}
    ]
    assert archive("query", tmp_path / "archive", "SELECT count(*) AS n FROM files", "--csv") == [
        {"n": "2"}
    ]


def test_files_are_uploaded_during_the_recording(recorder: Callable[..., Recorder]) -> None:
    """The status has their number; the files of the next connection follow."""
    robot = recorder("--rotate", "connection")
    robot.talk()
    while not robot.stored:
        assert robot.process.poll() is None
    robot.talk()
    robot.end()
    assert len(robot.stored) == 2


def test_a_store_that_is_not_there(recorder: Callable[..., Recorder]) -> None:
    """The recording goes on. The log, the health check and the summary name the reason."""
    robot = recorder("--rotate", "connection")
    robot.store.rmdir()
    robot.talk()
    reason = f"{robot.store} is not a folder: create it"
    assert any(
        "127.0.0.1: archiving fails, 1 file (" in line and reason in line
        for line in robot.process.stdout
    )
    checked = robot.processes.run("record", "--check", f"{robot.out}")
    assert checked.returncode == 3
    assert reason in checked.stdout
    robot.talk()
    printed = robot.end(status=3)
    assert f"not archived: {reason}; start the recorder again with this folder" in printed
    assert len(robot.recorded) == 2
    robot.store.mkdir()
    again = recorder_again(robot)
    again.end()
    assert again.stored == robot.recorded


def recorder_again(robot: Recorder, *options: str) -> Recorder:
    """Start another recorder with the same folders."""
    return Recorder(robot.processes, robot.out.parent, *options)


@pytest.mark.parametrize("kill", [os.killpg, os.kill])
def test_a_recorder_that_is_killed_during_an_upload(
    recorder: Callable[..., Recorder], kill: Callable[[int, int], None]
) -> None:
    """The store has no part of a file; the next recorder uploads it. If only the recorder's own
    process is killed, the upload ends, too."""
    robot = recorder("--rotate", "connection", "--archive-rate", "1b")
    robot.talk()
    while not [*robot.store.rglob("*.part")]:
        assert robot.process.poll() is None
    kill(robot.process.pid, signal.SIGKILL)
    robot.process.communicate()
    assert not robot.stored
    again = recorder_again(robot)
    again.end()
    assert again.stored == robot.recorded
    assert not [*robot.store.rglob("*.part")]


def test_the_end_of_an_upload_that_takes_long(recorder: Callable[..., Recorder]) -> None:
    """A second Ctrl-C does not wait for it."""
    robot = recorder("--rotate", "connection", "--archive-rate", "1b")
    robot.talk()
    while not [*robot.store.rglob("*.part")]:
        assert robot.process.poll() is None
    robot.process.send_signal(signal.SIGINT)
    assert any("press Ctrl-C again" in line for line in robot.process.stdout)
    printed = robot.end(status=3)
    assert "1 file (" in printed
    assert "not archived; start the recorder again with this folder" in printed
    assert not robot.stored


def test_another_file_of_the_same_name(recorder: Callable[..., Recorder], tmp_path: Path) -> None:
    """It is not overwritten; the recording gets another name, which is reported."""
    robot = recorder("--rotate", "connection")
    robot.talk()
    robot.end()
    (stored,) = robot.store.rglob("*.mcap")
    (robot.out / "archived.jsonl").unlink()
    stored.write_bytes(b"of another recorder")
    printed = recorder_again(robot).end()
    assert stored.read_bytes() == b"of another recorder"
    (other,) = {*robot.store.rglob("*.mcap")} - {stored}
    assert other.read_bytes() == robot.recorded[stored.name]
    assert f"is archived as file://{other}: the usual name is that of another file" in printed
    (line,) = map(json.loads, (robot.out / "archived.jsonl").read_text().splitlines())
    assert line["stored"] == f"file://{other}"
    archive("build", other, "--to", tmp_path / "archive", "--jobs", 1)
    sql = "SELECT robot FROM files"
    assert archive("query", tmp_path / "archive", sql, "--csv") == [{"robot": "127.0.0.1"}]


def test_retention_waits_for_the_upload(recorder: Callable[..., Recorder]) -> None:
    """The size limit removes files as soon as they are uploaded."""
    options = ("--rotate", "connection", "--keep", "1b", "--keep-until-archived")
    robot = recorder(*options)
    robot.store.rmdir()
    robot.talk()
    robot.talk()
    robot.end(status=3)
    kept = robot.recorded
    assert len(kept) == 2
    recorder_again(robot, *options).end(status=3)
    assert robot.recorded == kept
    robot.store.mkdir()
    recorder_again(robot, *options).end()
    recorder_again(robot, *options).end()
    assert not robot.recorded
    assert robot.stored == kept


def test_several_robots(processes: Any, tmp_path: Path) -> None:
    """A file of settings; each robot has a folder of its name in the store."""
    (tmp_path / "store").mkdir()
    controllers = [processes.controller("--password", PASSWORD) for _ in range(2)]
    listening = []
    for _ in controllers:
        with socket.create_server(("127.0.0.1", 0)) as free:
            listening.append("{}:{}".format(*free.getsockname()))
    tables = [
        f'[robots.line-{number}]\nurl = "tcp://{host}:{port}"\nlisten = "{where}"\n'
        for number, ((host, port), where) in enumerate(zip(controllers, listening, strict=True))
    ]
    shared = f'out = "{tmp_path / "out"}"\narchive = "{tmp_path / "store"}"\n'
    shared += 'archive-rate = "1MB"\nno-rrd = true\n'
    (tmp_path / "record.toml").write_text(shared + "".join(tables))
    recorder = processes.start("record", "--config", f"{tmp_path / 'record.toml'}")
    for _ in controllers:
        assert recorder.stdout.readline().startswith("recording ")
    for where in listening:
        with Client(f"tcp://{where}", password=PASSWORD) as robot:
            robot.get_status()
    recorder.send_signal(signal.SIGINT)
    printed, _ = recorder.communicate(timeout=TIMEOUT_S)
    assert recorder.returncode == 0, printed
    stored = sorted(path.relative_to(tmp_path / "store") for path in tmp_path.rglob("store/*/*/*"))
    assert [path.parts[0] for path in stored] == ["line-0", "line-1"]


def test_an_unknown_store(refused: Callable[..., str]) -> None:
    assert "--archive: nil://x cannot be used: " in refused(
        *("record", "tcp://127.0.0.1:9", "--archive", "nil://x")
    )
