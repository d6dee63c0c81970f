"""`scaraspec gate` as in CI, with the results of real runs."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from jsonschema import Draft202012Validator  # type: ignore[import-untyped] # it has no types
from results_of_run import FAILED, PASSED, SEEN, results_of

from scaraspec.report.model import Results

WAIVER = """[[waiver]]
{name}
reason = "a known limit of this hardware"
issue = "FW-12"
approver = "firmware lead"
expires = {expires}
"""

CODE_QUALITY = {
    "type": "array",
    "items": {
        "type": "object",
        "required": ["description", "check_name", "fingerprint", "severity", "location"],
        "properties": {
            "description": {"type": "string"},
            "check_name": {"type": "string"},
            "fingerprint": {"type": "string", "minLength": 1},
            "severity": {"enum": ["info", "minor", "major", "critical", "blocker"]},
            "location": {
                "required": ["path", "lines"],
                "properties": {
                    "path": {"type": "string", "pattern": "^(?!\\./|/)"},
                    "lines": {
                        "required": ["begin"],
                        "properties": {"begin": {"type": "integer", "minimum": 1}},
                    },
                },
            },
        },
    },
}
"""The fields that GitLab requires in a code quality report; paths are relative and do not begin
with `./`."""


@pytest.fixture
def gate(processes: Any, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    """Run the command without a CI system; return its exit status and output."""
    for name in ("GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
        monkeypatch.delenv(name, raising=False)

    def run(*arguments: object) -> tuple[int, str]:
        ended = processes.run("gate", *map(str, arguments))
        return ended.returncode, ended.stdout + ended.stderr

    return run


def written(path: Path, *changes: Any) -> Path:
    """Write results and return their path."""
    results_of(*changes).write(path)
    return path


def test_update_accepts_failures(
    gate: Callable[..., tuple[int, str]], processes: Any, tmp_path: Path
) -> None:
    """A faulty controller fails the gate; after --update the same failures pass."""
    host, port = processes.controller("--mutant", "status-in-words")
    out, baseline = tmp_path / "out", tmp_path / "baseline.json"
    arguments = ("--only", "4.8/2", "--out", str(out))
    run = processes.run("certify", "controller", f"tcp://{host}:{port}", *arguments)
    assert run.returncode == 1, run.stdout
    status, text = gate(out)
    assert status == 1
    assert "new failure · 4.8/2" in text
    assert "reproduction command: scaraspec certify controller" in text
    status, text = gate(out, "--baseline", baseline, "--update")
    assert status == 0, text
    assert "baseline.json is updated" in text
    status, text = gate(out, "--baseline", baseline)
    assert (status, "accepted · 4.8/2" in text) == (0, True)


def test_each_output(gate: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    """A new failure and a waived one, in all formats."""
    results = written(tmp_path / "results.json", PASSED, FAILED, SEEN)
    waivers = tmp_path / "waivers.toml"
    name = f'fingerprint = "{SEEN.fingerprint}"'
    waivers.write_text(WAIVER.format(name=name, expires="2999-01-01"), "utf-8")
    files = {kind: tmp_path / kind for kind in ("summary", "junit", "ctrf", "code-quality")}
    files["summary"].write_text("# Build\n", "utf-8")
    options = [part for kind, path in files.items() for part in (f"--{kind}", path)]
    status, text = gate(results, "--waivers", waivers, *options)
    assert status == 1
    assert "waived until 2999-01-01: a known limit of this hardware (FW-12, firmware lead)" in text
    summary = files["summary"].read_text("utf-8")
    assert summary.startswith("# Build\n### scaraspec: gate failed: 1 problem")
    assert r"| new failure | 4.15/3 | the code is 07 after 1.2 s |" in summary
    root = ET.parse(files["junit"]).getroot()
    assert (root.get("failures"), len(root.findall(".//skipped"))) == ("1", 1)
    statuses = [t["status"] for t in json.loads(files["ctrf"].read_text())["results"]["tests"]]
    assert statuses == ["passed", "failed", "skipped"]
    entries = json.loads(files["code-quality"].read_text())
    Draft202012Validator(CODE_QUALITY).validate(entries)
    (entry,) = entries
    assert entry["fingerprint"] == FAILED.fingerprint
    assert entry["location"] == {"path": "scaraspec/4.15/3", "lines": {"begin": 1}}


def test_annotations(
    gate: Callable[..., tuple[int, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On GitHub, problems are annotations, and the summary goes to the page of the job."""
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    page = tmp_path / "page.md"
    ended = gate(written(tmp_path / "results.json", FAILED), "--summary", page)[1]
    assert "::error title=scaraspec%3A new failure 4.15/3::the code is 07 after 1.2 s" in ended
    assert page.exists()


@pytest.mark.parametrize(
    ("name", "expires", "problem"),
    [
        ('case = "4.15/3"', "2020-01-01", "expired waiver · 4.15/3"),
        ('case = "4.15/3"\nflaky = true', "2020-01-01", "expired waiver · 4.15/3"),
        ('case = "4.8/1"', "2999-01-01", "stale waiver · 4.8/1"),
        ('case = "4.8/99"', "2999-01-01", "unknown id · 4.8/99"),
    ],
)
def test_waivers(
    gate: Callable[..., tuple[int, str]], tmp_path: Path, name: str, expires: str, problem: str
) -> None:
    """An expired, a stale and an unknown waiver fail, also if each failure is in the baseline."""
    results = written(tmp_path / "results.json", PASSED, FAILED)
    waivers = tmp_path / "waivers.toml"
    waivers.write_text(WAIVER.format(name=name, expires=expires), "utf-8")
    status, text = gate(results, "--baseline", results, "--waivers", waivers)
    assert status == 1
    assert problem in text


def test_errors(refused: Callable[..., str], tmp_path: Path) -> None:
    """One sentence each, exit status 2; nothing is written."""
    results = str(written(tmp_path / "results.json", PASSED))
    before = Path(results).read_bytes()
    assert "--update needs --baseline" in refused("gate", results, "--update")
    assert "cannot be read" in refused("gate", str(tmp_path / "none.json"))
    assert "cannot be read" in refused("gate", results, "--baseline", str(tmp_path / "none.json"))
    assert "cannot be read" in refused("gate", results, "--waivers", str(tmp_path / "none.toml"))
    new, broken = tmp_path / "new.json", tmp_path / "broken.toml"
    broken.write_text("[[waiver", "utf-8")
    options = ("--baseline", str(new), "--update", "--waivers", str(broken))
    assert "is not valid TOML" in refused("gate", results, *options)
    assert not new.exists()
    text = refused("gate", results, "--baseline", results, "--update")
    assert "is not a baseline: name another file" in text
    assert Path(results).read_bytes() == before


def test_a_baseline_needs_conclusive_results(
    gate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    """A baseline from inconclusive results would accept missing tests."""
    results, baseline = tmp_path / "results.json", tmp_path / "baseline.json"
    results_of().write(results)
    status, text = gate(results, "--baseline", baseline, "--update")
    assert status == 4
    assert "is not updated" in text
    assert not baseline.exists()
    assert Results.read(results).verdict.value == "nothing-tested"
