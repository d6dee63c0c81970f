"""The commands of the documentation are run, or have a reason why not."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from documented_commands import Reader, blocks, variables_for
from wording import ROOT

from scaraspec.cli.main import COMMANDS, group

DOCS = sorted(page for page in ROOT.glob("docs/**/*.md") if not page.name.endswith(".zh.md"))
PAGES = [
    *DOCS,
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "fixtures/drivers/README.md")),
]
TRANSLATED = sorted(ROOT.glob("docs/*.zh.md"))
RUN = [
    page
    for page in PAGES
    if any(block.language == "sh" and "not run" not in block.marks for block in blocks(page))
]
LONG = (ROOT / "docs/tutorial-certify.md",)
"""A whole certification, which needs a quiet machine: `make test-tutorial`."""
_COMMAND = re.compile(r"(?:^|(?<=[\s`]))scaraspec ([^`\n]+(?:\\\n[^`\n]+)*)", re.MULTILINE)
_OPTION = re.compile(r"--[a-z][a-z-]*")
_COMMENT = re.compile(r"\s+#.*$", re.MULTILINE)


def _name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[str]:
    """The address HOST:PORT of a virtual controller in another process."""
    command = (
        *(sys.executable, "-m", "scaraspec", "controller", "--listen", "127.0.0.1:0"),
        *("--data", f"{tmp_path / 'robot'}"),
    )
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip().removeprefix("listening on tcp://")
        finally:
            process.terminate()


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.campaign if page in LONG else pytest.mark.runs)
        for page in RUN
    ],
    ids=map(_name, RUN),
)
def test_commands(page: Path, robot: str, tmp_path: Path) -> None:
    """The blocks of a page run in their order, in a new folder, with the extras that it names."""
    folder = tmp_path / "reader"
    folder.mkdir()
    assert Reader(folder, robot, variables_for(tmp_path, page)).follow(page)


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_each_block_is_run_or_has_a_reason(page: Path) -> None:
    """A block of commands has the language `sh`, so that it is run."""
    for block in blocks(page):
        assert block.language not in ("bash", "shell", "console"), block
        assert len(block.marks.get("not run", "a reason")) > len("root"), block


def _options(arguments: list[str]) -> Iterator[tuple[str, set[str]]]:
    """Yield the options of a command line, and those of the command that it names."""
    command: click.Command = group
    context = click.Context(group)
    while (
        isinstance(command, click.Group)
        and arguments
        and arguments[0] in {*command.list_commands(context)}
    ):
        found = command.get_command(context, arguments.pop(0))
        assert found
        command = found
    known = {name for each in command.get_params(context) for name in each.opts}
    for word in arguments:
        if option := _OPTION.match(word):
            yield option[0], known


@pytest.mark.parametrize("page", [*PAGES, *TRANSLATED, ROOT / "README.zh-CN.md"], ids=_name)
def test_options(page: Path) -> None:
    """Each `scaraspec COMMAND --option`, also within a sentence, exists."""
    for match in _COMMAND.finditer(_COMMENT.sub("", page.read_text("utf-8"))):
        words = re.split(r"[;|&>)]|\s#", match[1].replace("\\\n", " "))[0]
        try:
            arguments = shlex.split(words)
        except ValueError:
            continue
        if arguments and arguments[0] in COMMANDS:
            for option, known in _options(arguments):
                assert option in known, match[0]


@pytest.mark.parametrize("page", TRANSLATED, ids=_name)
def test_translation(page: Path) -> None:
    """A Chinese page has the sections, tables, commands and files of the English page."""
    english = page.with_name(page.name.replace(".zh.md", ".md"))

    def plain(page: Path) -> list[tuple[str, str, str]]:
        return [
            (block.language, block.file, _COMMENT.sub("", block.text)) for block in blocks(page)
        ]

    assert plain(page) == plain(english)
    for lines in (r"^##+ ", r"^\| ", r"^\|---"):
        counts = {
            len(re.findall(lines, each.read_text("utf-8"), re.MULTILINE))
            for each in (page, english)
        }
        assert len(counts) == 1, lines
