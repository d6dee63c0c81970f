"""Optimization of .rrd files, in the background and only if it succeeds."""

import os
import subprocess
import threading
from concurrent.futures import wait
from pathlib import Path
from typing import Any

import pytest

from scaraspec_recorder.recordings.capture import write_rrd
from scaraspec_recorder.sinks.rerun import optimizer
from scaraspec_recorder.sinks.rerun.optimizer import MOST_WAITING, optimize, optimize_later

TIMEOUT_S = 30


def test_a_failed_optimization_keeps_the_file(tmp_path: Path) -> None:
    """A smaller file is only a convenience."""
    path = tmp_path / "capture.rrd"
    path.write_bytes(b"no recording")
    assert not optimize(path)
    assert path.read_bytes() == b"no recording"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_keeps_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tool writes an incomplete file and exits with 0; that file is not used."""
    path = tmp_path / "capture.rrd"
    write_rrd([], path)
    before, run = path.read_bytes(), subprocess.run

    def run_on_a_full_disk(command: list[str], **options: Any) -> None:
        run(command, **options)
        os.truncate(command[-1], 4096)

    monkeypatch.setattr(subprocess, "run", run_on_a_full_disk)
    assert not optimize(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_optimization_runs_in_the_background(monkeypatch: pytest.MonkeyPatch) -> None:
    """One file at a time, a few files wait, and further files stay unoptimized."""
    begun, go_on = threading.Event(), threading.Event()
    done = []

    def slowly(path: Path) -> None:
        begun.set()
        assert go_on.wait(TIMEOUT_S)
        done.append(path)

    monkeypatch.setattr(optimizer, "optimize", slowly)
    made = [optimize_later(Path(f"{number}.rrd")) for number in range(MOST_WAITING + 5)]
    assert begun.wait(TIMEOUT_S)
    assert [one.done() for one in made] == [False] * MOST_WAITING + [True] * 5
    go_on.set()
    assert not wait(made, TIMEOUT_S).not_done
    assert done == [Path(f"{number}.rrd") for number in range(MOST_WAITING)]
