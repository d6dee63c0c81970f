"""The CI templates pass their inputs on, and end with the status of the results."""

import os
import re
import textwrap
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped] # it ships no types
from ci_systems import TEMPLATES, Job
from wording import ROOT

_SECOND = slice(1, 2)
RECORDS_ARGUMENTS = """#!/bin/sh
for argument; do echo "$argument"; done >>arguments
mkdir -p scaraspec-out
case $1 in
  certify) [ -z "$RESULTS" ] || touch scaraspec-out/results.json; exit "$CERTIFIED" ;;
  gate) exit "$GATED" ;;
esac
"""

Run = Callable[[Job, Mapping[str, str]], None]


def _on_github(job: Job, given: Mapping[str, str], **event: Any) -> None:
    job.github(given, **{"event": "pull_request", "run_id": 12345678901, **event})


def _on_gitlab(job: Job, given: Mapping[str, str], **pipeline: Any) -> None:
    config = {"robot": {"extends": ".scaraspec", "variables": _variables(given)}}
    job.gitlab(config, **{"source": "merge_request_event", "pipeline_id": 4711, **pipeline})


def _on_jenkins(job: Job, given: Mapping[str, str], new_seed: int = 0) -> None:
    job.jenkins(_variables(given), new_seed=new_seed, stages=_SECOND)


def _in_compose(job: Job, given: Mapping[str, str]) -> None:
    job.run(*job.compose("suite", _variables(given)))


def _calls(job: Job, between: str = " ") -> tuple[str, str]:
    """Return the arguments of `certify` and of `gate`."""
    words = (job.folder / "arguments").read_text("utf-8").splitlines()
    begin, end = words.index("certify"), words.index("gate")
    return between.join(words[begin + 1 : end]), between.join(words[end + 1 :])


def _variables(given: Mapping[str, str]) -> dict[str, str]:
    return {f"SCARASPEC_{name.upper()}": value for name, value in given.items()}


SYSTEMS: Mapping[str, Run] = {
    "github": _on_github,
    "gitlab": _on_gitlab,
    "jenkins": _on_jenkins,
    "compose": _in_compose,
}
SINGLE = ("github", "gitlab", "jenkins")
"""The systems whose job runs on one machine, with the same lines."""


