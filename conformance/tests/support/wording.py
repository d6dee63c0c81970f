"""Words that documentation and docstrings of this project avoid, and where they occur."""

import ast
import re
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[3]

AVOIDED: Final = re.compile(
    r"\b("
    r"told|tells|says of|its say|gives? away|"
    r"behind|"
    r"whoever|nobody|somebody|anybody|he|him|his|"
    r"anew|for ever|in vain|meanwhile|thereof|lest|heeds?|be it|all the same|made up for|"
    r"stands in|stand in|lives in|live in|is to be|are to be|wants|"
    r"held against|let off|excused|"
    r"what takes long|what is left out|what is left|"
    r"may die of|before its end"
    r")\b",
    re.IGNORECASE,
)
"""Each has a plain word: reports, after, the caller, again, during, is in, must, tolerated …"""

PACKAGES: Final = (
    *sorted(
        folder
        for folder in (ROOT / "conformance/scaraspec").iterdir()
        if folder.is_dir() and folder.name != "__pycache__"
    ),
    ROOT / "recorder/scaraspec_recorder",
    ROOT / "conformance/tests",
    ROOT / "recorder/tests",
    ROOT / "bench",
)


def prose_of(file: Path) -> Iterator[str]:
    """Yield the docstrings and comments of a module; none if no avoided word is in it at all."""
    text = file.read_text("utf-8")
    if not AVOIDED.search(text):
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)
    with file.open("rb") as lines:
        for token in tokenize.tokenize(lines.readline):
            if token.type == tokenize.COMMENT:
                yield token.string


def counts() -> dict[str, int]:
    """Return how often avoided words occur in the prose of each package."""
    found = Counter[str]()
    for package in PACKAGES:
        name = str(package.relative_to(ROOT))
        for file in package.rglob("*.py"):
            if file != Path(__file__):
                found[name] += sum(len(AVOIDED.findall(prose)) for prose in prose_of(file))
    return {name: count for name, count in sorted(found.items()) if count}
