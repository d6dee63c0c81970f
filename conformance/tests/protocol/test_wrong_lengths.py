"""Detection of invalid bytes that copy a wrong length from an example of the document."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame, Framer, Skipped
from scaraspec.protocol.wrong_lengths import WRONG_LENGTHS, WrongLength, find_copied_length

each_row = pytest.mark.parametrize("wrong", WRONG_LENGTHS, ids=lambda wrong: f"L{wrong.line}")


def copied(wrong: WrongLength, text: bytes) -> bytes:
    """Return a frame with this text and the wrong length of the row."""
    return wrong.header + text + bytes((wrong.frame.direction.end,))


def lost(direction: Direction, raw: bytes) -> bytes:
    """Return the first bytes that a framer skips if a valid frame follows `raw`."""
    skipped = Framer(direction).feed(raw + Frame(direction, 0x08).encode())[0]
    assert isinstance(skipped, Skipped)
    return skipped.data


def test_fourteen_rows() -> None:
    """Each length is wrong, and all headers differ."""
    assert len(WRONG_LENGTHS) == len({wrong.header for wrong in WRONG_LENGTHS}) == 14
    assert all(wrong.declared != len(wrong.frame.data) for wrong in WRONG_LENGTHS)


def test_header_is_the_bytes_before_the_data() -> None:
    """A header is the start byte, the tag if present, the opcode, and the wrong length."""
    headers = {wrong.line: wrong.header for wrong in WRONG_LENGTHS}
    assert (headers[160], headers[417]) == (b"\xaa\x05\x24", b"\xcc\x90\x33\x04")


@each_row
def test_copied_row_is_found_in_skipped_bytes(wrong: WrongLength) -> None:
    """The framer skips the printed text with the printed length; the function finds its row."""
    direction, text = wrong.frame.direction, wrong.frame.data
    assert find_copied_length(direction, lost(direction, copied(wrong, text))) is wrong


@each_row
def test_copied_row_without_bars_is_found(wrong: WrongLength) -> None:
    """A peer that copied spaces in place of the bars also copied the length."""
    direction, text = wrong.frame.direction, wrong.frame.data.replace(b"|", b" ")
    assert find_copied_length(direction, lost(direction, copied(wrong, text))) is wrong


@each_row
def test_copied_length_with_another_text_is_found(wrong: WrongLength) -> None:
    """A peer may insert its own values and keep the length of the example."""
    longer, shorter = b"9" * (wrong.declared + 4), b"9" * (wrong.declared - 1)
    assert find_copied_length(wrong.frame.direction, copied(wrong, longer)) is wrong
    assert find_copied_length(wrong.frame.direction, copied(wrong, shorter)) is (
        wrong if shorter else None
    )


@each_row
def test_copied_row_without_end_byte_is_found(wrong: WrongLength) -> None:
    """The bytes may stop where the end byte is expected; fewer bytes prove nothing."""
    direction, text = wrong.frame.direction, b"9" * (wrong.declared + 1)
    assert find_copied_length(direction, wrong.header + text) is wrong
    assert find_copied_length(direction, wrong.header + text[:-1]) is None


@each_row
def test_correct_frames_are_not_found(wrong: WrongLength) -> None:
    """Neither the intended frame nor a frame whose data has the printed length is found."""
    frame = wrong.frame
    assert find_copied_length(frame.direction, frame.encode()) is None
    assert find_copied_length(frame.direction, copied(wrong, b"9" * wrong.declared)) is None


@each_row
def test_other_direction_is_not_found(wrong: WrongLength) -> None:
    """A header belongs to the direction of its start byte."""
    raw = copied(wrong, wrong.frame.data)
    assert find_copied_length(wrong.frame.direction.opposite, raw) is None


@pytest.mark.parametrize(
    ("direction", "raw"),
    [
        (A2C, b""),
        (A2C, b"\xaa"),
        (A2C, b"\xaa\x54\x08"),
        (A2C, b"\xaa\x54\x08\xcc"),
        (A2C, b"\xaa\x54\x08file\x80.txt\xcc"),
        (A2C, b"\xaa\x54\x07file2.txt\xcc"),
        (A2C, b"\xaa\x54\x08" + b"x" * 256 + b"\xcc"),
        (C2A, b"\xcc\x33\x0400|11\xaa"),
    ],
    ids=["nothing", "start", "header", "no-text", "binary", "other-length", "endless", "untagged"],
)
def test_other_bytes_are_not_found(direction: Direction, raw: bytes) -> None:
    """Bytes without a printable text of another length are not found."""
    assert find_copied_length(direction, raw) is None


@given(
    st.sampled_from(Direction),
    st.sampled_from([b"", *(wrong.header for wrong in WRONG_LENGTHS)]),
    st.binary(max_size=300),
)
def test_any_bytes_are_accepted(direction: Direction, head: bytes, tail: bytes) -> None:
    """The result is None, or a row of this direction whose header begins the bytes."""
    wrong = find_copied_length(direction, head + tail)
    assert wrong is None or (
        wrong.frame.direction is direction and (head + tail).startswith(wrong.header)
    )
