"""Markdown: text and tables in which nothing of the SUT is taken for markup."""

from collections.abc import Iterable, Sequence
from typing import Final

from scaraspec.report.sanitizing import visible

_MARKUP: Final = str.maketrans({c: f"\\{c}" for c in "\\`*_[]<>|#&!"})


def escaped(text: str) -> str:
    """Return sanitized text in one line, with the characters of the markup escaped."""
    return " ".join(visible(text).split()).translate(_MARKUP)


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; its cells are escaped."""
    lines = [f"| {' | '.join(map(escaped, row))} |" for row in (headings, *rows)]
    return "\n".join((lines[0], "|---" * len(headings) + "|", *lines[1:]))
