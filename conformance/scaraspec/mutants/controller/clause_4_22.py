"""Mutants of clause 4.22: the reported initial tool position."""

from typing import Final

from scaraspec.mutants.controller import row
from scaraspec.mutants.operators.controller.replies import first_reply, length_byte

_GET: Final = "get_initial_tool_position"

row(
    "position-of-four-numbers",
    "4.22/2",
    "The initial position has no thetaY and thetaZ.",
    first_reply(_GET, lambda data: b"|".join(data.split(b"|")[:4])),
)
row(
    "position-with-empty-angles",
    "4.22/2",
    "thetaY and thetaZ are empty fields.",
    first_reply(_GET, lambda data: b"|".join((*data.split(b"|")[:4], b"", b""))),
)
row(
    "position-between-blanks",
    "4.22/2",
    "Blanks separate the numbers of the initial position.",
    first_reply(_GET, lambda data: data.replace(b"|", b" ")),
)
row(
    "position-length-as-printed",
    "4.22/2",
    "The length byte is two too high, as in the table row of the document.",
    length_byte(_GET, lambda size_bytes: size_bytes + 2),
)
