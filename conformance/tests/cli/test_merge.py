"""`scaraspec merge` on the command line."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from results_of_run import FAILED, PASSED, results_of

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import Results


def sittings(folder: Path) -> tuple[str, str]:
    """The folder of a sitting with a failure, and the file of a later one without."""
    first = results_of(PASSED, FAILED)
    second = results_of(replace(FAILED, verdict=Verdict.PASS))
    assert second.run
    (folder / "a").mkdir()
    first.write(folder / "a/results.json")
    later = replace(second.run, begun_ns=second.run.begun_ns + 86_400_000_000_000)
    replace(second, run=later).write(folder / "b.json")
    return str(folder / "a"), str(folder / "b.json")


def test_two_sittings(processes: Any, tmp_path: Path) -> None:
    """The reports list both verdicts, the failure decides, and the sittings are not changed."""
    paths, out = sittings(tmp_path), tmp_path / "merged"
    before = Path(paths[1]).read_bytes()
    ended = processes.run("merge", *paths, "--out", str(out))
    assert ended.returncode == 1, ended.stderr
    assert "4.15/3 failed in the sitting of 2023-11-14T22:13:20+00:00 and passed" in ended.stdout
    assert {file.name for file in out.iterdir()} == {
        "results.json",
        "report.html",
        "junit.xml",
        "ctrf.json",
    }
    assert len(Results.read(out / "results.json").cases) == 2
    page = (out / "report.html").read_text("utf-8")
    assert page.count("2023-11-15T22:13:20+00:00") >= 2
    assert Path(paths[1]).read_bytes() == before
    again = processes.run("merge", *paths, "--out", str(out))
    assert again.returncode == 2
    assert "name another folder" in again.stderr


def test_one_certification_in_two_sittings(processes: Any, tmp_path: Path) -> None:
    """A run and its repetition are sittings of one certification."""
    url = "tcp://{}:{}".format(*processes.controller("--mutant", "version-counts-requests"))
    run = ("certify", "controller", url, "--only", "4.7,4.8/2", "--out", str(tmp_path / "a"))
    assert processes.run(*run).returncode == 1
    again = ("certify", "controller", "--rerun-from", str(tmp_path / "a"))
    assert processes.run(*again, "--out", str(tmp_path / "b")).returncode == 1
    paths = (str(tmp_path / "a"), str(tmp_path / "b"))
    ended = processes.run("merge", *paths, "--out", str(tmp_path / "c"))
    assert ended.returncode == 1, ended.stderr
    merged = Results.read(tmp_path / "c/results.json")
    case = next(case for case in merged.cases if case.id == "4.7/4")
    assert [each.verdict for each in case.sittings] == [Verdict.FAIL, Verdict.FAIL]
    assert {each.id for each in merged.cases} >= {"4.8/2", "4.7/2"}


def test_refusals(refused: Callable[..., str], tmp_path: Path) -> None:
    """Exit status 2 and one sentence, and no folder."""
    first, second = sittings(tmp_path)
    out = ("--out", str(tmp_path / "out"))
    assert "at least two" in refused("merge", first, *out)
    assert "cannot be read" in refused("merge", first, str(tmp_path / "none"), *out)
    other = Results.read(Path(second))
    replace(other, subject=replace(other.subject, version="2")).write(Path(second))
    assert "subject.version was 1.4 and is 2" in refused("merge", first, second, *out)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written(processes: Any, tmp_path: Path) -> None:
    """Exit status 3."""
    paths = sittings(tmp_path)
    ended = processes.run("merge", *paths, "--out", f"{paths[1]}/out")
    assert (ended.returncode, ended.stderr.count("\n")) == (3, 1)
    assert "cannot be written" in ended.stderr
