"""Mutants of clause 4.28: the direction of a jog."""

from collections.abc import Iterable

from scaraspec.client.core import ClientCore
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.messages import numbered_request, request_data
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame


def _opposite(data: bytes) -> bytes:
    return data.translate(bytes.maketrans(b"1234", b"2143"))


row(
    "jog-in-two-digits",
    "4.28/1",
    "The direction of a jog is sent in two digits.",
    request_data("jog", lambda data: b"0" + data),
)
row(
    "jog-in-words",
    "4.28/1",
    "The direction of a jog is sent as sign and axis.",
    request_data("jog", lambda data: (b"+y", b"-y", b"+x", b"-x")[int(data) - 1]),
)
row(
    "later-jogs-say-more",
    "4.28/1",
    "From the second jog on, a 0 follows the direction.",
    numbered_request("jog", lambda data, number: data + b"0" if number > 1 else data),
    subtle=True,
)
row(
    "jog-counts-from-zero",
    "4.28/2",
    "The directions of jogs are counted from 0.",
    request_data("jog", lambda data: b"%d" % (int(data) - 1)),
)
row(
    "jog-in-letters",
    "4.28/2",
    "The directions of jogs are sent as the letters a to d.",
    request_data("jog", lambda data: b"abcd"[int(data) - 1 : int(data)]),
)
row(
    "jog-in-two-forms",
    "4.28/2",
    "From the fifth jog on, the direction is sent as a number in one byte.",
    numbered_request("jog", lambda data, number: bytes([int(data)]) if number > 4 else data),
    subtle=True,
)
row(
    "jog-begins-with-x",
    "4.28/3",
    "The directions of jogs are counted from +X.",
    request_data("jog", lambda data: data.translate(bytes.maketrans(b"1234", b"3412"))),
)
row(
    "jog-mixes-up-signs",
    "4.28/3",
    "The signs of the directions of jogs are swapped.",
    request_data("jog", _opposite),
)


@mutant("second-jog-turns-back", "4.28/3", subtle=True)
class ReversesSecondJog(ClientCore):
    """The second jog in the same direction is sent in the opposite direction."""

    _before = b""

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(map(self._reversed, frames))

    def _reversed(self, frame: Frame) -> Frame:
        if frame.opcode != BY_NAME["jog"].opcode:
            return frame
        second = frame.data == self._before
        self._before = b"" if second else frame.data
        return frame._replace(data=_opposite(frame.data)) if second else frame
