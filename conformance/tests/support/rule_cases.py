"""The cases in the tests of all rules: requirement, expected verdict, and session."""

import runpy
from itertools import chain
from pathlib import Path

_TESTS = Path(__file__).parents[1] / "judge"
_FILES = sorted((*_TESTS.glob("test_rules_*.py"), *_TESTS.glob("rules/test_*.py")))

TABLES = [runpy.run_path(str(path)) for path in _FILES]
"""The names in each of these files."""

CASES: tuple[tuple[str, str, str], ...] = tuple(
    chain.from_iterable(table.get("CASES", ()) for table in TABLES)
)
SESSIONS = sorted({session for _, _, session in CASES})
