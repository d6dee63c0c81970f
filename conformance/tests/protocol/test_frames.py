"""The frame layout of clause 3, and the framer with every kind of input."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.commands import is_known_opcode
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import (
    MAX_FRAME_BYTES,
    Frame,
    Framer,
    Skipped,
    SkipReason,
    StreamItem,
)
from scaraspec.suite.engine.strategies import frames

directions = st.sampled_from(Direction)
# Bytes that look like frames: delimiters, tags and small lengths are common.
noise = st.lists(
    st.sampled_from([0xAA, 0xCC, 0x90, 0x00, 0x01, 0x02, 0x05, 0x30]) | st.integers(0, 255)
).map(bytes)


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    """Split `data` at the given positions."""
    edges = [0, *sorted(c % (len(data) + 1) for c in cuts), len(data)]
    return [data[a:b] for a, b in pairwise(edges)]


def run(framer: Framer, *parts: bytes) -> list[StreamItem]:
    """Feed the parts, finish, and return all items; adjacent skipped runs are joined."""
    found: list[StreamItem] = []
    for item in [i for part in parts for i in framer.feed(part)] + framer.finish():
        last = found[-1] if found else None
        if isinstance(item, Skipped) and isinstance(last, Skipped):
            found[-1] = Skipped(last.data + item.data, last.reason)
        else:
            found.append(item)
    return found


def test_layout() -> None:
    """A frame is start, opcode, length, data, end; a final result has the tag before its opcode."""
    assert Frame(A2C, 0x01, b"password").encode() == b"\xaa\x01\x08password\xcc"
    assert Frame(C2A, 0x30, b"11", tagged=True).encode() == b"\xcc\x90\x30\x0211\xaa"


def test_too_long_to_encode() -> None:
    """256 bytes do not fit one length byte."""
    assert len(Frame(A2C, 0x52, bytes(255)).encode()) == 259
    with pytest.raises(ValueError, match="256 data bytes do not fit"):
        Frame(A2C, 0x52, bytes(256)).encode()


@given(
    directions.flatmap(lambda d: st.tuples(st.just(d), st.lists(frames(d)))),
    st.lists(st.integers(0)),
)
def test_frames_survive_any_split(sent: tuple[Direction, list[Frame]], cuts: list[int]) -> None:
    """Any frame sequence is decoded unchanged after encoding and splitting."""
    direction, expected = sent
    stream = b"".join(frame.encode() for frame in expected)
    assert run(Framer(direction), *pieces(stream, cuts)) == expected


@given(directions, noise, st.lists(st.integers(0)))
def test_split_does_not_matter(direction: Direction, data: bytes, cuts: list[int]) -> None:
    """Any byte string gives the same frames as a whole, in any split, and byte by byte."""
    complete = run(Framer(direction), data)
    assert run(Framer(direction), *pieces(data, cuts)) == complete
    assert run(Framer(direction), *(bytes((b,)) for b in data)) == complete


@given(directions, noise)
def test_items_tile_the_stream(direction: Direction, data: bytes) -> None:
    """Every byte belongs to exactly one frame or skipped run, in order."""
    framer = Framer(direction)
    items = framer.feed(data)
    assert framer.offset_bytes + framer.buffered_bytes == len(data)
    items += framer.finish()
    assert framer.offset_bytes == len(data)
    assert b"".join(i.encode() if isinstance(i, Frame) else i.data for i in items) == data


def test_delimiters_inside_data() -> None:
    """The length byte determines where a frame ends, not the first end byte (A-3-3)."""
    chunk = Frame(A2C, 0x52, b"\xaa\xcc" * 106)
    status = Frame(A2C, 0x09)
    assert run(Framer(A2C), chunk.encode() + status.encode()) == [chunk, status]


@pytest.mark.parametrize(
    ("stream", "expected"),
    [
        (b"\x00\x01\xaa\x09\x00\xcc", [(b"\x00\x01", SkipReason.STRAY)]),
        (b"\xaa\x09\x00\xcd\xaa\x09\x00\xcc", [(b"\xaa\x09\x00\xcd", SkipReason.BAD_END)]),
        (
            b"\x55\xaa\x09\x00\xcd\xaa\x09\x00\xcc",
            [(b"\x55", SkipReason.STRAY), (b"\xaa\x09\x00\xcd", SkipReason.BAD_END)],
        ),
        (b"\xaa\xff\xaa\x09\x00\xcc", [(b"\xaa\xff", SkipReason.TRUNCATED)]),
    ],
)
def test_resynchronisation(stream: bytes, expected: list[tuple[bytes, SkipReason]]) -> None:
    """The framer finds the next frame after garbage and reports the reason (A-3-10)."""
    framer = Framer(A2C)
    found = framer.feed(stream) + framer.finish()
    assert found == [*(Skipped(*run) for run in expected), Frame(A2C, 0x09)]


def test_truncated_end() -> None:
    """A frame that the end of the stream cuts off is reported as truncated, at its offset."""
    framer = Framer(C2A)
    assert framer.feed(b"\xcc\x09\x0200\xaa\xcc\x38\x17200|300") == [Frame(C2A, 0x09, b"00")]
    assert framer.offset_bytes == 6
    assert framer.finish() == [Skipped(b"\xcc\x38\x17200|300", SkipReason.TRUNCATED)]


def test_resync_filter() -> None:
    """In mid-stream, the first accepted frame has a known opcode; later frames may have any."""
    framer = Framer(C2A, is_known_opcode)
    assert framer.feed(b"\xcc\xee\x00\xaa\xcc\x09\x0200\xaa\xcc\xee\x00\xaa") == [
        Skipped(b"\xcc\xee\x00\xaa", SkipReason.IMPLAUSIBLE),
        Frame(C2A, 0x09, b"00"),
        Frame(C2A, 0xEE),
    ]


@pytest.mark.parametrize("piece_bytes", [1, 4, 5, 100])
def test_recovery_filter(piece_bytes: int) -> None:
    """A wrong end byte that looks like a start byte does not begin a frame of unknown opcode."""
    framer = Framer(C2A, recovery_filter=is_known_opcode)
    stream = b"\xcc\x08\x011\xcc\xcc\x09\x0200\xaa\xcc\x09\x0201\xaa\xcc\xee\x00\xaa"
    pieces = (stream[at : at + piece_bytes] for at in range(0, len(stream), piece_bytes))
    found = [item for piece in pieces for item in framer.feed(piece)]
    skipped = b"".join(item.data for item in found if isinstance(item, Skipped))
    assert skipped == b"\xcc\x08\x011\xcc"
    assert [item for item in found if isinstance(item, Frame)] == [
        Frame(C2A, 0x09, b"00"),
        Frame(C2A, 0x09, b"01"),
        Frame(C2A, 0xEE),
    ]


def test_a_gap_moves_the_offset() -> None:
    """A gap adds to the offset, and the unfinished frame before it is reported as truncated."""
    framer = Framer(A2C)
    framer.feed(b"\xaa\x01\x08pass")
    assert framer.skip_gap(100, is_known_opcode) == [
        Skipped(b"\xaa\x01\x08pass", SkipReason.TRUNCATED)
    ]
    assert framer.offset_bytes == 107
    assert framer.feed(b"\xaa\x09\x00\xcc") == [Frame(A2C, 0x09)]


@pytest.mark.parametrize("garbage", [b"\xcc" * 65536, b"\xcc\x90\xff" * 20000, bytes(65536)])
def test_bounded_on_endless_garbage(garbage: bytes) -> None:
    """The framer never buffers more than one unfinished frame, whatever it receives."""
    framer = Framer(C2A)
    for _ in range(4):
        framer.feed(garbage)
        assert framer.buffered_bytes <= MAX_FRAME_BYTES
