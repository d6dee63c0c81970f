"""`scaraspec cases` on the command line."""

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from scaraspec.cli.main import group
from scaraspec.cli.problems import Problem
from scaraspec.report.model import Role
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import Options


def run(*arguments: str) -> Result:
    """Run the command with these arguments."""
    return CliRunner().invoke(group, ["cases", *arguments])


def test_one_case() -> None:
    """All details of one case are printed."""
    shown = run("4.15/2.fault")
    assert shown.exit_code == 0
    text = " ".join(shown.output.split())
    for part in (
        'A robot with a failed inner arm motor refuses to run a program with "0|11".',
        "4.15/2: ",
        "「",
        "--allow state,motion",
        "the hook motor_fault of the ICS: it causes a motor fault",
        "a program runs although a motor has failed (expected: 0|11)",
        "upload_name, upload_chunk",
        "test_4_15_run_program.py:",
    ):
        assert part in text, part


def test_decisions() -> None:
    """The decisions about a case are printed with it."""
    text = " ".join(run("5.2/7", "--role", "client").output.split())
    assert "decision of 2026-11-26 repaired Does a client that polls send a chunk" in text
    assert "decision of" not in run("2/5", "--role", "client").output


def test_selection() -> None:
    """`--only` selects as in `certify`, from the cases of one role or of both."""
    both = run("--only", "2/5").output
    client = run("--only", "2/5", "--role", "client").output
    assert "2/5.slow  client" in client
    assert "controller" not in client
    assert client.splitlines()[0] in both
    assert "2/5  controller" in both


def test_requirement_of_one_role() -> None:
    """A requirement that can be tested for one role only selects the cases of that role."""
    assert run("--only", "8/2").output.count("  controller;") > 1


def test_id_of_a_requirement() -> None:
    """The id of a requirement lists its cases, unless a case has the same id."""
    assert run("4.17/3").output == run("--only", "4.17/3").output
    assert "4.17/3.again  controller" in run("4.17/3").output
    assert "test_2" in run("2/5", "--role", "client").output


def test_specification(tmp_path: Path) -> None:
    """The page contains each case of both roles once, with its requirements."""
    page = tmp_path / "specification.html"
    done = run("--html", str(page))
    count = sum(len(collect(Options(), role)) for role in (Role.CONTROLLER, Role.CLIENT))
    assert done.output.endswith(f"{count} cases\n")
    text = page.read_text("utf-8")
    assert text.count("<article>") == count
    assert text.count("<dt>judges</dt>") == count
    assert "<script" not in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["4.15/9x"], "there is no case '4.15/9x', did you mean"),
        (["6.5/3"], "no case is selected: 6.5/3 cannot be tested"),
        (["4.15/7", "--only", "4.15"], "ID cannot be combined with --only"),
        (["--only", "4.99"], "no case is selected: "),
        (["4.15/7", "--html", "/nowhere/page.html"], "/nowhere/page.html cannot be written"),
    ],
)
def test_mistakes(arguments: list[str], message: str) -> None:
    """Each error message is one sentence."""
    problem = run(*arguments).exception
    assert isinstance(problem, Problem)
    assert f"{problem}".startswith(message)
    assert problem.exit_status == (3 if "--html" in arguments else 2)
