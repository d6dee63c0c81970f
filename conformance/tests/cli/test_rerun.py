"""`certify --rerun-from`: the cases of an earlier run that did not pass."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from results_of_run import FAILED, PASSED, results_of

from scaraspec.cli.main import group
from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import SEEN, Results, Role

DONE = replace(PASSED, id="4.8/2", requirements=("4.8/2",))
ICS = '[subject]\nname = "Cell 7"\nversion = "1.4"\n'


def test_a_controller(processes: Any, tmp_path: Path) -> None:
    """Cases that failed or did not run are repeated, with the options of the run, in a new
    folder."""
    first, second = tmp_path / "first", tmp_path / "second"
    wrong = "tcp://{}:{}".format(*processes.controller("--mutant", "version-counts-requests"))
    options = ("--only", "4.7,4.8", "--examples", "3", "--seed", "5")
    ended = processes.run("certify", "controller", wrong, *options, "--out", str(first))
    assert ended.returncode == 1, ended.stdout
    before = Results.read(first / "results.json")
    settled = {c.id for c in before.cases if c.verdict in (Verdict.PASS, Verdict.TOLERATED)}
    open_cases = {c.id for c in before.cases if SEEN not in c.id} - settled
    assert settled
    assert "4.7/4" in open_cases
    again = ("certify", "controller", "--rerun-from", str(first), "--out", str(second))
    ended = processes.run(*again)
    assert ended.returncode == 1, ended.stdout
    after = Results.read(second / "results.json")
    assert {case.id for case in after.cases if SEEN not in case.id} == open_cases
    assert after.run
    assert before.run
    only = {"only": after.run.settings["only"]}
    assert after.run.settings == {**before.run.settings, **only}
    assert after.run.seed == 5
    assert "--examples 3" in after.cases[0].replay
    assert "--rerun-from" not in after.cases[0].replay
    assert processes.run(*again).returncode == 2  # the folder has results


@pytest.fixture
def earlier(tmp_path: Path) -> tuple[Results, Path]:
    """Results with a failure of 4.15/3, and their file."""
    results = results_of(DONE, FAILED)
    assert results.run
    results = replace(
        results,
        run=replace(results.run, settings={"only": "4.8/2,4.15/3", "allow": "state,motion"}),
    )
    path = tmp_path / "results.json"
    results.write(path)
    return results, path


def plan(folder: Path, *arguments: str) -> str:
    """The plan of a run with the ICS of the earlier subject."""
    (folder / "ics.toml").write_text(ICS)
    ics = ("--ics", str(folder / "ics.toml"), "--dry-run")
    ended = CliRunner().invoke(group, ["certify", "controller", *arguments, *ics])
    if ended.exception:
        raise ended.exception
    return ended.output


def test_options_of_the_command_line(earlier: tuple[Results, Path], tmp_path: Path) -> None:
    """An option of the command line replaces that of the earlier run; allowed hazards are not
    copied."""
    _, path = earlier
    assert plan(tmp_path, "--rerun-from", str(path)).startswith("0 of 1 cases will run")
    allowed = plan(tmp_path, "--rerun-from", str(path), "--allow", "state,motion")
    assert allowed.startswith("1 of 1 cases will run")
    everything = plan(tmp_path, "--rerun-from", str(path), "--only", "4.8")
    assert "cases will run" in everything


def test_another_version(earlier: tuple[Results, Path], tmp_path: Path) -> None:
    """A repaired build is repeated, with a notice."""
    results, path = earlier
    replace(results, subject=replace(results.subject, version="1.3")).write(path)
    output = plan(tmp_path, "--rerun-from", str(path))
    assert output.startswith("The version was '1.3' and is '1.4': `scaraspec merge` refuses")


def test_nothing_to_repeat(earlier: tuple[Results, Path], tmp_path: Path) -> None:
    """Exit status 4."""
    results, path = earlier
    done = results_of(DONE)
    replace(results, cases=done.cases, counts=done.counts, verdict=done.verdict).write(path)
    with pytest.raises(Problem, match="nothing to repeat") as problem:
        plan(tmp_path, "--rerun-from", str(path), "--only", "4.8/2")
    assert problem.value.exit_status == 4


def test_refusals(
    earlier: tuple[Results, Path], refused: Callable[..., str], tmp_path: Path
) -> None:
    """Other subjects, claims and roles, and files without results, give exit status 2."""
    results, path = earlier
    controller = ("certify", "controller", "--rerun-from", str(path), "--dry-run")
    assert "subject.name was Cell 7 and is not given" in refused(*controller)
    ics = tmp_path / "ics.toml"
    ics.write_text(f'{ICS}[readings]\nendian = "big"\n')
    reported = refused(*controller, "--ics", str(ics))
    assert "readings.endian was not given and is big" in reported
    reported = refused("certify", "client", "--rerun-from", str(path), "--dry-run")
    assert "has the results of a controller" in reported
    unnamed = replace(results.subject, name="", version="")
    replace(results, subject=unnamed).write(path)
    reported = refused("certify", "controller", "tcp://elsewhere", *controller[2:])
    assert "link was tcp://robot and is tcp://elsewhere" in reported
    path.write_text(json.dumps(json.loads(results.to_json()) | {"run": None}))
    assert "states no settings" in refused(*controller)
    path.unlink()
    assert "cannot be read" in refused(*controller)


def test_a_client(tmp_path: Path) -> None:
    """The cases of a client are repeated with its driver; RESULTS may be a folder."""
    results = results_of(replace(FAILED, id="4.8/1", requirements=("4.8/1",)))
    assert results.run
    client = replace(
        results,
        role=Role.CLIENT,
        subject=replace(results.subject, kind=Role.CLIENT, name="", version="", link="driver"),
        run=replace(results.run, settings={"only": "4.8", "answer_timeout_s": "10"}),
    )
    client.write(tmp_path / "results.json")
    arguments = ("--driver", "driver", "--rerun-from", str(tmp_path), "--dry-run")
    output = CliRunner().invoke(group, ["certify", "client", *arguments]).output
    assert "cases will run" in output
