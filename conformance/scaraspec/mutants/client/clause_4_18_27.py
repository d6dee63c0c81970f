"""Mutants of clauses 4.18 to 4.27: requests without data."""

from collections.abc import Iterable

from scaraspec.client.core import ClientCore
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.messages import (
    numbered_request,
    request_after,
    request_data,
    request_frame,
)
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_LOCK = BY_NAME["lock_joints"].opcode
_RELEASE = BY_NAME["release_joints"].opcode


def _with_data_of(command: str, other: str) -> type[ClientCore]:
    """A request contains the data of the last `other` request."""
    return request_after(command, other, lambda data, last: data + last)


row(
    "reset-says-one",
    "4.18/1",
    "The reset request contains a 1.",
    request_data("reset", lambda data: data + b"1"),
)
row(
    "second-reset-is-forced",
    "4.18/1",
    "From the second time on, the reset request contains the word force.",
    numbered_request("reset", lambda data, number: data + b"force" if number > 1 else data),
    subtle=True,
)
row(
    "gripper-is-asked-for-by-name",
    "4.19/1",
    "The request for the gripper center contains the word tcp.",
    request_data("get_gripper_center", lambda data: data + b"tcp"),
)
row(
    "gripper-is-asked-for-as-it-was-set",
    "4.19/1",
    "The request for the gripper center contains the one that was set last.",
    _with_data_of("get_gripper_center", "set_gripper_center"),
    subtle=True,
)
row(
    "position-is-asked-for-with-nul",
    "4.22/1",
    "The request for the initial tool position contains a NUL.",
    request_data("get_initial_tool_position", lambda data: data + b"\0"),
)
row(
    "position-is-asked-for-as-it-was-set",
    "4.22/1",
    "The request for the initial tool position contains the one that was set last.",
    _with_data_of("get_initial_tool_position", "set_initial_tool_position"),
    subtle=True,
)
row(
    "pose-is-asked-for-by-its-parts",
    "4.23/1",
    "The request for the tool coordinates contains their number.",
    request_data("get_tool_coordinates", lambda data: data + b"6"),
)
row(
    "pose-is-asked-for-as-it-was-commanded",
    "4.23/1",
    "The request for the tool coordinates contains the target of the last move.",
    _with_data_of("get_tool_coordinates", "set_tool_coordinates"),
    subtle=True,
)
row(
    "release-names-all-joints",
    "4.25/1",
    "The request to release the joints contains their number.",
    request_data("release_joints", lambda data: data + b"4"),
)
row(
    "release-is-lock-with-zero",
    "4.25/1",
    "The joints are released with a lock request that contains a 0.",
    request_frame("release_joints", lambda frame: frame._replace(opcode=_LOCK, data=b"0")),
)
row(
    "lock-says-one",
    "4.26/1",
    "The lock request contains a 1.",
    request_data("lock_joints", lambda data: data + b"1"),
)


@mutant("second-lock-releases", "4.26/1", subtle=True)
class EverySecondLockReleases(ClientCore):
    """Every second lock is sent as a release."""

    locked = False

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            self.locked ^= frame.opcode == _LOCK
            releases = frame.opcode == _LOCK and not self.locked
            super()._send([frame._replace(opcode=_RELEASE) if releases else frame])


row(
    "angles-are-asked-for-by-number",
    "4.27/1",
    "The request for the joint angles contains their number.",
    request_data("get_joint_angles", lambda data: data + b"4"),
)
row(
    "angles-are-asked-for-as-they-were",
    "4.27/1",
    "From the third time on, the request for the joint angles contains its number.",
    numbered_request(
        "get_joint_angles", lambda data, number: data + b"%d" % number if number > 2 else data
    ),
    subtle=True,
)
