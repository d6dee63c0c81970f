"""`scaraspec certify client` with good and bad drivers, and attended."""

import json
import os
import pty
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest

from scaraspec.report.model import Results

OWN = f"{shlex.quote(sys.executable)} -m scaraspec client-driver"


def test_the_reference_client(processes: Any, tmp_path: Path) -> None:
    """The client is conformant, all files are written, and the capture has the traffic."""
    out = tmp_path / "out"
    done = processes.run("certify", "client", "--driver", OWN, "--only", "4.8", "--out", str(out))
    assert done.returncode == 0, done.stdout + done.stderr
    results = Results.read(out / "results.json")
    assert results.verdict.value == "conformant"
    assert results.role.value == "client"
    assert {case.verdict.value for case in results.cases} == {"pass"}
    made = {file.name for file in out.iterdir()}
    assert {"capture.mcap", "report.html", "junit.xml", "ctrf.json"} <= made


def test_nothing_else_is_written(tmp_path: Path) -> None:
    """A run that draws texts leaves only its results in the folder where the user works."""
    command = ("certify", "client", "--driver", OWN, "--only", "4.1", "--out", "out")
    subprocess.run(
        [sys.executable, "-m", "scaraspec", *command],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        timeout=120,
    )
    assert [file.name for file in tmp_path.iterdir()] == ["out"]


