"""Mutants of clause 4.24: the move to tool coordinates."""

from typing import Final

from scaraspec.mutants.client import row
from scaraspec.mutants.operators.client.messages import request_fields, unchecked

_MOVE: Final = "set_tool_coordinates"


def _y_before_negative_x(fields: list[bytes]) -> list[bytes]:
    speed, x, y, *rest = fields
    return [speed, y, x, *rest] if x.startswith(b"-") else fields


def _whole_millimetres(fields: list[bytes]) -> list[bytes]:
    return [fields[0], *(field.partition(b".")[0] for field in fields[1:4]), *fields[4:]]


row(
    "speed-comes-last",
    "4.24/1",
    "The speed of a move is sent after the pose.",
    request_fields(_MOVE, lambda fields: [*fields[1:], fields[0]]),
)
row(
    "move-without-speed",
    "4.24/1",
    "A move is sent without its speed.",
    request_fields(_MOVE, lambda fields: fields[1:]),
)
row(
    "move-of-five-numbers",
    "4.24/1",
    "A move is sent without the two angles that have no meaning.",
    request_fields(_MOVE, lambda fields: fields[:5]),
)
row(
    "move-swaps-axes",
    "4.24/1",
    "x and y of a move are swapped if x is negative.",
    request_fields(_MOVE, _y_before_negative_x),
    subtle=True,
)
row(
    "move-in-whole-millimetres",
    "4.24/1",
    "The coordinates of a move are sent in whole millimetres.",
    request_fields(_MOVE, _whole_millimetres),
    subtle=True,
)
row(
    "speed-with-its-unit",
    "4.24/2",
    "The speed of a move is sent with a percent sign.",
    request_fields(_MOVE, lambda fields: [fields[0] + b"%", *fields[1:]]),
)
row(
    "speed-as-fraction",
    "4.24/2",
    "The speed of a move is sent as a fraction of full speed.",
    request_fields(_MOVE, lambda fields: [b"%.2f" % (int(fields[0]) / 100), *fields[1:]]),
)
row(
    "full-speed-is-ninety-nine",
    "4.24/2",
    "Full speed is sent as 99 %.",
    request_fields(
        _MOVE, lambda fields: [b"99" if fields[0] == b"100" else fields[0], *fields[1:]]
    ),
    subtle=True,
)
row(
    "speed-zero-is-sent",
    "4.24/2",
    "A speed of 0 % or less is sent.",
    unchecked(_MOVE, lambda value: value == int(value) and value < 1),
    subtle=True,
)
row(
    "speed-of-byte-size-is-sent",
    "4.24/2",
    "A speed of 101 to 255 % is sent.",
    unchecked(_MOVE, lambda value: value == int(value) and 100 < value < 256),
    subtle=True,
)
row(
    "half-percents-are-sent",
    "4.24/2",
    "A speed that is not a whole number is sent.",
    unchecked(_MOVE, lambda value: value != int(value)),
    subtle=True,
)
