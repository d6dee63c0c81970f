"""Defects of invalid program files: code, position, and error message."""

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
"""Longer files are rejected; no program for this arm has 60,000 nodes."""


class ProgramDefect(Enum):
    """Why bytes are not a program: a stable code, and the violated requirements."""

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
    """Bytes are not a program by the size equation and the magics (6.1/3, 6.2/1, 6.6b/1).

    Attributes:
        defect: The kind of defect.
        offset_bytes: The position in the file.
        reason: The description, in one sentence.
    """

    def __init__(self, defect: ProgramDefect, offset_bytes: int, reason: str) -> None:
        super().__init__(
            UserMessage(
                "not a program file, byte {offset_bytes}: {reason}",
                offset_bytes=offset_bytes,
                reason=reason,
            )
        )
        self.defect = defect
        self.offset_bytes = offset_bytes
        self.reason = reason


def check_envelope(data: bytes) -> None:
    """Check the properties that all layouts have in common.

    Raises:
        ProgramError: The bytes do not begin with the magic, or are too few or too many.
    """
    if not data.startswith(MAGIC):
        raise ProgramError(
            ProgramDefect.START,
            0,
            UserMessage(
                'it begins with {begin}, not with "SCARA"', begin=data[:5].hex(" ") or "nothing"
            ),
        )
    if len(data) > MAX_FILE_BYTES:
        raise ProgramError(
            ProgramDefect.LONG,
            MAX_FILE_BYTES,
            UserMessage(
                "it has {file_bytes} bytes; the maximum is {max_file_bytes}",
                file_bytes=len(data),
                max_file_bytes=MAX_FILE_BYTES,
            ),
        )
    min_bytes = min(layout.file_bytes(0, 0) for layout in LAYOUTS.values())
    if len(data) < min_bytes:
        raise ProgramError(
            ProgramDefect.SHORT,
            len(data),
            UserMessage(
                "it has {file_bytes} bytes; header, configuration and footer need {min_bytes}",
                file_bytes=len(data),
                min_bytes=min_bytes,
            ),
        )


def layout_error(data: bytes, layouts: tuple[Layout, ...]) -> ProgramError:
    """Return the error of a file that passes `check_envelope` but has none of these layouts."""
    end = program_bytes(data)
    if end is not None and end < len(data):
        second = data.startswith(MAGIC, end)
        return ProgramError(
            ProgramDefect.SECOND if second else ProgramDefect.SURPLUS,
            end,
            UserMessage(
                "{surplus} follows: the footer ends at byte {end}, but the file has "
                "{file_bytes} bytes",
                surplus="another program" if second else "other data",
                end=end,
                file_bytes=len(data),
            ),
        )
    if not data.endswith(FOOTER):
        return ProgramError(
            ProgramDefect.END,
            len(data) - len(FOOTER),
            UserMessage('it ends with {end}, not with "ARACS"', end=data[-len(FOOTER) :].hex(" ")),
        )
    return _size_error(data, layouts)


def _size_error(data: bytes, layouts: tuple[Layout, ...]) -> ProgramError:
    """Return the error of a wrong size, explained in the most plausible layout."""

    def penalties(layout: Layout) -> tuple[bool, ...]:
        return (
            # Counts in the wrong byte order give extremely large sizes.
            layout.file_bytes(*layout.counts(data)) > 2 * MAX_FILE_BYTES,
            any(data[len(MAGIC) : layout.points_offset]),
            layout.reading == "mixed",
            _wrong_count(data, layout)[0] is ProgramDefect.SIZE,
        )

    layout = min(layouts, key=penalties)
    points, variables = layout.counts(data)
    defect, offset_bytes, room = _wrong_count(data, layout)
    return ProgramError(
        defect,
        offset_bytes,
        UserMessage(
            "the header's points = {points} and varNub = {variables} make {file_bytes} bytes "
            "in layout {layout}, but the file has {actual_bytes}, {room}",
            points=points,
            variables=variables,
            file_bytes=layout.file_bytes(points, variables),
            layout=layout.name,
            actual_bytes=len(data),
            room=room,
        ),
    )


def _wrong_count(data: bytes, layout: Layout) -> tuple[ProgramDefect, int, str]:
    """Return which count of the header is wrong, its position, and the correct value."""
    points, variables = layout.counts(data)
    surplus = len(data) - layout.file_bytes(points, variables)
    extra_nodes, rest = divmod(surplus, layout.node_bytes)
    if not rest and points + extra_nodes >= 0:
        return (
            ProgramDefect.NODES,
            layout.points_offset,
            UserMessage("room for points = {points}", points=points + extra_nodes),
        )
    extra_variables, rest = divmod(surplus, VARIABLE_BYTES)
    if not rest and variables + extra_variables >= 0:
        room = UserMessage("room for varNub = {variables}", variables=variables + extra_variables)
        return ProgramDefect.VARIABLES, layout.points_offset + 4, room
    return ProgramDefect.SIZE, layout.points_offset, "and no other layout fits"
