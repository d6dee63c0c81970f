"""Faults of clauses 4.19 to 4.23: points and poses as they are set and told; what counts."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersFields, AltersReplies
from scaraspec.protocol.commands import BY_NAME, Point, Pose
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import Frame

_SET: Final = "set_initial_tool_position"
_GET: Final = "get_tool_coordinates"
_PRINTED_BYTES: Final = 25  # L450


# 4.21


@mutant("position-of-four-numbers", "4.21/1")
class PositionOfFourNumbers(AltersFields):
    """The initial position is sent without the angles that mean nothing."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Leave them away."""
        return fields[:4]


@mutant("position-begins-with-its-angles", "4.21/1")
class PositionBeginsWithItsAngles(AltersFields):
    """The initial position is sent with the angles ahead of x, y and z."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Turn them round."""
        return fields[3:] + fields[:3]


@mutant("position-swaps-useless-angles", "4.21/1", subtle=True)
class PositionSwapsUselessAngles(AltersFields):
    """Of the initial position thetaY and thetaZ are sent in each other's place."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Swap them."""
        return [*fields[:4], fields[5], fields[4]]


@mutant("position-within-half-turns", "4.21/1", subtle=True)
class PositionWithinHalfTurns(AltersFields):
    """Angles of the initial position beyond half a turn are sent as the same angle within."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Turn it back."""
        return [*fields[:3], b"%.1f" % ((float(fields[3]) + 180) % 360 - 180), *fields[4:]]


@mutant("position-of-zeros-is-empty", "4.21/1", subtle=True)
class PositionOfZerosIsEmpty(AltersFields):
    """Zeros at the end of the initial position are left away, bars and all."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Leave them away."""
        while fields[-1:] == [b"0"]:
            fields = fields[:-1]
        return fields


class _Miscounts(ClientCore, ABC):
    """The length byte of the initial position is another one."""

    @abstractmethod
    def length(self, size_bytes: int) -> int:
        """Which."""

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            if frame.opcode != BY_NAME[_SET].opcode:
                super()._send([frame])
                continue
            data = frame.encode()
            self._outbox += data[:2] + bytes([self.length(data[2])]) + data[3:]


@mutant("position-length-as-printed", "4.21/6")
class PositionLengthAsPrinted(_Miscounts):
    """The length byte of the initial position is always 25, as in the document's row."""

    def length(self, size_bytes: int) -> int:  # noqa: ARG002 - always the same
        """Copy it."""
        return _PRINTED_BYTES


@mutant("position-length-of-the-former", "4.21/6", subtle=True)
class PositionLengthOfTheFormer(_Miscounts):
    """The length byte of the initial position is that of the one before."""

    _before = 0

    def length(self, size_bytes: int) -> int:
        """Remember it."""
        before, self._before = self._before, size_bytes
        return before or size_bytes


# 4.19, 4.22, 4.23: as they are told


@mutant("gripper-is-told-in-whole-millimetres", "T/9", "4.19/1", subtle=True)
class GripperIsToldInWholeMillimetres(AsyncClient):
    """Of the gripper centre whole millimetres are told."""

    async def get_gripper_center(self) -> Point:
        """Cut the rest."""
        return Point(*map(int, await super().get_gripper_center()))


@mutant("position-is-told-without-signs", "T/9", "4.22/1", subtle=True)
class PositionIsToldWithoutSigns(AsyncClient):
    """Of the initial position the signs of thetaX are lost."""

    async def get_initial_tool_position(self) -> Pose:
        """Lose them."""
        pose = await super().get_initial_tool_position()
        return pose._replace(theta_x=abs(pose.theta_x))


@mutant("pose-is-told-once", "T/9", "4.23/1", subtle=True)
class PoseIsToldOnce(AsyncClient):
    """The tool coordinates are told as they were when they were asked for the first time."""

    _first: Pose | None = None

    async def get_tool_coordinates(self) -> Pose:
        """Remember them."""
        now = await super().get_tool_coordinates()
        self._first = self._first or now
        return self._first


# What counts


@mutant("tilted-poses-are-refused", "4.23/4")
class TiltedPosesAreRefused(AsyncClient):
    """Tool coordinates whose thetaY or thetaZ is not 0 are taken for damaged."""

    async def get_tool_coordinates(self) -> Pose:
        """Look at them."""
        pose = await super().get_tool_coordinates()
        if pose.theta_y or pose.theta_z:
            raise PayloadError("this arm cannot tilt its tool")
        return pose


@mutant("last-angle-is-added", "4.23/4", subtle=True)
class LastAngleIsAdded(AsyncClient):
    """The angle about the vertical is told as the sum of thetaX and thetaZ."""

    async def get_tool_coordinates(self) -> Pose:
        """Add them."""
        pose = await super().get_tool_coordinates()
        return pose._replace(theta_x=pose.theta_x + pose.theta_z)


class _TurnsAboutZ(AltersFields):
    """What is ordered as thetaX is sent as thetaZ."""

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Move it."""
        return [*fields[:-3], b"0", fields[-2], fields[-3]]


@mutant("position-turns-about-z", "7/2")
class PositionTurnsAboutZ(_TurnsAboutZ):
    """The angle of the initial position is sent as thetaZ, as it turns about the vertical."""

    name = _SET


@mutant("move-turns-about-z", "7/2")
class MoveTurnsAboutZ(_TurnsAboutZ):
    """The angle of a move is sent as thetaZ, as it turns about the vertical."""

    name = "set_tool_coordinates"


@mutant("pose-turns-about-z", "7/2", subtle=True)
class PoseTurnsAboutZ(AltersReplies):
    """The angle of the tool coordinates is looked for in thetaZ where thetaX is not 0."""

    name = _GET

    def altered(self, data: bytes) -> bytes:
        """Look for it there."""
        *place, theta_x, theta_y, theta_z = data.split(b"|")
        return b"|".join((*place, theta_z if float(theta_x) else theta_x, theta_y, theta_z))
