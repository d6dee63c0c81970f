"""With `--language zh`, no command prints an English sentence. Names and identifiers stay."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from html import unescape
from pathlib import Path

import pytest

from scaraspec.protocol.commands import COMMANDS

_WORD = re.compile(r"(?<![\w./=_<>-])[A-Za-z][a-z]{2,}(?![\w/=_<>-]|\.\w)")
"""A word that is not a part of a path, an option or an identifier."""
_NAMES = {name for command in COMMANDS for name in command.name.split("_")} | {
    field.name
    for command in COMMANDS
    for payload in (command.request, command.reply)
    for field in payload.fields
}
"""Names of commands and of fields, which are the same in every language."""


_STRUCTURES = (
    *("Char", "counts", "data", "inf", "int", "length", "nan", "operation", "opt", "point"),
    *("points", "ports", "result", "sizeof"),
)
"""Names in the structures of the document, and texts of numbers."""


def shown(*arguments: str | Path, stream: str = "stdout") -> str:
    """Return what a command prints in Chinese."""
    done = subprocess.run(
        [sys.executable, "-m", "scaraspec", "--language", "zh", *map(str, arguments)],
        capture_output=True,
        check=False,
        encoding="utf-8",
        env={**os.environ, "PYTHONUTF8": "1", "COLUMNS": "200"},
    )
    assert done.returncode in range(5), done.stderr
    assert "Traceback" not in done.stderr
    return f"{getattr(done, stream)}"


def english(text: str, *names: str) -> list[str]:
    """Return the lines of a text that have an English word besides the names."""
    return [line for line in text.splitlines() if {*_words(line)} - _NAMES - {*names}]


def _words(line: str) -> Iterator[str]:
    return (match[0] for match in _WORD.finditer(line))


@pytest.mark.parametrize("capture", ["complaint-1", "plant-a-torn", "plant-b-other-dialect"])
@pytest.mark.parametrize("options", [(), ("--frames",), ("--latency",)])
def test_exchanges(fixtures_dir: Path, capture: str, options: tuple[str, ...]) -> None:
    """Events, frames, findings, remarks and heads of columns."""
    text = shown("exchanges", fixtures_dir / f"captures/field/{capture}.pcapng", *options)
    assert english(text) == []


def test_requirements() -> None:
    """The list, requirements and register entries; names of the structures of the document stay."""
    program = ("scaraspec", "program", "check")
    assert english(shown("requirements"), *_STRUCTURES, *program) == []
    for entry in ("4.15/2", "4/16", "A-3-14", "A-4.16-1", "A-5-4", "A-T-1"):
        text = shown("requirements", "--entry", entry)
        assert english(text, *_STRUCTURES, "pipelining") == []


def test_cases(tmp_path: Path) -> None:
    """The list, one case with a decision, and the test specification of all cases."""
    assert english(shown("cases"), *_STRUCTURES) == []
    assert english(shown("cases", "5.2/7", "--role", "client"), "lacks", "Python") == []
    page = tmp_path / "specification.html"
    shown("cases", "--html", page)
    text = unescape(page.read_text("utf-8").partition("<body>")[2])
    values = re.compile("<dt>取值</dt>.*|「.*?」|{[^}]*}|<[^>]*>|'.*?'")
    names = ("scaraspec", "state", "motion", "destructive", "lacks", "Python")
    expression = ("each", "for", "opcodes", "sorted")  # in one criterion
    assert english(values.sub("", text), *_STRUCTURES, *names, *expression) == []


def test_audit(fixtures_dir: Path) -> None:
    """The summary of one capture, and of several."""
    field = fixtures_dir / "captures/field"
    for name in ("complaint-1", "complaint-2", "plant-a-torn"):
        text = shown("audit", field / f"{name}.pcapng")
        assert english(text, "scaraspec", "view", "ip", "mask", "gateway") == []
    files = (field / f"complaint-{number}.pcapng" for number in (1, 2, 4))
    assert english(shown("audit", *files), *_STRUCTURES, "position") == []


def test_compared_values(fixtures_dir: Path, tmp_path: Path) -> None:
    """What was expected and observed, on the terminal and in the columns of the page."""
    page = tmp_path / "report.html"
    capture = fixtures_dir / "captures/field/complaint-3.pcapng"
    text = shown("audit", capture, "--html", page)
    compared = re.findall("应为：(.*?)；实为：(.*?)）", text)
    assert "76800 字节，位置 65600 处：40 41 42 43 44 45 46 47" in {each for each, _ in compared}
    assert english("\n".join(map("\n".join, compared))) == []
    columns = re.findall(r"<h3>.*?</h3><pre[^>]*>(.*?)</pre>", page.read_text("utf-8"), re.DOTALL)
    chinese = re.findall('<span class="zh"[^>]*>(.*?)</span>', "".join(columns))
    assert any("字节，位置" in each for each in chinese)
    assert english("\n".join(chinese)) == []


def test_summaries_in_markdown(fixtures_dir: Path, tmp_path: Path) -> None:
    """The summaries of `gate` and `compare`, and what these commands print."""
    results, markdown = tmp_path / "results.json", tmp_path / "summary.md"
    before, after = (
        fixtures_dir / f"captures/field/{name}.pcapng"
        for name in ("complaint-1", "plant-a-morning-shift")
    )
    shown("audit", before, "--json", results)
    text = shown("gate", results, "--summary", markdown)
    text += shown("compare", before, after, "--summary", markdown)
    text += shown("compare", results, results, "--summary", markdown)
    text += markdown.read_text("utf-8").replace("\\", "")
    assert english(text, "scaraspec", "audit", *_OPTIONS) == []
    assert "没有差别。" in text


_OPTIONS = ("ascii", "code", "first", "full", "little", "packed")
"""Options of readings."""


def test_frame() -> None:
    """Each kind of frame, and bytes that are no frame."""
    frames = ("AA0900CC", "CC09023030AA", "CC90300231CC", "AA1300CC", "CC0B0130AA", "00")
    text = shown("frame", *frames)
    assert english(text) == []


def test_program_check(fixtures_dir: Path) -> None:
    """Findings with their positions; names of fields stay."""
    folder = fixtures_dir / "programs/damaged"
    text = "".join(shown("program", "check", file) for file in sorted(folder.glob("*.rob")))
    assert english(text, *_STRUCTURES, "records") == []


def test_call() -> None:
    """Results with words."""
    with running_controller() as url:
        text = "".join(shown("call", url, *command.split()) for command in _CALLS)
        text += shown("call", url, "get_status", "1", stream="stderr")
    assert english(text, "scaraspec") == []


_CALLS = (
    *("get_status", "get_running_program", "get_default_program", "list_programs"),
    *("get_digital_inputs", "set_time 20260101000000"),
)


@contextmanager
def running_controller() -> Iterator[str]:
    """Run a virtual controller on a free port; its URL."""
    command = [sys.executable, "-m", "scaraspec", "controller", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        url = process.stdout.readline().split()[-1]
        try:
            yield url
        finally:
            process.terminate()


def test_prove() -> None:
    """The list of mutants; some sentences quote words of a reply."""
    for role in ("controller", "client"):
        text = shown("prove", "--list", "--role", role)
        lines = [line.partition("：")[2] for line in text.splitlines()]
        quoted = ("success", "fail", "none", "force", "quit", "true", "false", "tcp")
        other = ("atof", "strtod", "unreachable", "main", "rob", "Latin", "sim")
        assert english("\n".join(lines), *_STRUCTURES, *quoted, *other, "position") == []


def test_program_show(fixtures_dir: Path) -> None:
    """A listing; axes and names of variables stay."""
    text = shown("program", "show", fixtures_dir / "programs/every-node.ilp32.rob")
    text = re.sub('"[^"]*"', "", text)  # aliases
    assert english(text, "count", "limit", *_STRUCTURES) == []
