"""The check of the position of a chunk."""

import pytest

from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.engine.chunks import expect_chunk_position
from scaraspec.suite.engine.expectations import CaseFailed

_FILE = b"abcdabce"


@pytest.mark.parametrize(("position", "data"), [(0, b"abcd"), (4, b"abc"), (7, b"e")])
def test_repeated_data_is_accepted_at_each_position(position: int, data: bytes) -> None:
    """Data that occurs several times in the file is valid at each of these positions."""
    expect_chunk_position(Chunk(len(_FILE), position, len(data), data), _FILE)


@pytest.mark.parametrize(
    ("position", "data", "expected", "observed"),
    [
        (1, b"abcd", "0", "1"),
        (0, b"zzz", "data of the file", "0, with data that is not in the file"),
        (8, b"", "data of the file", "8, with data that is not in the file"),
    ],
)
def test_wrong_position(position: int, data: bytes, expected: str, observed: str) -> None:
    """The failure names the correct position if the data is in the file."""
    with pytest.raises(CaseFailed) as caught:
        expect_chunk_position(Chunk(len(_FILE), position, len(data), data), _FILE)
    assert (caught.value.expected, caught.value.observed) == (expected, observed)
