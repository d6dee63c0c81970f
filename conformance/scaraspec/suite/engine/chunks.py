"""Chunks: what is checked of each chunk that a subject sends, whichever way the file goes."""

from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA_BYTES, HEAD_BYTES, Chunk
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import expect, expect_equal


def chunk_of(answer: ReceivedFrame) -> Chunk:
    """What a chunk frame carries.

    Raises:
        CaseFailed: No fileData.
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
        CaseFailed: It does not follow on them, or is out of bounds.
    """
    expect_equal(chunk.file_size, size_bytes, "the file size changed", requirement="5.1/3")
    expect_equal(
        chunk.position,
        due,
        "a chunk does not follow on the one before",
        requirement="5.1/8",
    )
    expect_chunk_length(chunk)
    expect_within(chunk, size_bytes)


def expect_chunk_length(chunk: Chunk) -> None:
    """Hold against a chunk that its buffer would be empty, or too small for what it holds.

    Raises:
        CaseFailed: It is so.
    """
    expect(
        1 <= chunk.length <= BUFFER_BYTES,
        "the length of a chunk is out of bounds",
        expected=f"1 to {BUFFER_BYTES}",
        observed=f"{chunk.length}",
        requirement="5.1/5",
    )


def expect_within(chunk: Chunk, size_bytes: int) -> None:
    """Hold a chunk of a file of this size against the end of the file.

    Raises:
        CaseFailed: It reaches beyond.
    """
    end = chunk.position + chunk.length
    message = "a chunk reaches beyond the end of the file"
    expected, observed = f"at most {size_bytes}", f"{end}"
    expect(end <= size_bytes, message, expected=expected, observed=observed, requirement="5.1/6")


def expect_chunk_position(chunk: Chunk, content: bytes) -> None:
    """Hold a chunk's position against where the file holds what is in it.

    Raises:
        CaseFailed: It is another place, or there is none.
    """
    at = content.find(chunk.data) if chunk.data else -1
    expect(
        at >= 0 and content.startswith(chunk.data, chunk.position),  # a short one may recur
        "position is not where the content belongs",
        expected="a place in the file" if at < 0 else f"{at}",
        observed=f"{chunk.position}" + ", of what is not in the file" * (at < 0),
        requirement="5.1/4",
    )


def expect_chunk_content(chunk: Chunk, content: bytes) -> None:
    """Hold a chunk against what the file holds where the chunk says that it stands.

    Raises:
        CaseFailed: It counts other bytes as the file's.
    """
    valid = content[chunk.position : chunk.position + BUFFER_BYTES]
    expect(
        valid.startswith(chunk.data),
        "length counts bytes that are not the file's",
        expected=f"at most {len(valid)}",
        observed=f"{chunk.length}",
        requirement="5.1/5",
    )
