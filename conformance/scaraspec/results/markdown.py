"""Markdown: text and tables in which nothing of the SUT is taken for markup.

Lists and tables are in the display language.
"""

from collections.abc import Iterable, Sequence
from typing import Final

from scaraspec.report.sanitizing import visible
from scaraspec.translation import localized_value

_MARKUP: Final = str.maketrans({c: f"\\{c}" for c in "\\`*_[]<>|#&!"})


def escaped(text: str) -> str:
    """Return sanitized text in one line, with the characters of the markup escaped."""
    return " ".join(visible(text).split()).translate(_MARKUP)


def bullets(lines: Iterable[str]) -> str:
    """Return a list; its lines are escaped. It is empty without lines."""
    return "\n".join(f"- {escaped(localized_value(line))}" for line in lines)


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; its cells are escaped."""
    localized_rows = (map(localized_value, row) for row in (headings, *rows))
    lines = [f"| {' | '.join(map(escaped, row))} |" for row in localized_rows]
    return "\n".join((lines[0], "|---" * len(headings) + "|", *lines[1:]))
