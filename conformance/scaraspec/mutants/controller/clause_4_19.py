"""Mutants of clause 4.19: the reported gripper center."""

from collections.abc import Callable

from scaraspec.mutants.controller import Core, row
from scaraspec.mutants.operators.controller.replies import first_reply


def _fields(change: Callable[[list[bytes]], list[bytes]]) -> Core:
    """The fields of the reply are changed."""
    return first_reply("get_gripper_center", lambda data: b"|".join(change(data.split(b"|"))))


row(
    "gripper-of-two-numbers",
    "4.19/2",
    "The gripper center has no height.",
    _fields(lambda fields: fields[:-1]),
)
row(
    "gripper-of-six-numbers",
    "4.19/2",
    "The gripper center has three angles.",
    _fields(lambda fields: [*fields, b"0", b"0", b"0"]),
)
row(
    "gripper-in-exponents",
    "4.19/2",
    "The numbers of the gripper center have exponents.",
    _fields(lambda fields: [b"%e" % float(field) for field in fields]),
)
row(
    "gripper-with-names",
    "4.19/2",
    "Each number of the gripper center has its name.",
    _fields(lambda fields: [b"x=" + fields[0], b"y=" + fields[1], b"z=" + fields[2]]),
)
