"""The documentation is built as a site without warnings, and needs nothing from another host."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from wording import ROOT

from scaraspec.judge.requirements import REQUIREMENTS

pytestmark = pytest.mark.runs

_LOADED = re.compile(r'<(?:script|link|img|iframe|source)[^>]*(?:src|href)="((?:https?:)?//[^"]+)"')
_LOADED_BY_STYLE = re.compile(r"url\(\"?((?:https?:)?//[^)]+)\)|@import")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built with all warnings as errors: also for missing pages and anchors."""
    folder = tmp_path_factory.mktemp("site")
    config = folder / "mkdocs.yml"
    relative = {"reports/out/docs": "docs", "reports/out/site": "site"}
    text = (ROOT / "mkdocs.yml").read_text("utf-8").replace("[conformance, recorder]", "PATHS")
    for old, new in relative.items():
        text = text.replace(old, new)
    paths = json.dumps([f"{ROOT / name}" for name in ("conformance", "recorder")])
    config.write_text(text.replace("PATHS", paths), "utf-8")
    for command in (
        ("docs.assemble", f"{folder / 'docs'}"),
        ("mkdocs", "build", "--strict", "--config-file", f"{config}"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", *command],
            cwd=ROOT,
            env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "site"


def _index(site: Path) -> list[dict[str, Any]]:
    text = (site / "search/search_index.js").read_text("utf-8").removeprefix("var __index = ")
    docs: list[dict[str, Any]] = json.loads(text)["docs"]
    return docs


def test_nothing_is_loaded_from_another_host(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 100
    for page in pages:
        assert _LOADED.findall(page.read_text("utf-8")) == [], page
    for style in site.rglob("*.css"):
        assert _LOADED_BY_STYLE.findall(style.read_text("utf-8")) == [], style


def test_search_index_without_a_server(site: Path) -> None:
    """It has each page once, and the words of Chinese text."""
    docs = _index(site)
    assert len({each["location"] for each in docs}) == len(docs)
    (stop,) = (each for each in docs if each["location"].endswith("#0x32-emergency_stop"))
    assert stop["location"] == "reference/commands.html#0x32-emergency_stop"
    chinese = next(each for each in docs if each["location"] == "zh/waivers.html")
    assert "\u200b豁免\u200b" in chinese["text"]


def test_the_reference_is_complete(site: Path) -> None:
    """Each requirement and each option of a command is in the reference."""
    requirements = (site / "reference/requirements.html").read_text("utf-8")
    assert [each for each in REQUIREMENTS if f"<td>{each}</td>" not in requirements] == []
    assert "--exhaustive" in (site / "reference/command-line.html").read_text("utf-8")


def test_chinese_pages_link_to_each_other(site: Path) -> None:
    page = (site / "zh/index.html").read_text("utf-8")
    assert 'href="tutorial-certify.html"' in page
    assert 'lang="zh"' in page
