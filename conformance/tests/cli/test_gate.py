"""`scaraspec gate`, as CI runs it, with the results of real runs."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from jsonschema import Draft202012Validator  # type: ignore[import-untyped] # it has no types
from results_of_run import FAILED, PASSED, SEEN, failed, results_of

from scaraspec.judge.verdicts import Conclusion, Reason, Verdict
from scaraspec.report.model import Case, Results, Role

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
"""What GitLab requires of a code quality report; paths are relative and do not begin with `./`."""


@pytest.fixture
def gate(processes: Any, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    """Run the command outside of any CI system; return its exit status and output."""
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


def test_from_nothing_to_red_to_green(
    gate: Callable[..., tuple[int, str]], processes: Any, tmp_path: Path
) -> None:
    """A run of a faulty controller is red, is accepted with --update, and is green then."""
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
    """An expired, a stale and an unknown waiver fail, also if each failure is known."""
    results = written(tmp_path / "results.json", PASSED, FAILED)
    waivers = tmp_path / "waivers.toml"
    waivers.write_text(WAIVER.format(name=name, expires=expires), "utf-8")
    status, text = gate(results, "--baseline", results, "--waivers", waivers)
    assert status == 1
    assert problem in text


REPAIRED = Case("4.15/3", ("4.15/3",), Verdict.PASS)
UNSURE = Case("4.9/2", ("4.9/2",), Verdict.INCONCLUSIVE, message="the link was lost")
NOT_RUN = replace(PASSED, verdict=Verdict.NONE, reason=Reason.FAIL_FAST, message="--fail-fast")


@pytest.mark.parametrize(
    ("now", "expected", "line"),
    [
        (results_of(PASSED, FAILED), 0, "gate passed"),
        (results_of(PASSED, REPAIRED), 0, "fixed · 4.15/3"),
        (results_of(PASSED, failed("4.15/3", "no code")), 1, "changed failure · 4.15/3"),
        (results_of(PASSED, FAILED, SEEN), 1, "new failure · 3/18.seen-1"),
        (results_of(FAILED), 1, "lost case · 4.8/1"),
        (replace(results_of(PASSED, FAILED), requirements=()), 1, "lost requirement · 4.8/1"),
        (replace(results_of(PASSED, FAILED), role=Role.CLIENT), 1, "other settings · role"),
        (results_of(PASSED, FAILED, UNSURE), 3, "inconclusive · 4.9/2 · the link was lost"),
        (results_of(FAILED, UNSURE), 1, "gate failed: 2 problems"),
    ],
)
def test_compared_with_a_baseline(
    gate: Callable[..., tuple[int, str]], tmp_path: Path, now: Results, expected: int, line: str
) -> None:
    """Each problem has exit status 1, which wins over 3 for what is inconclusive."""
    baseline, results = written(tmp_path / "results.json", PASSED, FAILED), tmp_path / "now.json"
    now.write(results)
    status, text = gate(results, "--baseline", baseline)
    assert status == expected
    assert f"\n{line}" in f"\n{text}"


def test_nothing_is_accepted_without_a_run(
    gate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    """Nothing tested, and a run that --fail-fast ended after an accepted failure."""
    status, text = gate(written(tmp_path / "none.json"))
    assert (status, text.startswith("gate nothing was tested")) == (4, True)
    waivers = tmp_path / "waivers.toml"
    waivers.write_text(WAIVER.format(name='case = "4.15/3"', expires="2999-01-01"), "utf-8")
    status, text = gate(written(tmp_path / "fast.json", FAILED, NOT_RUN), "--waivers", waivers)
    assert (status, "inconclusive · --fail-fast · cases that did not run: 1" in text) == (3, True)


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


@pytest.mark.parametrize("option", ["--junit", "--ctrf", "--code-quality"])
def test_only_reports_are_replaced(
    gate: Callable[..., tuple[int, str]], refused: Callable[..., str], tmp_path: Path, option: str
) -> None:
    """An earlier report and an empty file are replaced; another file, a folder or a device not."""
    results = written(tmp_path / "results.json", PASSED)
    report = tmp_path / "report"
    report.touch()
    for _ in range(2):
        assert gate(results, option, report)[0] == 0
        assert report.read_text("utf-8").strip()
    assert gate(written(tmp_path / "red.json", FAILED), option, report)[0] == 1
    before = results.read_bytes()
    for other in (results, tmp_path, Path("/dev/null")):
        arguments = ("gate", f"{results}", option, f"{other}")
        assert "is no earlier report of this kind" in refused(*arguments)
    assert results.read_bytes() == before
    assert Path("/dev/null").is_char_device()


def test_one_file_for_two_reports(gate: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    """The second one replaces neither the first one nor a new baseline."""
    results = written(tmp_path / "results.json", PASSED)
    for first in (("--junit",), ("--update", "--baseline")):
        file = tmp_path / f"file{first[-1]}"
        status, text = gate(results, *first, file, "--ctrf", file)
        assert status == 2
        assert "is no earlier report of this kind" in text
        assert "ctrf" not in file.read_text("utf-8").lower()


def test_a_file_that_cannot_be_written(
    gate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    """The result is shown. A violation keeps exit status 1, the rest is inconclusive."""
    for case, expected in ((PASSED, 3), (FAILED, 1)):
        results = written(tmp_path / "results.json", case)
        for option in ("--summary", "--junit", "--ctrf", "--code-quality"):
            status, text = gate(results, option, tmp_path / "none" / "file")
            assert status == expected
            assert text.startswith("gate ")
            assert "file cannot be written: No such file or directory" in text


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"cases": ()}, "the numbers of verdicts are not those of the cases"),
        ({"cases": (), "counts": {}}, "the verdict does not follow from the cases"),
        ({"verdict": Conclusion.CONFORMANT}, "the verdict does not follow from the cases"),
        ({"cases": (FAILED, FAILED)}, "case 4.15/3 occurs more than once"),
    ],
)
def test_results_that_contradict_themselves(
    refused: Callable[..., str], tmp_path: Path, change: dict[str, Any], problem: str
) -> None:
    """They were altered by hand; without cases they would pass."""
    file = tmp_path / "results.json"
    replace(results_of(FAILED), **change).write(file)
    good = f"{written(tmp_path / 'good.json', FAILED)}"
    for arguments in (
        ("gate", f"{file}"),
        ("compare", good, f"{file}"),
        ("compare", f"{file}", good),
        ("merge", f"{file}", good, "--out", f"{tmp_path / 'out'}"),
    ):
        assert f"results.json was altered: {problem}" in refused(*arguments)


HOSTILE = "程序\n::error::done ##[stop-commands]x | <b>`</testsuites>%0A::warning::,]]>"


def test_hostile_text(
    gate: Callable[..., tuple[int, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Text of the subject is no command of GitHub, and no markup of a report."""
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    case = replace(failed("4.15/3", "the name is {name}", name=HOSTILE), title=HOSTILE)
    results, files = tmp_path / "results.json", [tmp_path / f"file-{n}" for n in range(4)]
    plain = results_of(case)
    replace(plain, subject=replace(plain.subject, name=HOSTILE, version=HOSTILE)).write(results)
    options = ("--summary", "--junit", "--ctrf", "--code-quality")
    arguments = [part for pair in zip(options, files, strict=True) for part in pair]
    status, text = gate(results, *arguments)
    assert status == 1
    commands = [line for line in text.splitlines() if line.lstrip().startswith("::")]
    assert len(commands) == 1
    assert commands[0].startswith(
        "::error title=scaraspec%3A new failure 4.15/3::the name is 程序%0A"
    )
    assert "%250A" in commands[0]
    assert "##[" not in text.replace(commands[0], "")
    summary = files[0].read_text("utf-8")
    assert r" ::error::done \#\#\[stop-commands\]x \| \<b\>\`\</testsuites\>%0A" in summary
    (suite,) = ET.parse(files[1]).getroot()
    assert HOSTILE.split("\n")[1] in suite.findall(".//failure")[0].attrib["message"]
    assert HOSTILE in json.loads(files[2].read_text("utf-8"))["results"]["tests"][0]["message"]
    (entry,) = json.loads(files[3].read_text("utf-8"))
    assert HOSTILE in entry["description"]


def test_old_results(refused: Callable[..., str], tmp_path: Path) -> None:
    """Failures without fingerprints cannot be compared; the file is named."""
    old = f"{written(tmp_path / 'old.json', replace(FAILED, fingerprint=''))}"
    new = f"{written(tmp_path / 'new.json', FAILED)}"
    for arguments in (("gate", old), ("gate", new, "--baseline", old), ("compare", new, old)):
        assert "old.json: the results are of an old version of scaraspec" in refused(*arguments)


def test_inconclusive_results_are_no_baseline(
    gate: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    """A baseline of them would accept that less is tested."""
    results, baseline = tmp_path / "results.json", tmp_path / "baseline.json"
    results_of().write(results)
    status, text = gate(results, "--baseline", baseline, "--update")
    assert status == 4
    assert "is not updated" in text
    assert not baseline.exists()
    assert Results.read(results).verdict.value == "nothing-tested"
