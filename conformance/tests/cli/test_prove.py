"""`scaraspec prove`: seeded faults are killed by cases of what they violate."""

import json
from pathlib import Path
from typing import Any

from scaraspec.cli.proving import alarm_of, dialects
from scaraspec.controller.faults import faults
from scaraspec.judgement.requirements import REQUIREMENTS, by_clause
from scaraspec.suite.plan import ALL, Options


def test_faults_name_what_they_violate() -> None:
    """There are hundreds, each with its own sentence, of requirements that there are."""
    known = faults().values()
    assert len(known) >= 200
    assert len({fault.sentence for fault in known}) == len(known)
    assert {requirement for fault in known for requirement in fault.requirements} <= set(
        REQUIREMENTS
    )


def test_a_sample_of_the_faults_is_killed(processes: Any, tmp_path: Path) -> None:
    """The command says so, and the matrix says by which case; `make prove` takes all of them."""
    sample = ("--quick", "--only", "4.8,5.3", "--every", "8")
    done = processes.run("prove", *sample, "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "without a fault: conformant" in done.stdout
    matrix = json.loads((tmp_path / "kill-matrix.controller.json").read_text(encoding="utf-8"))
    assert matrix["faults"]
    assert all(fault["killers"] for fault in matrix["faults"])


def test_another_dialect_is_no_false_alarm() -> None:
    """One of those in which every pair of readings occurs; `make prove` takes all of them."""
    *_, dialect = dialects()
    assert len(dialect.differences()) > 10
    only = frozenset(r.id for r in by_clause("4.12"))
    alarm = alarm_of(dialect, Options(only=only, allowed=ALL, undefined=True))
    assert not alarm.false, alarm.cases


def test_an_unknown_fault(processes: Any) -> None:
    """One sentence and exit status 2."""
    done = processes.run("prove", "--fault", "gremlin")
    assert done.returncode == 2
    assert "gremlin" in done.stderr
