"""Faults of clause 4.19: the gripper centre as it is told."""

from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies

_GET_GRIPPER: Final = 0x34


@mutant("gripper-of-two-numbers", "4.19/2")
class GripperOfTwoNumbers(AltersReplies):
    """The gripper centre is told without its height."""

    opcode = _GET_GRIPPER

    def altered(self, data: bytes) -> bytes:
        """Leave the last field away."""
        return data.rpartition(b"|")[0]


@mutant("gripper-of-six-numbers", "4.19/2")
class GripperOfSixNumbers(AltersReplies):
    """The gripper centre is told with three angles."""

    opcode = _GET_GRIPPER

    def altered(self, data: bytes) -> bytes:
        """Add them."""
        return data + b"|0|0|0"


@mutant("gripper-in-exponents", "4.19/2")
class GripperInExponents(AltersReplies):
    """The numbers of the gripper centre have exponents."""

    opcode = _GET_GRIPPER

    def altered(self, data: bytes) -> bytes:
        """Write them so."""
        return b"|".join(b"%e" % float(field) for field in data.split(b"|"))


@mutant("gripper-with-names", "4.19/2")
class GripperWithNames(AltersReplies):
    """Each number of the gripper centre bears its name."""

    opcode = _GET_GRIPPER

    def altered(self, data: bytes) -> bytes:
        """Add them."""
        pairs = zip((b"x", b"y", b"z"), data.split(b"|"), strict=True)
        return b"|".join(name + b"=" + field for name, field in pairs)