@pytest.fixture
def job(tmp_path: Path) -> Job:
    """A job whose programs record their arguments and end with the status in a variable."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("scaraspec", "pip"):
        (programs / name).write_text(RECORDS_ARGUMENTS, "utf-8")
        (programs / name).chmod(0o755)
    variables = {"PATH": f"{programs}:{os.environ['PATH']}"}
    return Job(tmp_path, variables=variables | {"RESULTS": "1", "CERTIFIED": "0", "GATED": "0"})


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(
    ("statuses", "expected"),
    [
        ("CERTIFIED=0 RESULTS=1 GATED=0", 0),
        ("CERTIFIED=1 RESULTS=1 GATED=0", 0),
        ("CERTIFIED=1 RESULTS=1 GATED=1", 1),
        ("CERTIFIED=1 RESULTS= GATED=0", 1),
        ("CERTIFIED=2 RESULTS= GATED=0", 2),
        ("CERTIFIED=3 RESULTS= GATED=0", 3),
        ("CERTIFIED=3 RESULTS=1 GATED=0", 3),
        ("CERTIFIED=3 RESULTS=1 GATED=1", 1),
        ("CERTIFIED=3 RESULTS=1 GATED=3", 3),
        ("CERTIFIED=4 RESULTS=1 GATED=4", 4),
    ],
)
def test_exit_status(job: Job, system: str, statuses: str, expected: int) -> None:
    """The gate decides about violations; a run without results never passes."""
    job.variables = {**job.variables, **dict(each.split("=") for each in statuses.split())}
    SYSTEMS[system](job, {})
    assert job.status == expected, job.log
    if system == "github":
        assert job.outputs == {"exit-status": f"{expected}"}
    if system != "compose":
        assert job.kept == ("scaraspec-out",)


@pytest.mark.parametrize("system", SYSTEMS)
def test_inputs_of_a_controller(job: Job, system: str) -> None:
    """Each input sets its option."""
    given = {"url": "tcp://robot", "ics": "ics.toml", "allow": "state", "baseline": "b.json"}
    given |= {"waivers": "w.toml", "seed": "7", "options": "--only 4.7 --exhaustive"}
    SYSTEMS[system](job, given)
    certify, gate = _calls(job)
    assert certify == (
        "controller tcp://robot --wait-for 60s --allow state --ics ics.toml --seed 7 --only 4.7 "
        "--exhaustive --out scaraspec-out"
    )
    assert gate.endswith("--baseline b.json --waivers w.toml")


@pytest.mark.parametrize(
    ("system", "url"), [*((each, "127.0.0.1") for each in SINGLE), ("compose", "controller")]
)
def test_defaults(job: Job, system: str, url: str) -> None:
    """Without inputs only queries are sent, and no failure is accepted."""
    SYSTEMS[system](job, {})
    certify, gate = _calls(job)
    assert certify == f"controller tcp://{url}:8877 --wait-for 60s --seed 0 --out scaraspec-out"
    assert "--baseline" not in gate
    assert "--waivers" not in gate


@pytest.mark.parametrize("system", SINGLE)
def test_inputs_of_a_client(job: Job, system: str) -> None:
    """A driver with arguments is one argument, and so is a file name with a space."""
    given = {"role": "client", "driver": "./driver --fast", "ics": "my ics.toml"}
    SYSTEMS[system](job, given)
    certify, _ = _calls(job, between="|")
    assert certify.startswith("client|--driver|./driver --fast|--ics|my ics.toml|--seed|0|")


@pytest.mark.parametrize(
    ("run", "scheduled", "seed"),
    [
        (_on_github, {"event": "schedule"}, 12345678901),
        (_on_github, {}, 0),
        (_on_gitlab, {"source": "schedule"}, 4711),
        (_on_gitlab, {}, 0),
        (_on_jenkins, {"new_seed": 33}, 33),
    ],
)
def test_seed(job: Job, run: Callable[..., None], scheduled: Mapping[str, Any], seed: int) -> None:
    """A scheduled run has a new seed, and the log names it."""
    run(job, {}, **scheduled)
    assert f"--seed {seed} " in _calls(job)[0]
    assert f"scaraspec: seed {seed}\n" in job.log


def test_package_is_this_version() -> None:
    """The templates install the version of scaraspec that they belong to."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    pages = (ROOT / "docs/tutorial-ci.md", ROOT / "docs/ci-templates.md")
    for file in (*TEMPLATES.iterdir(), *pages):
        found = re.findall(r"scaraspec==([\d.]+)|/ci@v([\d.]+)", file.read_text("utf-8"))
        assert {"".join(each) for each in found} <= {version}, file


def test_templates_agree() -> None:
    """The templates have the same inputs and, from a comment on, the same lines."""
    action, gitlab, jenkins = (
        (TEMPLATES / name).read_text("utf-8")
        for name in ("action.yml", "gitlab.yml", "Jenkinsfile")
    )
    scripts = {_common_lines(text) for text in (action, gitlab, jenkins)}
    assert len(scripts) == 1
    inputs = {f"SCARASPEC_{name.upper()}" for name in yaml.safe_load(action)["inputs"]}
    assert inputs == set(yaml.safe_load(gitlab)[".scaraspec"]["variables"])
    assert inputs == set(re.findall(r"SCARASPEC_\w+", jenkins))


def test_quotes_and_brackets_of_the_jenkinsfile() -> None:
    """No tool reads Groovy here: each quote and bracket is closed, outside of comments."""
    text = (TEMPLATES / "Jenkinsfile").read_text("utf-8")
    left = re.sub(r"""'''.*?'''|'[^'\n]*'|"[^"\n]*"|//[^\n]*""", "", text, flags=re.DOTALL)
    pair = r"\{[^{}()\[\]]*\}|\([^{}()\[\]]*\)|\[[^{}()\[\]]*\]"
    while (shorter := re.sub(pair, "", left)) != left:
        left = shorter
    assert left.split() == ["pipeline"]


def _common_lines(template: str) -> str:
    """Return the lines from the comment to the last exit, without indentation."""
    pattern = r"^ *# The same lines.*\bexit \"\$certified\"$"
    lines = re.search(pattern, template, re.MULTILINE | re.DOTALL)
    assert lines
    return textwrap.dedent(lines[0])
