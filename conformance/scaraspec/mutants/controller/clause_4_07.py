"""Faults of clause 4.7: the version of the software."""

from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_GET_VERSION: Final = 0x08
_LATE: Final = 256


@mutant("no-version", "4.7/2", "4.7/3")
class NoVersion(AltersReplies):
    """The reply to 0x08 has no data."""

    opcode = _GET_VERSION

    def altered(self, data: bytes) -> bytes:
        """Leave it away."""
        return data[:0]


@mutant("version-counts-requests", "4.7/4")
class VersionCountsRequests(ControllerCore):
    """The last number of the version counts how often it was asked for."""

    _count = 0

    def get_version(self, request: Request) -> str:
        """Count."""
        self._count += 1
        return super().get_version(request)[:-1] + f"{self._count}"


@mutant("version-changes-late", "4.7/4", subtle=True)
class VersionChangesLate(ControllerCore):
    """From the 256th request on the version is another one."""

    _count = 0

    def get_version(self, request: Request) -> str:
        """Count."""
        self._count += 1
        return super().get_version(request) if self._count < _LATE else "1.0.255"


@mutant("version-of-the-connection", "4.7/4", subtle=True)
class VersionOfTheConnection(ControllerCore):
    """Every other connection is told another version."""

    def get_version(self, request: Request) -> str:
        """Look at its number."""
        return "1.0.0" if request.session.connection % 2 else "1.0.1"
