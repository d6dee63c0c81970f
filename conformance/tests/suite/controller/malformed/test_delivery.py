"""The same bytes in different segments."""

from hypothesis import given
from hypothesis import strategies as st

from scaraspec.suite.controller.harness.outgoing_connection import split_bytes


@given(data=st.binary(min_size=1, max_size=80), sizes=st.lists(st.integers(1, 30), max_size=10))
def test_pieces_contain_all_bytes(data: bytes, sizes: list[int]) -> None:
    """The pieces contain all bytes, no piece is empty, and each but the last one has its size."""
    parts = split_bytes(data, sizes)
    assert b"".join(parts) == data
    assert all(parts)
    assert [len(piece) for piece in parts[:-1]] == sizes[: len(parts) - 1]
