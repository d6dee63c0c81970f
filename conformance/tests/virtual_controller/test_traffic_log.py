"""The traffic log: one readable line per frame, without passwords."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame, Skipped, SkipReason, StreamItem
from scaraspec.protocol.transfer import FILE_DATA, Chunk
from scaraspec.virtual_controller.traffic_log import format_line


@pytest.mark.parametrize(
    ("item", "line"),
    [
        (Frame(A2C, 0x09), "#3 > 0x09 get_status"),
        (Frame(C2A, 0x09, b"00"), "#3 < 0x09 get_status 00"),
        (Frame(C2A, 0x30, b"00|12", tagged=True), "#3 < 0x30 run_program result 00|12"),
        (Frame(A2C, 0x30, "程序".encode()), "#3 > 0x30 run_program 程序"),
        (Frame(A2C, 0x3E, b"\x01"), "#3 > 0x3E unknown \\x01"),
        (Frame(A2C, 0x01, b"secret"), "#3 > 0x01 login ••••"),
        (Frame(C2A, 0x01, b"1"), "#3 < 0x01 login 1"),
        (Frame(A2C, 0x03, b"secret|new"), "#3 > 0x03 set_password ••••"),
        (
            Frame(C2A, 0x56, FILE_DATA.encode(Chunk(500, 400, 100, bytes(100)))),
            "#3 < 0x56 download_chunk 100 bytes at 400 of 500",
        ),
        (Frame(A2C, 0x56, b"1"), "#3 > 0x56 download_chunk 1"),
        (Frame(A2C, 0x52, b""), "#3 > 0x52 upload_chunk"),
        (Skipped(b"\xaa\x01\x06secret", SkipReason.BAD_END), "#3 > skipped 9 bytes: bad end"),
    ],
)
def test_lines(item: StreamItem, line: str) -> None:
    """Connection, arrow, opcode, name, data."""
    assert format_line(3, item) == line


@given(
    direction=st.sampled_from([A2C, C2A]),
    opcode=st.integers(0, 255),
    data=st.binary(max_size=255),
    tagged=st.booleans(),
)
def test_any_frame_is_one_line(
    direction: Direction,
    opcode: int,
    data: bytes,
    tagged: bool,  # noqa: FBT001 - drawn
) -> None:
    """No control characters, no newline, limited length."""
    line = format_line(1, Frame(direction, opcode, data, tagged))
    assert line.isprintable()
    assert len(line) < 400
