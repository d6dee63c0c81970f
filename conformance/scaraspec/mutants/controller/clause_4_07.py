"""Mutants of clause 4.7: the software version."""

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import on_request
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

row(
    "no-version",
    "4.7/2 4.7/3",
    "The reply to 0x08 has no data.",
    first_reply("get_version", lambda _data: b""),
)


@mutant("version-counts-requests", "4.7/4")
class CountsRequestsInVersion(ControllerCore):
    """The last number of the version counts the requests for it."""

    _count = 0

    def get_version(self, request: Request) -> str:
        self._count += 1
        return super().get_version(request)[:-1] + f"{self._count}"


@mutant("version-changes-late", "4.7/4", subtle=True)
class ChangesVersionLate(ControllerCore):
    """The version changes at the 256th request."""

    _count = 0

    def get_version(self, request: Request) -> str:
        self._count += 1
        return super().get_version(request) if self._count < 256 else "1.0.255"


row(
    "version-of-the-connection",
    "4.7/4",
    "Every second connection receives another version.",
    on_request(
        "get_version",
        lambda _core, request: "1.0.0" if request.session.connection % 2 else "1.0.1",
    ),
    subtle=True,
)
