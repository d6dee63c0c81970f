"""What cannot be seen is shown, what can be seen is left alone."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.report.sanitizing import visible


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
def test_each_unseen_character_becomes_its_code(text: str, shown: str) -> None:
    """A reader sees that something is there, and what."""
    assert visible(text) == shown


@given(st.text(st.characters(exclude_categories=())))
def test_nothing_that_acts_is_left(text: str) -> None:
    """No control, no override of direction, no surrogate, whatever the text."""
    left = visible(text)
    assert not [c for c in left if unicodedata.category(c) in ("Cc", "Cs") and c not in "\n\t"]
    assert not [c for c in left if unicodedata.bidirectional(c) in ("RLO", "LRO", "RLE", "RLI")]
    left.encode()


def test_a_huge_text_is_cut() -> None:
    """A page is not drowned by one message."""
    assert visible("x" * 10_003) == "x" * 10_000 + "… (+3)"
