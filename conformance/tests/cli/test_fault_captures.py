"""`scaraspec audit` of the captures of `fixtures/captures/faults.toml`: what is due, no more."""

import json
from pathlib import Path
from typing import Any

import pytest
from fault_captures import captures, write

from scaraspec.judge.requirements import REQUIREMENTS, Binds

CAPTURES = captures()
EXIT_STATUS = {"none": 0, "tolerated": 0, "fail": 1, "inconclusive": 3}


def test_the_table_is_large_enough() -> None:
    """At least 40 captures have a fault, and each has a name of its own."""
    faulty = [c for c in CAPTURES if EXIT_STATUS[c["due"].partition(" ")[0]]]
    assert len(faulty) >= 40
    assert len({c["name"] for c in CAPTURES}) == len(CAPTURES)


@pytest.mark.parametrize("capture", CAPTURES, ids=lambda capture: capture["name"])
def test_a_capture(processes: Any, tmp_path: Path, capture: dict[str, Any]) -> None:
    """The exit status and a finding are what is due; the other side is not blamed."""
    file, results = tmp_path / "capture.pcapng", tmp_path / "results.json"
    write(capture["session"], file)
    done = processes.run("audit", f"{file}", "--json", f"{results}")
    verdict, _, requirement = capture["due"].partition(" ")
    assert done.returncode == EXIT_STATUS[verdict], done.stdout
    cases = json.loads(results.read_text("utf-8"))["cases"]
    found = {id_ for case in cases if case["verdict"] == verdict for id_ in case["requirements"]}
    assert verdict == "none" or requirement in found, done.stdout
    failed = {id_ for case in cases if case["verdict"] == "fail" for id_ in case["requirements"]}
    sides = {Binds.BOTH, Binds(capture["side"])}
    assert {REQUIREMENTS[id_].binds for id_ in failed} <= sides, done.stdout
