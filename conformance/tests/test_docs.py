"""Paths and commands in the documentation exist."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest
from wording import ROOT

from scaraspec.suite.engine.ics_check import problems_of

PAGES = ("docs/architecture.md", "CONTRIBUTING.md", "SECURITY.md", "README.md", "spec/README.md")
_PATH = re.compile(r"`((?:recorder: )?[\w./*<>-]+(?:\.py|\.toml|\.jsonl|/))`")
_BASES = (
    ROOT,
    ROOT / "conformance",
    ROOT / "conformance/scaraspec",
    ROOT / "conformance/scaraspec/suite/controller/harness",
    ROOT / "recorder/scaraspec_recorder",
)
_WRITTEN_AT_RUN_TIME = {"contents.jsonl", "reports/out/"}


def _exists(path: str) -> bool:
    pattern = re.sub(r"<\w+>", "*", path.removeprefix("recorder: ").strip("/"))
    return any(next(iter(base.glob(pattern)), None) for base in _BASES)


@pytest.mark.parametrize("page", PAGES)
def test_paths(page: str) -> None:
    """Each path in backticks is a file or folder of the repository."""
    paths = set(_PATH.findall((ROOT / page).read_text("utf-8"))) - _WRITTEN_AT_RUN_TIME
    assert {path for path in paths if "/" in path.strip("/") and not _exists(path)} == set()


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/*.md")), ids=lambda page: page.name)
def test_links(page: Path) -> None:
    """Each relative link leads to a file."""
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize(
    "page", sorted({*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")}), ids=lambda page: page.name
)
def test_toml(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each TOML block is valid; `scaraspec ics check` accepts each ICS."""
    for program in ("ssh", "io-box", "sh"):  # hooks
        (tmp_path / program).touch(mode=0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}")
    for block in re.findall(r"```toml\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
        document = tomllib.loads(block)
        if document.keys() & {"subject", "sample", "hooks"}:
            assert problems_of(document) == []


def test_make_targets() -> None:
    """Each ``make`` target that README, CONTRIBUTING and docs name exists."""
    makefile = (ROOT / "Makefile").read_text("utf-8")
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md")]
    named = {
        target
        for page in pages
        for target in re.findall(r"\bmake ([a-z-]+)", page.read_text("utf-8"))
        if f"`make {target}" in page.read_text("utf-8")
    }
    rules = "\n".join(line for line in makefile.splitlines() if re.match(r"[\w .-]+:", line))
    assert {target for target in named if not re.search(rf"\b{target}\b", rules)} == set()


def test_picture_of_the_packages() -> None:
    """`make pictures` draws it from the contract in pyproject.toml."""
    packages = runpy.run_path(f"{ROOT / 'docs/pictures.py'}")["packages"]
    assert (ROOT / "docs/packages.svg").read_text("utf-8").splitlines() == list(packages())
