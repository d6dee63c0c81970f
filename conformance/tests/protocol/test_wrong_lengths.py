"""Lost bytes that were made after one of the document's wrong examples."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame, Framer, Skipped
from scaraspec.protocol.wrong_lengths import WRONG_LENGTHS, WrongLength, recognise

each_row = pytest.mark.parametrize("wrong", WRONG_LENGTHS, ids=lambda wrong: f"L{wrong.line}")


def copied(wrong: WrongLength, text: bytes) -> bytes:
    """A frame with the row's wrong length around a text."""
    return wrong.header + text + bytes((wrong.frame.direction.end,))


def lost(direction: Direction, raw: bytes) -> bytes:
    """What a framer first skips of these bytes when a good frame follows them."""
    skipped = Framer(direction).feed(raw + Frame(direction, 0x08).encode())[0]
    assert isinstance(skipped, Skipped)
    return skipped.data


def test_there_are_fourteen() -> None:
    """Each is wrong, and no two begin alike."""
    assert len(WRONG_LENGTHS) == len({wrong.header for wrong in WRONG_LENGTHS}) == 14
    assert all(wrong.declared != len(wrong.frame.data) for wrong in WRONG_LENGTHS)


def test_a_header_is_what_stands_before_the_data() -> None:
    """Start byte, tag where there is one, opcode, and the wrong length."""
    headers = {wrong.line: wrong.header for wrong in WRONG_LENGTHS}
    assert (headers[160], headers[417]) == (b"\xaa\x05\x24", b"\xcc\x90\x33\x04")


@each_row
def test_a_copy_is_recognised_in_what_a_framer_skips(wrong: WrongLength) -> None:
    """The documented text with the documented length is lost, and its row is named."""
    direction, text = wrong.frame.direction, wrong.frame.data
    assert recognise(direction, lost(direction, copied(wrong, text))) is wrong


@each_row
def test_a_copy_that_lost_its_bars_is_recognised(wrong: WrongLength) -> None:
    """Who copied the blanks in place of the bars copied the length too."""
    direction, text = wrong.frame.direction, wrong.frame.data.replace(b"|", b" ")
    assert recognise(direction, lost(direction, copied(wrong, text))) is wrong


@each_row
def test_the_length_is_copied_whatever_the_text(wrong: WrongLength) -> None:
    """A peer that fills its own values into the example keeps the example's length."""
    longer, shorter = b"9" * (wrong.declared + 4), b"9" * (wrong.declared - 1)
    assert recognise(wrong.frame.direction, copied(wrong, longer)) is wrong
    assert recognise(wrong.frame.direction, copied(wrong, shorter)) is (wrong if shorter else None)


@each_row
def test_the_end_byte_may_be_missing_behind_the_length(wrong: WrongLength) -> None:
    """Bytes that arrive one by one are given up where the end byte is due; less tells nothing."""
    direction, text = wrong.frame.direction, b"9" * (wrong.declared + 1)
    assert recognise(direction, wrong.header + text) is wrong
    assert recognise(direction, wrong.header + text[:-1]) is None


@each_row
def test_right_frames_are_not_recognised(wrong: WrongLength) -> None:
    """Neither the frame that is meant, nor one whose data has the printed length."""
    frame = wrong.frame
    assert recognise(frame.direction, frame.encode()) is None
    assert recognise(frame.direction, copied(wrong, b"9" * wrong.declared)) is None


@each_row
def test_the_other_side_copies_nothing(wrong: WrongLength) -> None:
    """A header belongs to the direction that its start byte names."""
    raw = copied(wrong, wrong.frame.data)
    assert recognise(wrong.frame.direction.opposite, raw) is None


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
def test_less_than_a_copy_is_none(direction: Direction, raw: bytes) -> None:
    """Nothing is said about bytes that do not show a text of another length."""
    assert recognise(direction, raw) is None


@given(
    st.sampled_from(Direction),
    st.sampled_from([b"", *(wrong.header for wrong in WRONG_LENGTHS)]),
    st.binary(max_size=300),
)
def test_any_bytes_may_be_asked_about(direction: Direction, head: bytes, tail: bytes) -> None:
    """The answer is none, or a row of this direction whose header begins the bytes."""
    wrong = recognise(direction, head + tail)
    assert wrong is None or (
        wrong.frame.direction is direction and (head + tail).startswith(wrong.header)
    )
