"""Chunks: what is checked of each chunk that a subject sends, whichever way the file goes."""

from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA_BYTES, HEAD_BYTES, Chunk
from scaraspec.suite.expect import expect, expect_equal
from scaraspec.suite.wire import Answer


def chunk_of(answer: Answer) -> Chunk:
    """What a chunk frame carries.

    Raises:
        Unmet: No fileData.
    """
    size_bytes, chunk = len(answer.frame.data), answer.value
    whole = isinstance(chunk, Chunk) and size_bytes in (FILE_DATA_BYTES, HEAD_BYTES + chunk.length)
    expect(
        whole,
        "the data of a chunk is no fileData",
        expected=f"{FILE_DATA_BYTES} bytes",
        observed=f"{size_bytes} bytes: {answer}",
        requirement="5.1/1",
    )
    assert isinstance(chunk, Chunk), "it was just seen"
    return chunk


def expect_next(chunk: Chunk, due: int, size_bytes: int) -> None:
    """Hold a chunk of a file of this size against where the ones before it have got to.

    Raises:
        Unmet: It does not follow on them, or is out of bounds.
    """
    expect_equal(chunk.file_size, size_bytes, "the file size changed", requirement="5.1/3")
    expect_equal(
        chunk.position,
        due,
        "a chunk does not follow on the one before",
        requirement="5.1/8",
    )
    expect(
        1 <= chunk.length <= BUFFER_BYTES,
        "the length of a chunk is out of bounds",
        expected=f"1 to {BUFFER_BYTES}",
        observed=f"{chunk.length}",
        requirement="5.1/5",
    )
    expect(
        chunk.position + chunk.length <= size_bytes,
        "a chunk reaches beyond the end of the file",
        expected=f"at most {size_bytes}",
        observed=f"{chunk.position + chunk.length}",
        requirement="5.1/6",
    )
