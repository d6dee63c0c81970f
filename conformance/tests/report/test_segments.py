"""Every byte of a frame is drawn once, whatever its fields claim."""

from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C
from scaraspec.report.model import Evidence, FrameField
from scaraspec.report.segments import segments

fields = st.builds(FrameField, st.just("f"), st.integers(-9, 40), st.integers(-9, 40))


def evidence(raw: bytes, *cut: FrameField) -> Evidence:
    """A frame with these fields."""
    return Evidence("1", A2C, 0, len(raw), 0, "", raw.hex(), cut)


@given(st.binary(max_size=12), st.lists(fields, max_size=5))
def test_the_segments_tile_the_frame(raw: bytes, cut: list[FrameField]) -> None:
    """Fields that overlap, run backwards or reach beyond the end lose and double nothing."""
    drawn = segments(evidence(raw, *cut))
    assert "".join(s.shown_hex for s in drawn).replace(" ", "") == raw.hex().upper()
    assert all(s.shown_hex for s in drawn)


def test_a_long_part_is_cut_and_says_so() -> None:
    """Sixteen bytes are shown, the others counted."""
    (part,) = segments(evidence(bytes(200), FrameField("data", 0, 200, "200 valid bytes")))
    assert (part.shown_hex, part.more_bytes) == (bytes(16).hex(" "), 184)
    assert (part.name, part.value) == ("data", "200 valid bytes")


def test_what_is_no_hex_is_no_frame() -> None:
    """Results of another writer cost no page."""
    assert segments(Evidence("1", A2C, 0, 0, 0, frame_hex="<b>")) == []


def test_what_differs_from_a_right_frame_is_marked() -> None:
    """Compared with the passing frame of the same kind only."""
    flag = FrameField("flag", 0, 1, "1")
    wrong = evidence(b"1|x", flag, FrameField("code", 2, 1, "x"))
    right = evidence(b"1|y", flag, FrameField("code", 2, 1, "y"))
    assert [s.differs for s in segments(wrong, [right])] == [False, False, True]
    assert not any(s.differs for s in segments(wrong))
