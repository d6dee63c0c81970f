"""What a service manager and a health check see of a recorder, and the documented service."""

import os
import re
import shutil
import socket
import subprocess
from configparser import ConfigParser
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from scaraspec_recorder.config import read_config
from scaraspec_recorder.monitoring.health import health_problems
from scaraspec_recorder.monitoring.service_manager import ALIVE, READY, notify
from scaraspec_recorder.spool import locks
from scaraspec_recorder.spool.spool import SpoolReader, note_stall

DOCS = Path(__file__).parents[3] / "docs"
UNIT = DOCS / "systemd" / "scaraspec-record.service"


@pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="needs Unix sockets")
@pytest.mark.parametrize("kind", ["path", "abstract"])
def test_states_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """As datagrams; a service manager that is gone is ignored."""
    address = str(tmp_path / "notify") if kind == "path" else f"@scaraspec-{os.getpid()}"
    monkeypatch.setenv("NOTIFY_SOCKET", address)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(address.replace("@", "\0"))
        notify(READY)
        notify(ALIVE)
        assert [listening.recv(100) for _ in "ab"] == [b"READY=1", b"WATCHDOG=1"]
    notify(ALIVE)


def test_without_a_service_manager(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is reported."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notify(READY)


def test_the_health_of_a_recorder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It writes, does not write, or is not there. The check creates nothing."""
    monkeypatch.setattr(locks, "_MEMORY", tmp_path / "memory")
    out = tmp_path / "captures"
    none = [f"no recorder writes into {out}"]
    assert health_problems(out) == none
    assert not out.exists()
    spool = out / ".spool"
    reader = SpoolReader(spool)
    assert health_problems(out) == none  # it is only starting
    reader.acknowledge({"progress": {"a2c": {}, "c2a": {}, "unreached": "refused"}})
    now_s = (spool / "checkpoint.json").stat().st_mtime
    assert health_problems(out, lambda: now_s + 2) == []
    assert health_problems(out, lambda: now_s + 9) == ["nothing was written for 9 s, 0 bytes wait"]
    note_stall(spool, 1, "No space left on device")
    assert health_problems(out) == ["writing is stalled: No space left on device"]
    progress = {"a2c": {}, "c2a": {}, "problems": ["McapSink is disabled"]}
    reader.acknowledge({"progress": progress})
    assert health_problems(out) == ["McapSink is disabled"]
    reader.close()


def test_the_documented_task_of_windows() -> None:
    """It has no time limit, starts again after a failure, and reads a configuration."""
    task = ET.parse(DOCS / "windows-task" / "scaraspec-record.xml")
    texts = {element.tag.partition("}")[2]: element.text for element in task.iter()}
    assert (texts["ExecutionTimeLimit"], texts["Interval"]) == ("PT0S", "PT1M")
    folder = texts["WorkingDirectory"]
    assert texts["Arguments"] == f"record --config {folder}\\record.toml"
    assert f"`{folder}\\record.toml`" in (DOCS / "windows.md").read_text("utf-8")


def test_the_documented_service() -> None:
    """Its configuration is valid, and its command has the path of this configuration."""
    unit = ConfigParser(interpolation=None)
    unit.optionxform = str  # type: ignore[assignment, method-assign]  # the documented way
    unit.read_string(UNIT.read_text("utf-8"))
    command = unit["Service"]["ExecStart"]
    assert command.endswith(" record --config /etc/scaraspec/record.toml")
    assert unit["Service"]["Type"] == "notify"
    third, fourth = read_config(DOCS / "systemd" / "record.toml")
    assert str(third.out).startswith("/var/lib/" + unit["Service"]["StateDirectory"])
    assert (third.name, fourth.name, len(third.listen)) == ("line-3", "line-4", 2)


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="needs systemd")
def test_the_documented_unit_is_valid() -> None:
    """Only the program is not installed here."""
    command = ["systemd-analyze", "verify", str(UNIT)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    lines = [line for line in done.stderr.splitlines() if UNIT.name in line]
    assert [line for line in lines if "is not executable" not in line] == []


def test_the_documented_lines_of_the_log() -> None:
    """They are in the source."""
    package = DOCS.parent / "recorder" / "scaraspec_recorder"
    source = "".join(path.read_text("utf-8") for path in package.rglob("*.py"))
    page = (DOCS / "record.md").read_text("utf-8")
    table = page.split("These lines of the log are stable")[1].split("\n## ")[0]
    lines = re.findall(r"^\| `(?:NAME: )?([^`]+)`", table, re.MULTILINE)
    assert len(lines) > 8
    for line in lines:
        fixed = max(re.split(r"\b[A-Z]{2,}\b|\bN\b|…|: |forward", line), key=len).strip()
        if not fixed.startswith(("recording", "to")):
            assert fixed in source, line
