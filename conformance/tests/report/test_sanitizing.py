"""Invisible characters become visible; all other characters are unchanged."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.report.sanitizing import visible, visible_line


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred", "⟨U+001B⟩[31mred"),
        ("a\r\nb\tc", "a⟨U+000D⟩\nb\tc"),
        ("exe.\u202etxt", "exe.⟨U+202E⟩txt"),
        ("a\u200bb\ufeff", "a⟨U+200B⟩b⟨U+FEFF⟩"),
        ("\x7f\x9b\u2028", "⟨U+007F⟩⟨U+009B⟩⟨U+2028⟩"),
        ("\ud800 \uffff \U0010ffff", "⟨U+D800⟩ ⟨U+FFFF⟩ ⟨U+10FFFF⟩"),
        ("程序.rob שלום é 🤖", "程序.rob שלום é 🤖"),
    ],
)
def test_invisible_characters(text: str, shown: str) -> None:
    """They are replaced by their code points."""
    assert visible(text) == shown


@given(st.text(st.characters(exclude_categories=())))
def test_any_text(text: str) -> None:
    """The result has no control character, direction override or surrogate."""
    left = visible(text)
    assert not [c for c in left if unicodedata.category(c) in ("Cc", "Cs") and c not in "\n\t"]
    assert not [c for c in left if unicodedata.bidirectional(c) in ("RLO", "LRO", "RLE", "RLI")]
    left.encode()


def test_a_long_text_is_truncated() -> None:
    """The number of omitted characters is shown."""
    assert visible("x" * 10_003) == "x" * 10_000 + "… (+3)"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("wrong\n::error::done", "wrong⟨U+000A⟩::error::done"),
        ("x##[stop-commands]", "x#⟨U+0023⟩[stop-commands]"),
        ("##vso[task.complete]", "#⟨U+0023⟩vso[task.complete]"),
        ("a ## b, #[1], C#", "a ## b, #[1], C#"),
    ],
)
def test_no_command_of_a_ci_system(text: str, shown: str) -> None:
    """The text begins no line of the output, and has none of their marks."""
    assert visible_line(text) == shown
