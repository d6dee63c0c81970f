"""Citations of the protocol document, the register and the catalogue resolve; spec/ is current."""

import importlib.util
import re
from pathlib import Path

import pytest

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.register import register

ROOT = Path(__file__).parents[2]
_LINES_OF_THE_DOCUMENT = 1045
_ENTRY = re.compile(r"\bA-(?:[0-9]+(?:\.[0-9]+[ab]?)?|T)-[0-9]+\b")
_LINE = re.compile(r"\bL([0-9]{2,4})\b")


def _texts() -> list[tuple[Path, str]]:
    files = [
        *ROOT.glob("conformance/**/*.py"),
        *ROOT.glob("recorder/**/*.py"),
        *ROOT.glob("docs/**/*.md"),
        *ROOT.glob("spec/*.md"),
        ROOT / "README.md",
        ROOT / "README.zh-CN.md",
        ROOT / "CHANGELOG.md",
    ]
    return [(file, file.read_text("utf-8")) for file in files]


def test_cited_register_entries_exist() -> None:
    """Each ``A-…`` in code and documentation is an entry of the register."""
    unknown = {
        f"{file.relative_to(ROOT)}: {entry}"
        for file, text in _texts()
        for entry in _ENTRY.findall(text)
        if entry not in register()
    }
    assert not unknown


def test_cited_lines_exist() -> None:
    """Each ``L…`` is a line of the document."""
    unknown = {
        f"{file.relative_to(ROOT)}: L{number}"
        for file, text in _texts()
        for number in _LINE.findall(text)
        if not 1 <= int(number) <= _LINES_OF_THE_DOCUMENT
    }
    assert not unknown


def test_requirements_cite_entries_of_the_register() -> None:
    """The catalogue cites no unknown entry."""
    cited = {entry for found in REQUIREMENTS.values() for entry in found.register}
    assert cited <= register().keys()


@pytest.mark.parametrize("page", ["register.md", "requirements.md", "tables.md"])
def test_generated_pages_are_current(page: str) -> None:
    """If this fails, run ``make spec``."""
    found = importlib.util.spec_from_file_location("generate", ROOT / "spec/generate.py")
    assert found
    assert found.loader
    generate = importlib.util.module_from_spec(found)
    found.loader.exec_module(generate)
    assert (ROOT / "spec" / page).read_text("utf-8") == generate.PAGES[page]()
