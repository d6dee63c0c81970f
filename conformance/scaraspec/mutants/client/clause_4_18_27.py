"""Faults of clauses 4.18 to 4.27: requests without data that carry some, or are other ones."""

from typing import Final

from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests, ReplacesRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_JOINTS: Final = b"4"


class _KeepsFormerData(AltersRequests):
    """A request without data carries those of another one, which were in the buffer before."""

    former: str
    """Whose."""
    _buffer = b""

    def _altered(self, frame: Frame) -> Frame:
        if frame.opcode == BY_NAME[self.former].opcode:
            self._buffer = frame.data
        return super()._altered(frame)

    def altered(self, data: bytes) -> bytes:
        """Do not empty it."""
        return data + self._buffer


@mutant("reset-says-one", "4.18/1")
class ResetSaysOne(AltersRequests):
    """The reset carries a 1."""

    name = "reset"

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"1"


@mutant("second-reset-is-forced", "4.18/1", subtle=True)
class SecondResetIsForced(AltersRequests):
    """Every reset but the first carries the word force."""

    name = "reset"
    _count = 0

    def altered(self, data: bytes) -> bytes:
        """Count."""
        self._count += 1
        return data + b"force" if self._count > 1 else data


@mutant("gripper-is-asked-for-by-name", "4.19/1")
class GripperIsAskedForByName(AltersRequests):
    """The request for the gripper centre carries the word tcp."""

    name = "get_gripper_center"

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"tcp"


@mutant("gripper-is-asked-for-as-it-was-set", "4.19/1", subtle=True)
class GripperIsAskedForAsItWasSet(_KeepsFormerData):
    """The request for the gripper centre carries the one that was set before."""

    name, former = "get_gripper_center", "set_gripper_center"


@mutant("position-is-asked-for-with-nul", "4.22/1")
class PositionIsAskedForWithNul(AltersRequests):
    """The request for the initial tool position carries the NUL that ends an empty text."""

    name = "get_initial_tool_position"

    def altered(self, data: bytes) -> bytes:
        """Count it."""
        return data + b"\0"


@mutant("position-is-asked-for-as-it-was-set", "4.22/1", subtle=True)
class PositionIsAskedForAsItWasSet(_KeepsFormerData):
    """The request for the initial tool position carries the one that was set before."""

    name, former = "get_initial_tool_position", "set_initial_tool_position"


@mutant("pose-is-asked-for-by-its-parts", "4.23/1")
class PoseIsAskedForByItsParts(AltersRequests):
    """The request for the tool coordinates says how many are wanted."""

    name = "get_tool_coordinates"

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"6"


@mutant("pose-is-asked-for-as-it-was-commanded", "4.23/1", subtle=True)
class PoseIsAskedForAsItWasCommanded(_KeepsFormerData):
    """The request for the tool coordinates carries the target of the last move."""

    name, former = "get_tool_coordinates", "set_tool_coordinates"


@mutant("release-names-all-joints", "4.25/1")
class ReleaseNamesAllJoints(AltersRequests):
    """The release of the joints says how many there are."""

    name = "release_joints"

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + _JOINTS


@mutant("release-is-lock-with-zero", "4.25/1")
class ReleaseIsLockWithZero(ReplacesRequests):
    """The joints are released by a lock that carries a 0."""

    name = "release_joints"

    def replaced(self, frame: Frame) -> Frame:
        """Lock with it."""
        return frame._replace(opcode=BY_NAME["lock_joints"].opcode, data=b"0")


@mutant("lock-says-one", "4.26/1")
class LockSaysOne(AltersRequests):
    """The lock of the joints carries a 1."""

    name = "lock_joints"

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"1"


@mutant("second-lock-releases", "4.26/1", subtle=True)
class SecondLockReleases(ReplacesRequests):
    """The lock is a switch: every second one releases the joints."""

    name = "lock_joints"
    _locked = False

    def replaced(self, frame: Frame) -> Frame:
        """Switch."""
        self._locked = not self._locked
        return frame if self._locked else frame._replace(opcode=BY_NAME["release_joints"].opcode)


@mutant("angles-are-asked-for-by-number", "4.27/1")
class AnglesAreAskedForByNumber(AltersRequests):
    """The request for the joint angles says how many are wanted."""

    name = "get_joint_angles"

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + _JOINTS


@mutant("angles-are-asked-for-as-they-were", "4.27/1", subtle=True)
class AnglesAreAskedForAsTheyWere(AltersRequests):
    """From the third time on the request for the joint angles says which time it is."""

    name = "get_joint_angles"
    _count = 0

    def altered(self, data: bytes) -> bytes:
        """Count."""
        self._count += 1
        return data + b"%d" % self._count if self._count > 2 else data