ANSWER = """
import json
while True:
    print(json.dumps({{'id': json.loads(input())['id'], {}}}), flush=True)
"""
BAD = {
    "dies": ("raise SystemExit('no licence')", "no licence"),
    "hangs": ("import time; time.sleep(60)", "within 1 s"),
    "floods": (
        "import os\nwhile True: os.write(1, b'x' * 65536)",
        "lines that answer no operation",
    ),
    "babbles": ("while True: print([0] * 9999, flush=True)", "lines that answer no operation"),
    "lies": (ANSWER.format("'ok': True"), "the end of connect too early"),
    "lacks everything": (
        ANSWER.format("'unimplemented': True"),
        "implement the operation disconnect",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_drivers(processes: Any, tmp_path: Path, name: str) -> None:
    """Each gives one sentence, in limited time, and never a pass."""
    body, message = BAD[name]
    file = tmp_path / "driver.py"
    file.write_text(body, encoding="utf-8")
    line = f"{shlex.quote(sys.executable)} {shlex.quote(str(file))}"
    limit = ("--answer-timeout", "1") if name == "hangs" else ()
    done = processes.run("certify", "client", "--driver", line, "--only", "4.8", *limit)
    assert done.returncode in (1, 3), done.stdout + done.stderr
    assert message in done.stdout
    assert "Traceback" not in done.stderr


def test_a_missing_driver(processes: Any) -> None:
    """One sentence and exit status 2."""
    done = processes.run("certify", "client", "--driver", "/no/such/driver")
    assert done.returncode == 2
    assert "cannot be started" in done.stderr


def test_neither_driver_nor_attended(processes: Any) -> None:
    """One sentence and exit status 2."""
    done = processes.run("certify", "client", "--listen", "127.0.0.1:0")
    assert done.returncode == 2
    assert "--attended" in done.stderr


POLLS = """
import asyncio
from scaraspec.client import AsyncClient, ClientError
from scaraspec.client.driver import serve

class Polls(AsyncClient):
    async def connect(self):
        await super().connect()
        self.poller = asyncio.create_task(self.poll())

    async def poll(self):
        try:
            while True:
                await self.get_status()
                await self.get_version()
                await asyncio.sleep(0.1)
        except ClientError:
            pass

asyncio.run(serve(lambda url, password: Polls(url, password=password)))
"""


class Operator:
    """An operator who reads the terminal, operates the client, and types what it shows.

    Args:
        terminal: The terminal's other end.
    """

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal
        self._client = subprocess.Popen(
            [sys.executable, "-c", POLLS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._number = 0
        self._last: dict[str, Any] = {}
        self.seen: list[str] = []

    def work(self, leave_at: str = "") -> None:
        """Follow the requests until the terminal ends, or stop when this line is read."""
        with (
            os.fdopen(self._terminal, "r", encoding="utf-8", closefd=False) as lines,
            suppress(OSError),
        ):
            for line in map(str.strip, lines):
                self.seen.append(line)
                if leave_at and leave_at in line:
                    self._type("q")
                elif found := re.fullmatch(r"now: (\w+)(?: with (.*))?", line):
                    self._order(found[1], found[2] or "")
                elif found := re.fullmatch(r"does the client show that (.*)\? \[y/n\]", line):
                    self._type("y" if self._shows(found[1]) else "n")

    def close(self) -> None:
        self._client.communicate()

    def _type(self, text: str) -> None:
        os.write(self._terminal, f"{text}\n".encode())

    def _order(self, name: str, viewed: str) -> None:
        values: dict[str, Any] = dict(pair.split(" = ", 1) for pair in viewed.split(", ") if pair)
        for key, value in values.items():
            with suppress(ValueError):
                values[key] = int(value)
        self._number += 1
        assert self._client.stdin
        self._client.stdin.write(json.dumps({"id": self._number, "do": name, **values}) + "\n")
        self._client.stdin.flush()

    def _shows(self, sentence: str) -> bool:
        assert self._client.stdout
        while self._last.get("id") != self._number:
            self._last = json.loads(self._client.stdout.readline())
        ok, result = self._last["ok"], self._last.get("result")
        if found := re.fullmatch(r"\w+ returned (.*)", sentence):
            return ok and str(result) == found[1]
        return ok if sentence.endswith("was done") else not ok


@pytest.fixture
def attend(tmp_path: Path) -> Callable[..., tuple[int, list[str]]]:
    """Run `certify client --attended` with an operator; return status and output."""

    def sit(*arguments: str, leave_at: str = "") -> tuple[int, list[str]]:
        ours, theirs = pty.openpty()
        command = (sys.executable, "-m", "scaraspec", "certify", "client", "--attended")
        process = subprocess.Popen(
            [*command, "--listen", "127.0.0.1:0", "--out", str(tmp_path / "out"), *arguments],
            stdin=theirs,
            stdout=theirs,
            stderr=subprocess.STDOUT,
        )
        os.close(theirs)
        with closing(Operator(ours)) as operator:
            operator.work(leave_at)
        os.close(ours)
        return process.wait(60), operator.seen

    return sit


def test_attended(attend: Callable[..., tuple[int, list[str]]], tmp_path: Path) -> None:
    """The operator quits after the first steps and continues later.

    The client sends some requests periodically, without the operator.
    """
    status, read = attend("--only", "4.7,4.8", leave_at="pass 4.7/1")
    assert status == 3, read
    first = Results.read(tmp_path / "out/results.json")
    assert [case.verdict.value for case in first.cases if case.id == "4.7/1"] == ["pass"]
    status, read = attend("--only", "4.7,4.8")
    assert status == 0, read
    assert any("pass 4.8/1" in line for line in read)
    results = Results.read(tmp_path / "out/results.json")
    assert {case.verdict.value for case in results.cases} == {"pass"}
    assert {"4.7/1", "4.8/1"} <= {case.id for case in results.cases}
    assert not any("get_version" in line for line in read)
    assert (tmp_path / "out/sitting-2/capture.mcap").stat().st_size
    kept = (tmp_path / "out/results.json").read_bytes()
    status, read = attend("--only", "4.7,4.8", "--seed", "3")
    assert status == 2, read
    assert "seed was 0 and is 3" in read[-1]
    assert (tmp_path / "out/results.json").read_bytes() == kept
    assert not (tmp_path / "out/sitting-3").exists()


def test_a_folder_of_another_run(processes: Any, tmp_path: Path) -> None:
    """An attended run does not continue a run with a driver: one sentence, and nothing changes."""
    out = tmp_path / "out"
    processes.run("certify", "client", "--driver", OWN, "--only", "4.8/1", "--out", str(out))
    kept = {file: file.read_bytes() for file in out.iterdir()}
    attended = ("--listen", "127.0.0.1:0", "--attended")
    done = processes.run("certify", "client", *attended, "--only", "4.8/1", "--out", str(out))
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stderr == (
        f"scaraspec: {out} contains results of a run with other settings: attended was false and "
        "is true; continue it with the same ICS and options, or name another folder\n"
    )
    assert {file: file.read_bytes() for file in out.iterdir()} == kept
