"""`scaraspec compare` with the results of runs."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from results_of_run import FAILED, PASSED, results_of

from scaraspec.report.model import Role


def test_two_runs(processes: Any, tmp_path: Path) -> None:
    """The folder of a run and a file; the second one has a new failure."""
    (tmp_path / "run").mkdir()
    results_of(PASSED).write(tmp_path / "run/results.json")
    results_of(PASSED, FAILED).write(tmp_path / "b.json")
    page = tmp_path / "page.md"
    arguments = (str(tmp_path / "run"), str(tmp_path / "b.json"), "--summary", str(page))
    ended = processes.run("compare", *arguments)
    assert ended.returncode == 1
    assert "new failure · 4.15/3 · the code is 07 after 1.2 s" in ended.stdout
    assert "- new failure · 4.15/3" in page.read_text("utf-8")
    equal = processes.run("compare", arguments[0], arguments[0])
    assert (equal.returncode, "no difference" in equal.stdout) == (0, True)


def test_errors(refused: Callable[..., str], tmp_path: Path) -> None:
    """Another role, and a file that is missing."""
    path, other = tmp_path / "a.json", tmp_path / "b.json"
    results_of(PASSED).write(path)
    replace(results_of(PASSED), role=Role.CLIENT).write(other)
    assert "compare results of the same role" in refused("compare", str(path), str(other))
    assert "cannot be read" in refused("compare", str(path), str(tmp_path / "none.json"))
