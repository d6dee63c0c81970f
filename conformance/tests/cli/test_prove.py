"""`scaraspec prove`: seeded faults are killed by cases of what they violate."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from scaraspec.cli.prove import command
from scaraspec.judge.requirements import REQUIREMENTS, by_clause
from scaraspec.mutants.kill_matrix import STANDS, alarm_of, dialects
from scaraspec.report.model import Role
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run, collect

Refused = Callable[..., str]


@pytest.mark.parametrize(
    ("role", "fewest", "fewest_subtle"), [(Role.CONTROLLER, 200, 60), (Role.CLIENT, 80, 20)]
)
def test_faults_name_what_they_violate(role: Role, fewest: int, fewest_subtle: int) -> None:
    """There are many, each with its own sentence, of requirements that there are."""
    known = STANDS[role].faults().values()
    assert len(known) >= fewest
    assert sum(fault.subtle for fault in known) >= fewest_subtle
    assert len({fault.sentence for fault in known}) == len(known)
    assert {requirement for fault in known for requirement in fault.requirements} <= set(
        REQUIREMENTS
    )


@pytest.mark.parametrize("role", ["controller", "client"])
def test_a_sample_of_the_faults_is_killed(processes: Any, tmp_path: Path, role: str) -> None:
    """The command says so, and the matrix says by which case; `make prove` takes all of them."""
    sample = ("--quick", "--only", "4.8", "--every", "5", "--examples", "5")
    done = processes.run("prove", "--role", role, *sample, "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "without a fault: conformant" in done.stdout
    matrix = json.loads((tmp_path / f"kill-matrix.{role}.json").read_text(encoding="utf-8"))
    assert matrix["faults"]
    assert all(fault["killers"] for fault in matrix["faults"])
    counts = matrix["counts"]
    assert counts["killed"] == counts["faults"] == len(matrix["faults"])
    assert counts["subtle_killed"] == counts["subtle"] > 0
    assert matrix["without_fault"] == "conformant"


@pytest.mark.parametrize("role", [Role.CONTROLLER, Role.CLIENT])
def test_another_dialect_is_no_false_alarm(role: Role) -> None:
    """One of those in which every pair of readings occurs; `make prove` takes all of them."""
    *_, dialect = dialects()
    assert len(dialect.differences()) > 10
    only = frozenset(r.id for r in by_clause("4.12"))
    alarm = alarm_of(dialect, role, Options(only=only, allowed=ALL, undefined=True))
    assert not alarm.false, alarm.cases


def test_no_fault_is_no_proof(processes: Any) -> None:
    """A fault that violates nothing of what is asked for leaves nothing to prove."""
    done = processes.run("prove", "--fault", "status-of-one-digit", "--only", "4.1")
    assert done.returncode == 4
    assert "nothing proved" in done.stderr


def test_no_case_is_no_proof(processes: Any) -> None:
    """Where nothing is tried, no dialect has been shown to be failed by nothing."""
    done = processes.run("prove", "--dialects", "--role", "client", "--only", "4.2/2")
    assert done.returncode == 4
    assert "nothing proved" in done.stderr


def test_an_unknown_fault(refused: Refused) -> None:
    """One sentence and exit status 2, with what may have been meant."""
    assert "gremlin: there is no such fault; " in refused("prove", "--fault", "gremlin")
    told = refused("controller", "--fault", "status-of-no-digit")
    assert "did you mean status-of-one-digit" in told
    assert "prove --role controller --list has all" in told


def test_faults_are_listed() -> None:
    """Each in a line, with what it violates, and nothing is tried."""
    done = CliRunner().invoke(command, ["--list", "--only", "4.8/2"])
    assert done.exit_code == 0
    assert "status-of-one-digit: The status has one digit. (4.8/2, 4.8/3)" in done.output
    assert done.output.count("\n") == sum(
        "4.8/2" in fault.requirements for fault in STANDS[Role.CONTROLLER].faults().values()
    )


@pytest.mark.parametrize("option", ["--quick", "--out=here"])
def test_what_is_listed_is_not_tried(refused: Refused, option: str) -> None:
    """What is asked of a proof is not left undone silently."""
    assert "--list tries no fault" in refused("prove", "--list", option)


@pytest.mark.parametrize(
    "option", ["--fault=clock-stands", "--quick", "--every=2", "--list", "--out=here"]
)
def test_dialects_are_no_faults(refused: Refused, option: str) -> None:
    """What is asked of faults is not left undone silently."""
    assert "--dialects tries no fault" in refused("prove", "--dialects", option)


@pytest.mark.parametrize("role", list(STANDS))
def test_the_published_matrix_is_that_of_these_faults(role: Role) -> None:
    """Each is in it, and killed; there is no case that kills none."""
    published = Path(__file__).parents[3] / "reports" / f"kill-matrix.{role.value}.json"
    matrix = json.loads(published.read_text(encoding="utf-8"))
    assert {fault["fault"] for fault in matrix["faults"]} == set(STANDS[role].faults())
    assert all(fault["killers"] for fault in matrix["faults"])
    assert matrix["idle"] == []
    killers = {case for fault in matrix["faults"] for case in fault["killers"]}
    assert {case.id for case in collect(Options(), role)} <= killers


def test_ctrl_c_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also during the run without a mutant, which reports the interruption."""

    def interrupted(_: Run) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Run, "_try_cases", interrupted)
    done = CliRunner().invoke(command, ["--quick", "--only", "4.8/2"])
    assert done.exit_code == 1
    assert "faults killed" not in done.output
