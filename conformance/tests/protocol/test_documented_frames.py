"""Codec and command table compared with every frame row of the document that has a length."""

import json
import re
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.commands import parse_frame
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.wrong_lengths import WRONG_LENGTHS, find_copied_length

BOTH_WAYS = pytest.mark.parametrize("direction", Direction, ids=lambda direction: direction.name)


class Row(NamedTuple):
    """One line of the fixture file; see its README."""

    line: int
    clause: str
    printed: str
    direction: str
    tagged: bool
    opcode: str
    declared_length: int | str
    length: int
    wrong_because: str | None
    payload_text: str | None
    payload_hex: str
    frame_hex: str
    meaning: str
    note: str | None
    legal_payloads_hex: list[str] | None

    @property
    def raw(self) -> bytes:
        """The frame's bytes."""
        return bytes.fromhex(self.frame_hex)

    @property
    def frame(self) -> Frame:
        """The frame described by the fields of the row."""
        return Frame(
            Direction[self.direction],
            int(self.opcode, 16),
            bytes.fromhex(self.payload_hex),
            self.tagged,
        )

    @property
    def miscounted(self) -> bytes:
        """The frame with the printed length."""
        assert isinstance(self.declared_length, int)
        at = 3 if self.tagged else 2
        return self.raw[:at] + bytes((self.declared_length,)) + self.raw[at + 1 :]


@pytest.fixture(scope="module")
def rows(fixtures_dir: Path) -> list[Row]:
    """Return all rows."""
    lines = (fixtures_dir / "frames" / "documented.jsonl").read_text(encoding="utf-8").splitlines()
    return [Row(**json.loads(line)) for line in lines]


@pytest.fixture(scope="module")
def wrong(rows: list[Row]) -> list[Row]:
    """Return the rows with a wrong printed length."""
    return [row for row in rows if row.wrong_because]


def test_the_file_has_all_rows_in_order(rows: list[Row], wrong: list[Row]) -> None:
    """100 rows print a length; exactly 14 lengths are wrong."""
    lines = [row.line for row in rows]
    assert lines == sorted(set(lines))
    assert (len(rows), len(wrong)) == (100, 14)
    assert wrong == [
        row for row in rows if row.declared_length not in {row.length, "sizeof(fileData)"}
    ]


def test_fields_match_the_printed_cells(rows: list[Row]) -> None:
    """Direction, tag, opcode and declared length match the cells of the printed row."""
    edges = {"A2C": ("0xAA", "0xCC"), "C2A": ("0xCC", "0xAA")}
    for row in rows:
        start, *cells, end = row.printed.split("\t")
        tag = ["0x90"] if row.tagged else []
        declared = row.declared_length
        length = "Sizeof(fileData)" if declared == "sizeof(fileData)" else str(declared)
        assert (start, end) == edges[row.direction], row
        assert cells[: len(tag) + 2] == [*tag, row.opcode, length], row


def test_the_payload_is_the_printed_text_with_its_bars(rows: list[Row]) -> None:
    """Quotes are removed and spaces become bars, unless the note states another decision."""
    decided = {232, 601, 756, 780}
    for row in rows:
        cells = row.printed.split("\t")[3 + row.tagged : -1]
        if row.line in decided:
            assert row.note, row
        else:
            assert row.payload_text == re.sub('[“”"]', "", "".join(cells)).replace(" ", "|"), row
        if row.payload_text is not None:
            assert row.payload_text.encode("ascii").hex().upper() == row.payload_hex, row
        assert row.length == len(bytes.fromhex(row.payload_hex)), row


def test_every_row_is_encoded_as_typed(rows: list[Row]) -> None:
    """Encoding the fields of a row gives the bytes that were typed by hand."""
    assert {row.line: row.frame.encode().hex().upper() for row in rows} == {
        row.line: row.frame_hex for row in rows
    }


