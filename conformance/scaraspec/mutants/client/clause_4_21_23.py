"""Mutants of clauses 4.19 to 4.23 and 7: points and poses that are set and returned."""

from collections.abc import Iterable
from typing import Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import frame_bytes
from scaraspec.mutants.operators.client.messages import reply_data, request_fields, returned
from scaraspec.protocol.commands import BY_NAME, Point, Pose
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import Frame

_SET: Final = "set_initial_tool_position"
_GET: Final = "get_tool_coordinates"


# 4.21


def _within_half_turn(fields: list[bytes]) -> list[bytes]:
    return [*fields[:3], b"%.1f" % ((float(fields[3]) + 180) % 360 - 180), *fields[4:]]


def _without_zeros_at_end(fields: list[bytes]) -> list[bytes]:
    while fields[-1:] == [b"0"]:
        fields = fields[:-1]
    return fields


row(
    "position-of-four-numbers",
    "4.21/1",
    "The initial position is sent without the two angles that have no meaning.",
    request_fields(_SET, lambda fields: fields[:4]),
)
row(
    "position-begins-with-its-angles",
    "4.21/1",
    "The angles of the initial position are sent before x, y and z.",
    request_fields(_SET, lambda fields: fields[3:] + fields[:3]),
)
row(
    "position-swaps-useless-angles",
    "4.21/1",
    "thetaY and thetaZ of the initial position are swapped.",
    request_fields(_SET, lambda fields: [*fields[:4], fields[5], fields[4]]),
    subtle=True,
)
row(
    "position-within-half-turns",
    "4.21/1",
    "thetaX of the initial position is sent as an angle between -180 and 180 degrees.",
    request_fields(_SET, _within_half_turn),
    subtle=True,
)
row(
    "position-of-zeros-is-empty",
    "4.21/1",
    "Zeros at the end of the initial position are not sent.",
    request_fields(_SET, _without_zeros_at_end),
    subtle=True,
)
row(
    "position-length-as-printed",
    "4.21/6",
    "The length byte of the initial position is always 25, as the document prints it.",
    frame_bytes(_SET, lambda frame: frame[:2] + bytes((25,)) + frame[3:]),
)


@mutant("position-length-of-the-former", "4.21/6", subtle=True)
class SendsPreviousLength(ClientCore):
    """The length byte of the initial position is the one of the previous request."""

    _length = b""

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            data = frame.encode()
            if frame.opcode == BY_NAME[_SET].opcode:
                length, self._length = self._length or data[2:3], data[2:3]
                data = data[:2] + length + data[3:]
            self._outbox += data


# 4.19, 4.22 and 4.23

row(
    "gripper-is-told-in-whole-millimetres",
    "T/9 4.19/1",
    "The gripper center is returned in whole millimetres.",
    returned("get_gripper_center", lambda point: Point(*map(int, point))),
    subtle=True,
)
row(
    "position-is-told-without-signs",
    "T/9 4.22/1",
    "thetaX of the initial position is returned without its sign.",
    returned("get_initial_tool_position", lambda pose: pose._replace(theta_x=abs(pose.theta_x))),
    subtle=True,
)


@mutant("pose-is-told-once", "T/9", "4.23/1", subtle=True)
class RepeatsFirstPose(AsyncClient):
    """The tool coordinates of the first reply are always returned."""

    _first: Pose | None = None

    async def get_tool_coordinates(self) -> Pose:
        now = await super().get_tool_coordinates()
        self._first = self._first or now
        return self._first


# The meaning of the angles


def _not_tilted(pose: Pose) -> Pose:
    if pose.theta_y or pose.theta_z:
        raise PayloadError("this arm cannot tilt its tool")
    return pose


def _angle_as_theta_z(fields: list[bytes]) -> list[bytes]:
    return [*fields[:-3], b"0", fields[-2], fields[-3]]


def _theta_z_as_angle(data: bytes) -> bytes:
    *place, theta_x, theta_y, theta_z = data.split(b"|")
    return b"|".join((*place, theta_z if float(theta_x) else theta_x, theta_y, theta_z))


row(
    "tilted-poses-are-refused",
    "4.23/4",
    "Tool coordinates with a thetaY or thetaZ other than 0 are reported as an error.",
    returned(_GET, _not_tilted),
)
row(
    "last-angle-is-added",
    "4.23/4",
    "thetaX of the tool coordinates is returned as the sum of thetaX and thetaZ.",
    returned(_GET, lambda pose: pose._replace(theta_x=pose.theta_x + pose.theta_z)),
    subtle=True,
)
row(
    "position-turns-about-z",
    "7/2",
    "thetaX of the initial position is sent as thetaZ.",
    request_fields(_SET, _angle_as_theta_z),
)
row(
    "move-turns-about-z",
    "7/2",
    "thetaX of a move is sent as thetaZ.",
    request_fields("set_tool_coordinates", _angle_as_theta_z),
)
row(
    "pose-turns-about-z",
    "7/2",
    "thetaX of the tool coordinates is read from thetaZ if it is not 0.",
    reply_data(_GET, _theta_z_as_angle),
    subtle=True,
)
