"""Collect the pages of the site in one folder (`make site`): docs, generated reference, copies.

    python -m docs.assemble reports/out/docs

Pages of other folders get a place in the site. A link to a page follows it there. A link to another
file of the repository leads to a copy of that file, so the site is complete without the repository.
A link to a folder leads to its README, or is removed if it has none.
"""

import argparse
import os
import re
import shutil
from pathlib import Path
from typing import Final

from docs.reference import PAGES
from pymdownx.slugs import slugify  # type: ignore[import-untyped] # it ships no types

ROOT: Final = Path(__file__).parents[1]
COPIED: Final = {
    "spec/README.md": "reference/document.md",
    "spec/register.md": "reference/register.md",
    "spec/requirements.md": "reference/requirements.md",
    "spec/tables.md": "reference/tables.md",
    "spec/glossary.md": "reference/glossary.md",
    "spec/examples.md": "reference/examples.md",
    "fixtures/drivers/README.md": "reference/driver-protocol.md",
    "bench/README.md": "benchmarks.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
}
"""Pages outside of `docs`, and their place in the site."""

_LINK: Final = re.compile(r"\[([^\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")
_OTHER_LANGUAGE: Final = re.compile(r"^\[(?:中文|English)\]\(.*\)\n\n", re.MULTILINE)
"""The link to the same page in the other language; the site has a switch for the language."""
_HEADING: Final = re.compile(r"^##+ (.+)$", re.MULTILINE)
_CHINESE: Final = ".zh.md"
_FENCED: Final = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)


class Site:
    """The folder that MkDocs reads.

    Args:
        folder: The folder; it is deleted first.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        shutil.rmtree(folder, ignore_errors=True)
        own = [file for file in (ROOT / "docs").rglob("*") if file.suffix in _SITE_FILES]
        self._pages = {file: file.relative_to(ROOT / "docs") for file in own}
        self._pages |= {ROOT / source: Path(place) for source, place in COPIED.items()}

    def write(self) -> None:
        """Write all pages, and the files to which they link."""
        for source, place in list(self._pages.items()):
            if source.suffix == ".md":
                self._write(place, self._rewritten(source, place))
            else:
                self._copy(source, place)
        for name, lines in PAGES.items():
            self._write(Path("reference", name), "\n".join(lines()) + "\n")

    def _write(self, place: Path, text: str) -> None:
        target = self._folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, "utf-8")

    def _copy(self, source: Path, place: Path) -> None:
        target = self._folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)

    def _rewritten(self, source: Path, place: Path) -> str:
        """Return a page with links that lead to the places in the site."""

        def link(match: re.Match[str]) -> str:
            target = (source.parent / match[2]).resolve()
            if target.is_dir():
                target /= "README.md"
                if not target.exists():
                    return match[1]
            if not target.exists():
                return match[0]  # MkDocs reports it
            relative = os.path.relpath(self._place(target), place.parent)
            return f"[{match[1]}]({relative}{match[3] or ''})"

        text = _OTHER_LANGUAGE.sub("", source.read_text("utf-8"))
        if source.name.endswith(_CHINESE):
            text = _with_anchors(text, source.with_name(source.name.replace(_CHINESE, ".md")))
        parts = _FENCED.split(text)
        return "".join(
            part if index % 2 else _LINK.sub(link, part) for index, part in enumerate(parts)
        )

    def _place(self, target: Path) -> Path:
        """Return the place of a file; copy it into the site if it is no page."""
        if target not in self._pages:
            place = Path("files", target.relative_to(ROOT))
            self._copy(target, place)
            self._pages[target] = place
        return self._pages[target]


def _with_anchors(text: str, english: Path) -> str:
    """Return a Chinese page whose sections have the anchors of the English page, too.

    English pages without a translation are part of the Chinese site, and link to these anchors.
    """
    headings = iter(_HEADING.findall(_FENCED.sub("", english.read_text("utf-8"))))
    slug = slugify(case="lower")

    def anchor(match: re.Match[str]) -> str:
        return f'<a id="{slug(next(headings), "-")}"></a>\n\n{match[0]}'

    parts = _FENCED.split(text)
    return "".join(
        part if index % 2 else _HEADING.sub(anchor, part) for index, part in enumerate(parts)
    )


_SITE_FILES: Final = {".md", ".png", ".svg", ".css", ".js"}


def main() -> None:
    """Write the folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where to write; the folder is deleted first")
    Site(parser.parse_args().folder).write()


if __name__ == "__main__":
    main()