def test_every_row_is_decoded(rows: list[Row]) -> None:
    """The bytes of a row are decoded to exactly the described frame."""
    assert {row.line: Framer(row.frame.direction).feed(row.raw) for row in rows} == {
        row.line: [row.frame] for row in rows
    }


def test_every_row_is_decoded_byte_by_byte(rows: list[Row]) -> None:
    """The frame is found at its end byte, not before."""
    for row in rows:
        framer = Framer(row.frame.direction)
        found = [framer.feed(bytes((byte,))) for byte in row.raw]
        assert found == [[]] * (len(row.raw) - 1) + [[row.frame]], row


@BOTH_WAYS
@given(data=st.data())
def test_all_rows_are_decoded_from_one_stream(
    rows: list[Row], direction: Direction, data: st.DataObject
) -> None:
    """The stream of all rows, split anywhere, gives all frames in order."""
    mine = [row for row in rows if row.frame.direction is direction]
    stream = b"".join(row.raw for row in mine)
    cuts = sorted(data.draw(st.sets(st.integers(0, len(stream)), max_size=20)))
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    framer = Framer(direction)
    assert [item for piece in pieces for item in framer.feed(piece)] == [row.frame for row in mine]
    assert (framer.buffered_bytes, framer.offset_bytes) == (0, len(stream))


def test_no_row_is_a_frame_of_the_other_side(rows: list[Row]) -> None:
    """Decoded in the wrong direction, the bytes of a row contain no frame."""
    for row in rows:
        framer = Framer(row.frame.direction.opposite)
        found = [*framer.feed(row.raw), *framer.finish()]
        assert not any(isinstance(item, Frame) for item in found), row


def test_the_command_table_reads_every_row(rows: list[Row]) -> None:
    """Each payload is decoded as a command of its clause, without issues."""
    for row in rows:
        reading = parse_frame(row.frame)
        assert reading is not None, row
        assert reading.command.clause == row.clause, row
        assert reading.decoded.issues == (), row
        asks = row.direction == reading.command.initiator.name
        assert reading.part == ("result" if row.tagged else "request" if asks else "reply"), row


def test_the_empty_cell_may_hold_eight_bytes(rows: list[Row]) -> None:
    """L601 prints no data; 1 to 4 as digits and as numbers give the same four directions."""
    (row,) = (row for row in rows if row.legal_payloads_hex)
    readings = [
        parse_frame(row.frame._replace(data=bytes.fromhex(payload)))
        for payload in row.legal_payloads_hex or ()
    ]
    decoded = [reading.decoded for reading in readings if reading]
    assert [bool(item.issues) for item in decoded] == [False] * 8
    directions = [str(item.value) for item in decoded]
    assert directions == ["+y", "-y", "+x", "-x"] * 2


def test_a_printed_wrong_length_makes_no_frame(wrong: list[Row]) -> None:
    """A row with a wrong length is not a frame; a frame after it is found."""
    next_frames = {A2C: Frame(A2C, 0x09), C2A: Frame(C2A, 0x09, b"00")}
    for row in wrong:
        direction = row.frame.direction
        alone, followed = Framer(direction), Framer(direction)
        found = [*alone.feed(row.miscounted), *alone.finish()]
        assert not any(isinstance(item, Frame) for item in found), row
        assert b"".join(item.data for item in found) == row.miscounted, row
        lost, after = followed.feed(row.miscounted + next_frames[direction].encode())
        assert (lost.data, after) == (row.miscounted, next_frames[direction]), row


def test_a_printed_wrong_length_is_recognised(rows: list[Row], wrong: list[Row]) -> None:
    """`WRONG_LENGTHS` matches the rows, and contains no correct frame."""
    assert [(row.line, row.clause, row.declared_length, row.frame) for row in wrong] == [
        (known.line, known.clause, known.declared, known.frame) for known in WRONG_LENGTHS
    ]
    assert [find_copied_length(row.frame.direction, row.miscounted) for row in wrong] == [
        *WRONG_LENGTHS
    ]
    assert not any(find_copied_length(row.frame.direction, row.raw) for row in rows)
