"""Texts use plain words; messages for the user are templates."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from wording import AVOIDED, ROOT, counts

from scaraspec.cli.main import COMMANDS, group
from scaraspec.mutants import client as client_mutants
from scaraspec.mutants import controller as controller_mutants

PAGES = sorted(
    file
    for pattern in (
        "*.md",
        "docs/**/*.md",
        "spec/README.md",
        "spec/glossary.md",
        "bench/*.md",
        "fixtures/drivers/*.md",
    )
    for file in ROOT.glob(pattern)
    if file.name != "README.zh-CN.md"
)
RATCHET = Path(__file__).with_name("wording.json")
_RAISES_MESSAGES = {
    "failed": (0,),
    "inconclusive": (0,),
    "tolerated": (2,),
    "tolerate": (2, 3),
    "expect": (1,),
    "expect_equal": (2,),
    "expect_in": (2,),
    "CaseFailed": (0,),
    "CaseInconclusive": (0,),
    "CaseSkipped": (0,),
    "Problem": (0,),
}
"""Functions that take a message for the user, and the positions of it."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages(page: Path) -> None:
    """README, CHANGELOG and documentation avoid the listed words."""
    found = {match.group() for match in AVOIDED.finditer(page.read_text("utf-8"))}
    assert not found


def test_spelling() -> None:
    """codespell finds no typing error; `[tool.codespell]` in pyproject.toml lists exceptions."""
    checked = (
        *(str(page) for page in PAGES),
        "conformance/scaraspec",
        "recorder/scaraspec_recorder",
    )
    done = subprocess.run(
        [sys.executable, "-m", "codespell_lib", "--skip", "*.json,*.pyc", *checked],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def _helps(command: click.Command, name: str) -> Iterator[tuple[str, str]]:
    context = click.Context(command, info_name=name)
    yield name, command.get_help(context)
    if isinstance(command, click.Group) and command is not group:
        for part in command.list_commands(context):
            below = command.get_command(context, part)
            assert below
            yield from _helps(below, f"{name} {part}")


@pytest.mark.parametrize("name", COMMANDS)
def test_help(name: str) -> None:
    """Help texts avoid the listed words."""
    command = group.get_command(click.Context(group), name)
    assert command
    for path, text in _helps(command, name):
        assert not AVOIDED.findall(text), path


def test_docstrings_and_comments() -> None:
    """The counts may only fall. If yours fell, write the new ones into wording.json."""
    allowed = json.loads(RATCHET.read_text("utf-8"))
    assert counts() == allowed


def test_messages_are_templates() -> None:
    """A message with values is a `UserMessage`, never an f-string."""
    packages = ("conformance/scaraspec", "recorder/scaraspec_recorder")
    files = (file for package in packages for file in (ROOT / package).rglob("*.py"))
    assert [place for file in files for place in _f_strings(file)] == []


def _f_strings(file: Path) -> list[str]:
    text = file.read_text("utf-8")
    if not any(name in text for name in _RAISES_MESSAGES):
        return []
    return [
        f"{file.relative_to(ROOT)}:{node.lineno}"
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and _takes_f_string(node)
    ]


def _takes_f_string(call: ast.Call) -> bool:
    name = getattr(call.func, "id", None) or getattr(call.func, "attr", None) or ""
    positions = _RAISES_MESSAGES.get(name, ())
    return any(
        isinstance(call.args[position], ast.JoinedStr)
        for position in positions
        if position < len(call.args)
    )


def test_sentences_of_mutants() -> None:
    """The sentences that `prove --list` prints avoid the listed words."""
    for package in (controller_mutants, client_mutants):
        for mutant in package.mutants().values():
            assert not AVOIDED.findall(mutant.sentence), mutant.name
