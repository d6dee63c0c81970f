"""Every byte of a frame is shown once, for any fields."""

from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C
from scaraspec.report.model import Evidence, FrameField
from scaraspec.report.segments import segments

fields = st.builds(FrameField, st.just("f"), st.integers(-9, 40), st.integers(-9, 40))


def evidence(raw: bytes, *cut: FrameField) -> Evidence:
    """Return a frame with these fields."""
    return Evidence("1", A2C, 0, len(raw), 0, "", raw.hex(), cut)


@given(st.binary(max_size=12), st.lists(fields, max_size=5))
def test_segments_cover_the_frame(raw: bytes, cut: list[FrameField]) -> None:
    """Also for fields that overlap, have the wrong order or exceed the frame."""
    drawn = segments(evidence(raw, *cut))
    assert "".join(s.shown_hex for s in drawn).replace(" ", "") == raw.hex().upper()
    assert all(s.shown_hex for s in drawn)


def test_a_long_segment_is_truncated() -> None:
    """Sixteen bytes are shown, the others counted."""
    (part,) = segments(evidence(bytes(200), FrameField("data", 0, 200, "200 valid bytes")))
    assert (part.shown_hex, part.more_bytes) == (bytes(16).hex(" "), 184)
    assert (part.name, part.value) == ("data", "200 valid bytes")


def test_invalid_hex() -> None:
    """Results of another writer must not cause an error."""
    assert segments(Evidence("1", A2C, 0, 0, 0, frame_hex="<b>")) == []


def test_differences_from_a_passing_frame() -> None:
    """Only a passing frame of the same kind is compared."""
    flag = FrameField("flag", 0, 1, "1")
    wrong = evidence(b"1|x", flag, FrameField("code", 2, 1, "x"))
    right = evidence(b"1|y", flag, FrameField("code", 2, 1, "y"))
    assert [s.differs for s in segments(wrong, [right])] == [False, False, True]
    assert not any(s.differs for s in segments(wrong))
