"""If a second client changes settings during a run, the run is inconclusive, never
nonconformant."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from scaraspec.client import Client
from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import Results

pytestmark = pytest.mark.runs

REASON = "another client is using this robot"


Change = Callable[[Client, int], None]


def _another_value(robot: Client, times: int) -> None:
    """Set the gripper centre to a new value each time."""
    robot.set_gripper_center(100.0 + times, -7.5, 3.25)


def _same_values(robot: Client, _times: int) -> None:
    """Set gripper centre and clock to their values at the start of the run."""
    robot.set_gripper_center(1, 2, 3)
    robot.set_time(datetime.now(UTC))


@contextmanager
def _second_client(url: str, change: Change) -> Iterator[None]:
    """Change a setting repeatedly."""
    over, changed = threading.Event(), threading.Event()

    def change_all() -> None:
        with Client(url, password="password") as robot:
            times = 0
            while not over.wait(0.05):
                times += 1
                change(robot, times)
                changed.set()

    thread = threading.Thread(target=change_all)
    thread.start()
    changed.wait(60)
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.parametrize(
    ("change", "only"), [(_another_value, "4.19,4.20"), (_same_values, "4.5,4.6,4.20")]
)
def test_a_second_client(processes: Any, tmp_path: Path, change: Change, only: str) -> None:
    """Exit status 3, no failure; terminal, results and report state the reason."""
    host, port = processes.controller()
    url, out = f"tcp://{host}:{port}", tmp_path / "out"
    with _second_client(url, change):
        done = processes.run(
            *("certify", "controller", url, "--allow", "state", "--only", only),
            *("--out", str(out)),
        )
    assert done.returncode == 3, done.stdout + done.stderr
    assert REASON in done.stdout
    results = Results.read(out / "results.json")
    assert results.counts[Verdict.FAIL] == 0
    assert any(notice.startswith(REASON) for notice in results.notices)
    assert REASON in (out / "report.html").read_text(encoding="utf-8")
