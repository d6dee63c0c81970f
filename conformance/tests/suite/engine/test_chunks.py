"""What is told of a chunk that stands elsewhere."""

import pytest

from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.engine.chunks import expect_chunk_position
from scaraspec.suite.engine.expectations import CaseFailed

_FILE = b"abcdabce"


@pytest.mark.parametrize(("position", "data"), [(0, b"abcd"), (4, b"abc"), (7, b"e")])
def test_a_chunk_may_recur(position: int, data: bytes) -> None:
    """What stands at several places may be told of each."""
    expect_chunk_position(Chunk(len(_FILE), position, len(data), data), _FILE)


@pytest.mark.parametrize(
    ("position", "data", "expected", "observed"),
    [
        (1, b"abcd", "0", "1"),
        (0, b"zzz", "data of the file", "0, with data that is not in the file"),
        (8, b"", "data of the file", "8, with data that is not in the file"),
    ],
)
def test_the_right_place_is_told(position: int, data: bytes, expected: str, observed: str) -> None:
    """No place is named where there is none."""
    with pytest.raises(CaseFailed) as caught:
        expect_chunk_position(Chunk(len(_FILE), position, len(data), data), _FILE)
    assert (caught.value.expected, caught.value.observed) == (expected, observed)
