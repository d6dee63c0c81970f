"""Chunks: the checks of each chunk that a subject sends, in an upload or a download."""

from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA_BYTES, HEAD_BYTES, Chunk
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import expect, expect_equal
from scaraspec.user_message import UserMessage


def chunk_of(answer: ReceivedFrame) -> Chunk:
    """Return the chunk of a frame.

    Raises:
        CaseFailed: The data of the frame is not a fileData.
    """
    size_bytes, chunk = len(answer.frame.data), answer.value
    whole = isinstance(chunk, Chunk) and size_bytes in (FILE_DATA_BYTES, HEAD_BYTES + chunk.length)
    expect(
        whole,
        "the data of a chunk is not a fileData",
        expected=UserMessage("{count} bytes", count=FILE_DATA_BYTES),
        observed=UserMessage("{count} bytes: {answer}", count=size_bytes, answer=answer),
        requirement="5.1/1",
    )
    assert isinstance(chunk, Chunk), "checked above"
    return chunk


def expect_next(chunk: Chunk, position: int, size_bytes: int) -> None:
    """Require that a chunk is the next one of a file.

    Args:
        chunk: The chunk.
        position: The number of bytes in the chunks before it.
        size_bytes: The size of the file in bytes.

    Raises:
        CaseFailed: The chunk has another position or file size, or is out of bounds.
    """
    expect_equal(chunk.file_size, size_bytes, "the file size changed", requirement="5.1/3")
    expect_equal(
        chunk.position,
        position,
        "a chunk does not follow the one before",
        requirement="5.1/8",
    )
    expect_chunk_length(chunk)
    expect_within(chunk, size_bytes)


def expect_chunk_length(chunk: Chunk) -> None:
    """Require that the length of a chunk is between 1 and the size of its buffer.

    Raises:
        CaseFailed: It is not.
    """
    expect(
        1 <= chunk.length <= BUFFER_BYTES,
        "the length of a chunk is out of bounds",
        expected=UserMessage("{first} to {last}", first=1, last=BUFFER_BYTES),
        observed=f"{chunk.length}",
        requirement="5.1/5",
    )


def expect_within(chunk: Chunk, size_bytes: int) -> None:
    """Require that a chunk does not extend beyond the end of its file.

    Raises:
        CaseFailed: It does.
    """
    end = chunk.position + chunk.length
    message = "a chunk reaches beyond the end of the file"
    expected, observed = UserMessage("at most {limit}", limit=size_bytes), f"{end}"
    expect(end <= size_bytes, message, expected=expected, observed=observed, requirement="5.1/6")


def expect_chunk_position(chunk: Chunk, content: bytes) -> None:
    """Require that the data of a chunk is at its position in the file.

    Raises:
        CaseFailed: The data is at another position, or not in the file.
    """
    at = content.find(chunk.data) if chunk.data else -1
    expect(
        at >= 0 and content.startswith(chunk.data, chunk.position),  # short data may occur twice
        "the data of a chunk is not at its position in the file",
        expected="data of the file" if at < 0 else f"{at}",
        observed=f"{chunk.position}"
        if at >= 0
        else UserMessage("{position}, with data that is not in the file", position=chunk.position),
        requirement="5.1/4",
    )


def expect_chunk_content(chunk: Chunk, content: bytes) -> None:
    """Require that the valid bytes of a chunk equal the file at its position.

    Raises:
        CaseFailed: They differ.
    """
    valid = content[chunk.position : chunk.position + BUFFER_BYTES]
    expect(
        valid.startswith(chunk.data),
        "the length of a chunk includes bytes that are not of the file",
        expected=UserMessage("at most {limit}", limit=len(valid)),
        observed=f"{chunk.length}",
        requirement="5.1/5",
    )
