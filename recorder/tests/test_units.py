"""Durations and sizes as text."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec_recorder.units import (
    SECOND_NS,
    Limits,
    QuantityError,
    parse_duration,
    parse_limits,
    parse_size,
    show_size,
)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("500ms", 0.5), ("30s", 30), ("1.5min", 90), (" 1 H ", 3600), ("30d", 30 * 86400)],
)
def test_parse_duration(text: str, seconds: float) -> None:
    """A number and a unit, in upper or lower case; spaces are allowed."""
    assert parse_duration(text) == seconds * SECOND_NS


@pytest.mark.parametrize(
    ("text", "size_bytes"),
    [("1B", 1), ("64kB", 64_000), ("512MB", 512_000_000), ("2GiB", 2**31), ("0.5tb", 5 * 10**11)],
)
def test_parse_size(text: str, size_bytes: int) -> None:
    """MB has 1000 kB, MiB has 1024 KiB."""
    assert parse_size(text) == size_bytes


@pytest.mark.parametrize(
    "text", ["", "1", "h", "-1h", "0s", "0MB", "1e9s", "1 fortnight", "1h30", "1" * 13 + "s", "１h"]
)
def test_invalid_text(text: str) -> None:
    """The error is one sentence."""
    with pytest.raises(QuantityError, match=r"is not a duration such as 500ms, 30s, 1h or 30d$"):
        parse_duration(text)
    with pytest.raises(QuantityError, match=r"is not a size such as 512MB or 2GiB$"):
        parse_size(text)
    with pytest.raises(QuantityError, match=r"neither a duration such as 1h nor a size"):
        parse_limits(text)


def test_parse_limits() -> None:
    """A duration, a size or both, each at most once."""
    assert parse_limits("1h") == Limits(3600 * SECOND_NS)
    assert parse_limits("1MB") == Limits(size_bytes=10**6)
    assert parse_limits("1MB, 1h") == Limits(3600 * SECOND_NS, 10**6)
    with pytest.raises(QuantityError, match=r"'1h,2h' has two limits of the same kind: use one"):
        parse_limits("1h,2h")


@given(st.text())
def test_any_text_is_a_quantity_or_an_error(text: str) -> None:
    """Any text gives a positive quantity or a `QuantityError`."""
    for parse in (parse_duration, parse_size):
        with suppress(QuantityError):
            assert parse(text) > 0


def test_format_size() -> None:
    """The text is short."""
    assert [show_size(n) for n in (5, 20_000_000_000, 1_500_000)] == ["5 bytes", "20 GB", "1.5 MB"]
