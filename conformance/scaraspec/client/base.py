"""The base classes that `Client` and `AsyncClient` share."""

from collections.abc import Mapping

from scaraspec.client.core import ClientCore
from scaraspec.client.errors import ReplyTimeout
from scaraspec.client.operations import Operations
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.protocol.readings import Dialect
from scaraspec.transports.link import Ending
from scaraspec.user_message import UserMessage

LINK_LOST_REASONS = {
    Ending.CLOSED: "the controller closed the connection",
    Ending.RESET: "the controller reset the connection",
}
NOT_CONNECTED = "this client is not connected: call connect(), or use a with statement"
CLOSED_LOCALLY = "this client was closed"


class ClientBase(Operations):
    """A core and its operations. Subclasses add the link and the clock."""

    def __init__(self, core: ClientCore) -> None:
        self._core = core

    @property
    def dialect(self) -> Dialect:
        """The readings in use, including those that were detected on this controller."""
        return self._core.dialect

    @property
    def observed_readings(self) -> Mapping[str, frozenset[str]]:
        """The readings that the controller's frames show, each with the options observed."""
        return {
            key: frozenset(options) for key, options in tuple(self._core.observed_readings.items())
        }

    @property
    def remarks(self) -> tuple[str, ...]:
        """The latest deviations of the controller's frames, one sentence each, latest last."""
        return tuple(self._core.remarks)


class PendingBase:
    """A two-stage command whose first reply has arrived."""

    def __init__(self, operation: PendingOperation) -> None:
        self._operation = operation

    @property
    def accepted(self) -> bool:
        """Whether the first reply accepted the command (4/13)."""
        return bool(self._operation.accepted)

    @property
    def done(self) -> bool:
        """Whether the command has ended, so that `wait` returns at once."""
        return self._operation.settled

    def _no_result(self, timeout_s: float | None) -> ReplyTimeout:
        return ReplyTimeout(
            UserMessage(
                "{command} has no final result after {timeout_s:g} s: "
                "it may still be executing; check with get_status",
                command=self._operation.command.name,
                timeout_s=timeout_s or 0,
            )
        )
