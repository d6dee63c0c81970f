"""Mutants of clause 4.20: setting the gripper center."""

from collections.abc import Callable, Iterable
from typing import Any, Final

from scaraspec.client.core import ClientCore
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.mutants.client import row
from scaraspec.mutants.operators.client.messages import request_data, request_fields
from scaraspec.protocol.commands import BY_NAME, Point
from scaraspec.protocol.frames import Frame

_SET: Final = "set_gripper_center"


def _numbers(write: Callable[[float], str]) -> type[ClientCore]:
    """The numbers of the gripper center are written in another way."""

    class Numbers(ClientCore):
        point: Point | None = None

        def command(self, name: str, value: Any = None) -> PendingOperation:
            self.point = value if name == _SET else None
            return super().command(name, value)

        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._written, frames))

        def _written(self, frame: Frame) -> Frame:
            if self.point is None or frame.opcode != BY_NAME[_SET].opcode:
                return frame
            return frame._replace(data="|".join(map(write, self.point)).encode())

    return Numbers


row(
    "gripper-back-to-front",
    "4.20/1",
    "The gripper center is sent as z, y and x.",
    request_fields(_SET, lambda fields: fields[::-1]),
)
row(
    "gripper-between-blanks",
    "4.20/1",
    "The numbers of the gripper center are separated by spaces, as the document prints them.",
    request_data(_SET, lambda data: data.replace(b"|", b" ")),
)
row(
    "gripper-in-brackets",
    "4.20/1",
    "The gripper center is sent in brackets.",
    request_data(_SET, lambda data: b"(" + data + b")"),
)
row(
    "gripper-with-decimal-commas",
    "4.20/1",
    "The numbers of the gripper center have a decimal comma.",
    request_data(_SET, lambda data: data.replace(b".", b",")),
    subtle=True,
)
row(
    "large-numbers-with-exponent",
    "4.20/1",
    "Large numbers are sent with an exponent: a million is 1e+06.",
    _numbers(lambda number: f"{number:g}" if abs(number) >= 1 else f"{number:.3f}"),
    subtle=True,
)
row(
    "small-numbers-with-exponent",
    "4.20/1",
    "Small numbers are sent with an exponent: a hundred-thousandth is 1e-05.",
    _numbers(repr),
    subtle=True,
)
row(
    "zeros-are-left-away",
    "4.20/1",
    "The number 0 is sent as an empty field.",
    _numbers(lambda number: f"{number:.3f}" if number else ""),
    subtle=True,
)
row(
    "small-negatives-are-positive",
    "4.20/1",
    "Numbers between -1 and 0 are sent without sign.",
    _numbers(lambda number: f"{abs(number) if number > -1 else number:.3f}"),
    subtle=True,
)
