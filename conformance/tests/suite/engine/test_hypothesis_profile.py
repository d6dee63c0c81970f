"""The seed alone determines the drawn values."""

import sys
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.suite.engine.hypothesis_profile import HypothesisProfile

EXAMPLES = 50


def _drawn() -> list[tuple[str, int]]:
    taken = []
    with HypothesisProfile(EXAMPLES, seed=0):

        @given(st.text(), st.integers())
        def draw(text: str, number: int) -> None:
            taken.append((text, number))

        draw()
    return taken


def test_other_modules_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Constants in a module beside the source tree change nothing."""
    before = _drawn()
    path = tmp_path / "lying_about.py"
    path.write_text("\n".join(f"C{n} = 'constant {n}', {n * 7919}" for n in range(400)))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, path.stem, import_module(path.stem))
    assert _drawn() == before
    assert len(before) == EXAMPLES
