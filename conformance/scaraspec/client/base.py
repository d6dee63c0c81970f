"""What both shells share: a core, what it can tell of the controller, and commands under way."""

from collections.abc import Mapping

from scaraspec.client.core import ClientCore
from scaraspec.client.errors import ReplyTimeout
from scaraspec.client.operations import Operations
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.protocol.readings import Dialect
from scaraspec.transports.link import Ending

LINK_LOST_REASONS = {
    Ending.CLOSED: "the controller has closed the connection",
    Ending.RESET: "the controller has cut the connection",
}
NOT_CONNECTED = "this client is not connected: call connect(), or use it in a with statement"
CLOSED_LOCALLY = "this client was closed"


class ClientBase(Operations):
    """A core with operations; how bytes and time get to it is added by a shell."""

    def __init__(self, core: ClientCore) -> None:
        self._core = core

    @property
    def dialect(self) -> Dialect:
        """The readings that are spoken; where another one was found out, that one."""
        return self._core.dialect

    @property
    def observed_readings(self) -> Mapping[str, frozenset[str]]:
        """The readings that the controller's frames gave away, each with the options seen."""
        return {key: frozenset(seen) for key, seen in tuple(self._core.observed_readings.items())}

    @property
    def remarks(self) -> tuple[str, ...]:
        """What did not conform in the controller's frames, the latest last, a sentence each."""
        return tuple(self._core.remarks)


class PendingBase:
    """A two-stage command whose first reply is in."""

    def __init__(self, operation: PendingOperation) -> None:
        self._operation = operation

    @property
    def accepted(self) -> bool:
        """Whether the first reply said yes (4/13)."""
        return bool(self._operation.accepted)

    @property
    def done(self) -> bool:
        """Whether its end is known, so that waiting for it returns at once."""
        return self._operation.settled

    def _no_result(self, timeout_s: float | None) -> ReplyTimeout:
        return ReplyTimeout(
            f"{self._operation.command.name} has no final result after {timeout_s or 0:g} s: "
            "it may still be executing, get_status tells"
        )
