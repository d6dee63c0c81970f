"""Segments: the same bytes, cut otherwise."""

from hypothesis import given
from hypothesis import strategies as st

from scaraspec.suite.controller.harness.malformed.delivery import split_bytes


@given(data=st.binary(min_size=1, max_size=80), sizes=st.lists(st.integers(1, 30), max_size=10))
def test_pieces_are_the_whole(data: bytes, sizes: list[int]) -> None:
    """Nothing is lost or added, no piece is empty, and each but the last has its size."""
    cut = split_bytes(data, sizes)
    assert b"".join(cut) == data
    assert all(cut)
    assert [len(piece) for piece in cut[:-1]] == sizes[: len(cut) - 1]
