"""Why bytes are no program file: what fails, where, and in one sentence how."""

from enum import Enum

from scaraspec.protocol.program_files.layout import (
    FOOTER,
    LAYOUTS,
    MAGIC,
    VARIABLE_BYTES,
    Layout,
    program_bytes,
)
from scaraspec.user_message import UserMessage

MAX_FILE_BYTES = 4 << 20
"""Longer files are not read: sixty thousand nodes are beyond any program for this arm."""


class ProgramDefect(Enum):
    """Why bytes are no program: a code that stays, and the requirements that it breaks."""

    START = ("P-start", ("6.2/1", "6.1/1"))
    LONG = ("P-long", ())
    SHORT = ("P-short", ("6.1/2", "6.1/1", "6.3/1", "6.3/2"))
    END = ("P-end", ("6.6b/1", "6.1/1"))
    NODES = ("P-nodes", ("6.2/2", "6.1/3"))
    VARIABLES = ("P-variables", ("6.2/3", "6.4/1", "6.1/3"))
    SIZE = ("P-size", ("6.1/3",))
    SURPLUS = ("P-surplus", ("6.6b/2",))
    SECOND = ("P-second-program", ("6.1/2", "6.6b/2"))

    def __init__(self, code: str, requirements: tuple[str, ...]) -> None:
        self.code = code
        self.requirements = requirements


class ProgramError(ValueError):
    """Bytes are no program by the size equation and the magics (6.1/3, 6.2/1, 6.6b/1).

    Attributes:
        defect: What is wrong.
        offset_bytes: Where.
        reason: In one sentence.
    """

    def __init__(self, defect: ProgramDefect, offset_bytes: int, reason: str) -> None:
        super().__init__(f"not a program file, byte {offset_bytes}: {reason}")
        self.defect = defect
        self.offset_bytes = offset_bytes
        self.reason = reason


def check_envelope(data: bytes) -> None:
    """Check what is the same in every layout.

    Raises:
        ProgramError: The bytes do not begin as a program, or are too few or too many for one.
    """
    if not data.startswith(MAGIC):
        raise ProgramError(
            ProgramDefect.START,
            0,
            UserMessage(
                'it begins with {value}, not with "SCARA"', value=data[:5].hex(" ") or "nothing"
            ),
        )
    if len(data) > MAX_FILE_BYTES:
        raise ProgramError(
            ProgramDefect.LONG,
            MAX_FILE_BYTES,
            UserMessage(
                "it has {data_count} bytes; more than {max_file_bytes} are not read",
                data_count=len(data),
                max_file_bytes=MAX_FILE_BYTES,
            ),
        )
    least = min(layout.file_bytes(0, 0) for layout in LAYOUTS.values())
    if len(data) < least:
        raise ProgramError(
            ProgramDefect.SHORT,
            len(data),
            UserMessage(
                "it ends after {data_count} bytes; header, configuration and footer take {least}",
                data_count=len(data),
                least=least,
            ),
        )


def layout_error(data: bytes, layouts: tuple[Layout, ...]) -> ProgramError:
    """Why a file that is long enough and begins as a program fits none of these layouts."""
    end = program_bytes(data)
    if end is not None and end < len(data):
        second = data.startswith(MAGIC, end)
        return ProgramError(
            ProgramDefect.SECOND if second else ProgramDefect.SURPLUS,
            end,
            UserMessage(
                "{value} follows: the footer ends at byte {end}, but the file has "
                "{data_count} bytes",
                value="another program" if second else "something else",
                end=end,
                data_count=len(data),
            ),
        )
    if not data.endswith(FOOTER):
        return ProgramError(
            ProgramDefect.END,
            len(data) - len(FOOTER),
            UserMessage('it ends with {hex}, not with "ARACS"', hex=data[-len(FOOTER) :].hex(" ")),
        )
    return _size_error(data, layouts)


def _size_error(data: bytes, layouts: tuple[Layout, ...]) -> ProgramError:
    """Says what is missing or too much, in the likeliest layout that explains it."""

    def penalties(layout: Layout) -> tuple[bool, ...]:
        return (
            # Counts in the wrong byte order make sizes beyond all bounds.
            layout.file_bytes(*layout.counts(data)) > 2 * MAX_FILE_BYTES,
            any(data[len(MAGIC) : layout.points_offset]),
            layout.reading == "mixed",
            _miscount(data, layout)[0] is ProgramDefect.SIZE,
        )

    likeliest = min(layouts, key=penalties)
    points, variables = likeliest.counts(data)
    defect, offset_bytes, room = _miscount(data, likeliest)
    return ProgramError(
        defect,
        offset_bytes,
        UserMessage(
            "the header's points = {points} and varNub = {variables} make {file_bytes} bytes "
            "in layout {likeliest}, but the file has {data_count}, {room}",
            points=points,
            variables=variables,
            file_bytes=likeliest.file_bytes(points, variables),
            likeliest=likeliest.name,
            data_count=len(data),
            room=room,
        ),
    )


def _miscount(data: bytes, layout: Layout) -> tuple[ProgramDefect, int, str]:
    """Which count of the header is wrong, where it stands, and what it should be."""
    points, variables = layout.counts(data)
    surplus = len(data) - layout.file_bytes(points, variables)
    extra_nodes, rest = divmod(surplus, layout.node_bytes)
    if not rest and points + extra_nodes >= 0:
        return (
            ProgramDefect.NODES,
            layout.points_offset,
            f"room for points = {points + extra_nodes}",
        )
    extra_variables, rest = divmod(surplus, VARIABLE_BYTES)
    if not rest and variables + extra_variables >= 0:
        room = f"room for varNub = {variables + extra_variables}"
        return ProgramDefect.VARIABLES, layout.points_offset + 4, room
    return ProgramDefect.SIZE, layout.points_offset, "and no other layout fits"
