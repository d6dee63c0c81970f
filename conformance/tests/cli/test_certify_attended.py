"""`scaraspec certify controller --attended` on a terminal, with an operator."""

import os
import pty
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from scaraspec.report.model import Results

DRIVEN = "4.31/2.driven"
CTRL_C = "\x03"
TIMEOUT_S = 60


@pytest.fixture
def robot() -> Iterator[tuple[str, Callable[[str], None]]]:
    """Return the URL of a virtual controller, and a function that executes a console command."""
    command = [sys.executable, "-m", "scaraspec", "controller", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(
        [*command, "--control"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as process:
        assert process.stdin
        assert process.stdout
        keys, answers = process.stdin, process.stdout

        def execute(line: str) -> None:
            keys.write(f"{line}\n")
            while not answers.readline().startswith("ok"):
                pass

        try:
            yield answers.readline().split()[-1], execute
        finally:
            process.terminate()


def attend(url: str, out: Path, answer: Callable[[str], str], *more: str) -> tuple[int, list[str]]:
    """Run `certify controller --attended`; return the exit status and the lines shown.

    Args:
        url: The controller.
        out: The folder of the results.
        answer: Returns what the operator types after a request.
        more: Other options.
    """
    near, far = pty.openpty()
    command = [sys.executable, "-m", "scaraspec", "certify", "controller", url, "--attended"]
    options = ["--only", DRIVEN, "--out", str(out), "--state-dir", str(out.parent), *more]
    process = subprocess.Popen([*command, *options], stdin=far, stdout=far, stderr=far)
    os.close(far)
    shown = []
    with os.fdopen(near, "r", encoding="utf-8") as lines, suppress(OSError):
        for line in map(str.strip, lines):
            shown.append(line)
            if line.startswith("now: "):
                typed = answer(line.removeprefix("now: ").split(".")[0])
                if typed == CTRL_C:
                    process.send_signal(signal.SIGINT)
                else:
                    os.write(near, typed.encode())
    return process.wait(TIMEOUT_S), shown


def test_an_operator_sets_the_inputs(
    robot: tuple[str, Callable[[str], None]], tmp_path: Path
) -> None:
    """The requests, the replies and a note are in the results and in the report."""
    url, execute = robot

    def answer(request: str) -> str:
        for part in request.split("; "):
            _, _, _, port, _, value = part.split()
            execute(f"input {port} {value}")
        return "n the switch is stiff\n\n"

    status, shown = attend(url, tmp_path / "out", answer)
    assert status == 0, shown
    (case,) = Results.read(tmp_path / "out/results.json").cases
    assert case.verdict.value == "pass"
    assert {each.answer.value for each in case.operator} == {"done"}
    assert {each.notes for each in case.operator} == {("the switch is stiff",)}
    report = (tmp_path / "out/report.html").read_text("utf-8")
    assert "set digital input 1 to 1" in report
    assert "the switch is stiff" in report
    assert any("is asked about 9 times" in line for line in shown)
    assert any("n TEXT = note" in line for line in shown)


def test_an_operator_ends_the_run(robot: tuple[str, Callable[[str], None]], tmp_path: Path) -> None:
    """After Ctrl-C and "q" the operator must still reset the input; then everything is restored."""
    typed = iter((CTRL_C, "q\n"))
    status, shown = attend(robot[0], tmp_path / "out", lambda _: next(typed))
    assert status == 3, shown
    results = Results.read(tmp_path / "out/results.json")
    assert [case.id for case in results.cases] == ["run.interrupted"]
    assert not list(typed)


def test_without_a_terminal(refused: Callable[..., str]) -> None:
    """Nothing is sent; this address has no controller."""
    error = refused("certify", "controller", "tcp://127.0.0.1:1", "--attended", "--only", DRIVEN)
    assert "stdin is no terminal" in error
