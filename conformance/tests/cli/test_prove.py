"""`scaraspec prove`: cases of the violated requirements kill the mutants."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from scaraspec.cli.prove import command
from scaraspec.judge.requirements import REQUIREMENTS, by_clause
from scaraspec.mutants.kill_matrix import ROLE_SUITES, check_dialect, dialects
from scaraspec.report.model import Role
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run

Refused = Callable[..., str]


@pytest.mark.parametrize(
    ("role", "fewest", "fewest_subtle"), [(Role.CONTROLLER, 200, 60), (Role.CLIENT, 80, 20)]
)
def test_mutants_violate_known_requirements(role: Role, fewest: int, fewest_subtle: int) -> None:
    """There are many mutants, each with its own sentence and with requirements of the catalogue."""
    known = ROLE_SUITES[role].faults().values()
    assert len(known) >= fewest
    assert sum(fault.subtle for fault in known) >= fewest_subtle
    assert len({fault.sentence for fault in known}) == len(known)
    assert {requirement for fault in known for requirement in fault.requirements} <= set(
        REQUIREMENTS
    )


@pytest.mark.parametrize("role", ["controller", "client"])
def test_a_sample_of_the_mutants_is_killed(processes: Any, tmp_path: Path, role: str) -> None:
    """The output and the kill matrix show the kills; `make prove` runs all mutants."""
    sample = ("--quick", "--only", "4.8", "--every", "5", "--examples", "5")
    done = processes.run("prove", "--role", role, *sample, "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"unmodified {role}: " in done.stdout
    matrix = json.loads((tmp_path / f"kill-matrix.{role}.json").read_text(encoding="utf-8"))
    assert matrix["faults"]
    assert all(fault["killers"] for fault in matrix["faults"])
    counts = matrix["counts"]
    assert counts["killed"] == counts["faults"] == len(matrix["faults"])
    assert counts["subtle_killed"] == counts["subtle"] > 0
    assert counts["one_cause"] == sum(fault["causes"] == 1 for fault in matrix["faults"])
    assert counts["one_cause"] >= 0.8 * counts["faults"]
    assert counts["named_first"] >= 0.8 * counts["faults"]
    assert f"all failures are one group: {counts['one_cause']} mutants" in done.stdout
    assert matrix["without_fault"] == "no-violation-found"  # a part of the suite
    durations_s = {fault["fault"]: fault["duration_s"] for fault in matrix["faults"]}
    assert [*matrix["slowest"].values()] == sorted(durations_s.values(), reverse=True)[:10]
    assert matrix["slowest"].items() <= durations_s.items()


@pytest.mark.parametrize("role", [Role.CONTROLLER, Role.CLIENT])
def test_another_dialect_causes_no_false_alarm(role: Role) -> None:
    """One dialect that combines many readings is tried; `make prove` tries all of them."""
    *_, dialect = dialects()
    assert len(dialect.differences()) > 10
    only = frozenset(r.id for r in by_clause("4.12"))
    alarm = check_dialect(dialect, role, Options(only=only, allowed=ALL, undefined=True))
    assert not alarm.false, alarm.cases


def test_no_matching_mutant_proves_nothing(processes: Any) -> None:
    """Exit status 4 if the mutant violates no requirement of --only."""
    done = processes.run("prove", "--mutant", "status-of-one-digit", "--only", "4.1")
    assert done.returncode == 4
    assert "nothing proved" in done.stderr


def test_no_matching_case_proves_nothing(processes: Any) -> None:
    """Exit status 4 if no case tests a requirement of --only."""
    done = processes.run("prove", "--dialects", "--role", "client", "--only", "4.2/2")
    assert done.returncode == 4
    assert "nothing proved" in done.stderr


def test_an_unknown_mutant(refused: Refused) -> None:
    """One sentence and exit status 2, with the most similar ids."""
    assert "gremlin: there is no such mutant; " in refused("prove", "--mutant", "gremlin")
    message = refused("controller", "--mutant", "status-of-no-digit")
    assert "did you mean status-of-one-digit" in message
    assert "prove --role controller --list prints all" in message


def test_fault_is_an_alias_of_mutant(refused: Refused) -> None:
    """The old option name works in both commands, but is not in the help."""
    done = CliRunner().invoke(command, ["--list", "--fault", "status-of-one-digit"])
    assert done.exit_code == 0
    assert done.output.startswith("status-of-one-digit: ")
    assert done.output.count("\n") == 1
    assert "--fault" not in CliRunner().invoke(command, ["--help"]).output
    assert "gremlin: there is no such mutant; " in refused("controller", "--fault", "gremlin")
    both = refused("controller", "--fault", "clock-stands", "--mutant", "clock-stands")
    assert "--fault is the old name of --mutant" in both


def test_mutants_are_listed() -> None:
    """One line per mutant, with the requirements that it violates; no mutant is run."""
    done = CliRunner().invoke(command, ["--list", "--only", "4.8/2"])
    assert done.exit_code == 0
    assert "status-of-one-digit: The status has one digit. (4.8/2, 4.8/3)" in done.output
    assert done.output.count("\n") == sum(
        "4.8/2" in fault.requirements for fault in ROLE_SUITES[Role.CONTROLLER].faults().values()
    )


@pytest.mark.parametrize("option", ["--quick", "--out=here"])
def test_list_excludes_options_of_a_run(refused: Refused, option: str) -> None:
    """An option that would have no effect is refused."""
    assert "--list runs no mutant" in refused("prove", "--list", option)


@pytest.mark.parametrize(
    "option", ["--mutant=clock-stands", "--quick", "--every=2", "--list", "--out=here"]
)
def test_dialects_excludes_options_of_mutants(refused: Refused, option: str) -> None:
    """An option that would have no effect is refused."""
    assert "--dialects runs no mutant" in refused("prove", "--dialects", option)


@pytest.mark.parametrize("role", list(ROLE_SUITES))
def test_the_published_matrix_has_all_mutants(role: Role) -> None:
    """Every mutant is in the matrix and killed, and every case kills a mutant."""
    published = Path(__file__).parents[3] / "reports" / f"kill-matrix.{role.value}.json"
    matrix = json.loads(published.read_text(encoding="utf-8"))
    assert {fault["fault"] for fault in matrix["faults"]} == set(ROLE_SUITES[role].faults())
    assert all(fault["killers"] for fault in matrix["faults"])
    assert matrix["idle"] == []
    killers = {case for fault in matrix["faults"] for case in fault["killers"]}
    assert {case.id for case in collect(Options(), role)} <= killers


def test_ctrl_c_ends_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C also ends it during the run against the unmodified implementation."""

    def interrupted(_: Run) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Run, "_try_cases", interrupted)
    done = CliRunner().invoke(command, ["--quick", "--only", "4.8/2"])
    assert done.exit_code == 1
    assert "mutants killed" not in done.output
