"""A second client that changes settings during a run makes it inconclusive, never nonconformant."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scaraspec.client import Client
from scaraspec.judgement.verdicts import Verdict
from scaraspec.report.model import Results

REASON = "another client is using this robot"


@contextmanager
def _second_client(url: str) -> Iterator[None]:
    """Set the gripper centre to one value after another."""
    over = threading.Event()

    def change() -> None:
        with Client(url, password="password") as robot:
            number = 0
            while not over.wait(0.05):
                number += 1
                robot.set_gripper_center(100.0 + number, -7.5, 3.25)

    thread = threading.Thread(target=change)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_a_second_client(processes: Any, tmp_path: Path) -> None:
    """Exit status 3, no failure, and the reason in terminal, results and report."""
    host, port = processes.controller()
    url, out = f"tcp://{host}:{port}", tmp_path / "out"
    with _second_client(url):
        done = processes.run(
            *("certify", "controller", url, "--allow", "state", "--only", "4.19,4.20"),
            *("--out", str(out)),
        )
    assert done.returncode == 3, done.stdout + done.stderr
    assert REASON in done.stdout
    results = Results.read(out / "results.json")
    assert results.counts[Verdict.FAIL] == 0
    assert any(notice.startswith(REASON) for notice in results.notices)
    assert REASON in (out / "report.html").read_text(encoding="utf-8")
