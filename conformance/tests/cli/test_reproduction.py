"""The last steps of a failure in words, and the script that repeats them without scaraspec."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import Results
from scaraspec.report.reproduction import script_path, steps


def repeat(script: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a script like a manufacturer without scaraspec."""
    command = [sys.executable, "-I", "-S", str(script), *arguments]
    environment = {**os.environ, "SCARASPEC_PASSWORD": "password"}
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env=environment, timeout=60
    )


def failed(processes: Any, out: Path, mutant: str, only: str) -> tuple[Results, tuple[str, int]]:
    """Certify a faulty controller; return the results and its address."""
    host, port = processes.controller("--mutant", mutant)
    options = (
        "--only",
        only,
        "--allow",
        "state,motion,destructive",
        "--reply-timeout",
        "1s",
        "--yes",
    )
    done = processes.run(
        "certify", "controller", f"tcp://{host}:{port}", *options, "--out", str(out)
    )
    assert done.returncode == 1, done.stdout + done.stderr
    return Results.read(out / "results.json"), (host, port)


@pytest.mark.parametrize(
    ("mutant", "case_id", "last"),
    [
        ("status-of-one-digit", "4.8/2", "the controller sends get_status, reply: code 0"),
        pytest.param(
            "refuses-run-in-one-byte",
            "4.15/3",
            "the controller sends run_program, reply: flag 0",
            marks=pytest.mark.runs,
        ),
        pytest.param(
            "never-tells-temperatures",
            "3/31.twice",
            "the client sends get_motor_temperatures, request",
            marks=pytest.mark.runs,
        ),
    ],
)
def test_a_script_repeats_a_failure(
    processes: Any, tmp_path: Path, mutant: str, case_id: str, last: str
) -> None:
    """It shows the same behaviour with the faulty controller, and another one with a correct
    one."""
    results, faulty = failed(processes, tmp_path / "out", mutant, case_id)
    (case,) = (c for c in results.cases if c.id == case_id)
    assert last in steps(case)[-1]
    script = tmp_path / "out" / script_path(case, results)
    again = repeat(script, "{}:{}".format(*faulty), "--yes")
    assert "The recorded behaviour occurred again." in again.stdout, again.stdout + again.stderr
    assert again.returncode == 0
    for text in (case.id, case.message, case.replay, steps(case)[-1]):
        assert text in again.stdout
    other = repeat(script, "{}:{}".format(*processes.controller()), "--yes")
    assert other.stdout.endswith("Another behaviour occurred.\n"), other.stdout + other.stderr
    assert other.returncode == 1


@pytest.mark.runs
@pytest.mark.parametrize("case_id", ["4.15/3", "4.15/3.seen-1"])
def test_a_script_that_moves_the_robot(processes: Any, tmp_path: Path, case_id: str) -> None:
    """It asks for confirmation, also for failures found by the judge, and ends with an emergency
    stop."""
    results, (host, port) = failed(processes, tmp_path / "out", "refuses-run-in-one-byte", "4.15/3")
    (case,) = (c for c in results.cases if c.id == case_id)
    script = tmp_path / "out" / script_path(case, results)
    refused = repeat(script, f"{host}:{port}")
    assert refused.returncode == 2
    assert "repeat the command with --yes" in refused.stderr
    done = repeat(script, f"tcp://{host}:{port}", "--yes")
    assert "emergency_stop, request\n  reply cc 32" in done.stdout
    missing = repeat(script, "127.0.0.1:1", "--yes")
    assert missing.returncode == 2
    assert "the connection to 127.0.0.1 failed" in missing.stderr


def test_a_failure_without_a_script(processes: Any, tmp_path: Path) -> None:
    """Steps with a secret cannot be sent again: only the reproduction command is printed."""
    results, _ = failed(processes, tmp_path / "out", "change-answered-with-zero", "4.2/5")
    wrong = [case for case in results.cases if case.verdict is Verdict.FAIL]
    assert wrong
    for case in wrong:
        assert not script_path(case, results)
        assert case.replay
    assert not (tmp_path / "out" / "reproduce").exists()
