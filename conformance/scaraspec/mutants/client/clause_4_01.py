"""Mutants of clause 4.1: the login."""

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import LinkLost
from scaraspec.client.pending_operation import Login, PendingOperation
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.messages import reply_data, request_data
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame

# The request

row(
    "passwords-in-small-letters",
    "4.1/1",
    "Passwords are sent in lower case.",
    request_data("login", bytes.lower),
)
row(
    "cuts-long-passwords",
    "4.1/1 T/10",
    "Passwords are cut to sixteen characters.",
    request_data("login", lambda data: data[:16]),
    subtle=True,
)
row(
    "trims-passwords",
    "4.1/1",
    "Spaces at the ends of a password are not sent.",
    request_data("login", lambda data: data.strip() or data),
    subtle=True,
)

# The reply


@mutant("asks-for-the-status-when-refused", "4.1/5", subtle=True)
class RequestsStatusWhenRefused(ClientCore):
    """After a refused login, the client requests the status."""

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        if isinstance(operation, Login) and operation.error:
            self._send([Frame(A2C, BY_NAME["get_status"].opcode)])
        return super()._after_step(operation, now_s)


@mutant("goes-on-when-refused", "4.1/5")
class ContinuesWhenRefused(AsyncClient):
    """A refused login is reported, but the connection can be used."""

    class core(ClientCore):  # noqa: N801 - it fills in the attribute
        """The core is logged in after any reply."""

        def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
            events = super()._after_step(operation, now_s)
            self.logged_in |= isinstance(operation, Login)
            return events

    async def _login(self) -> None:
        if self._password is not None:
            await self.login(self._password)


@mutant("stops-when-refused", "4.1/5", subtle=True)
class StopsWhenRefused(ContinuesWhenRefused):
    """After a refused login, only the emergency stop is sent."""

    class core(ClientCore):  # noqa: N801 - it fills in the attribute
        """The core sends the emergency stop without a login."""

        def begin(self, operation: PendingOperation, now_s: float) -> None:
            logged_in = self.logged_in
            self.logged_in = logged_in or operation.command.name == "emergency_stop"
            super().begin(operation, now_s)
            self.logged_in = logged_in


row(
    "all-but-no-is-yes",
    "4.1/8",
    "Every reply to the login other than 0 is taken as 1.",
    reply_data("login", lambda data: data if data == b"0" else b"1"),
)
row(
    "looks-at-the-first-character",
    "4.1/8",
    "Only the first character of the reply to the login is read.",
    reply_data("login", lambda data: data[:1]),
    subtle=True,
)
row(
    "nothing-is-yes",
    "4.1/8",
    "A reply to the login without data is taken as 1.",
    reply_data("login", {b"": b"1"}),
    subtle=True,
)


@mutant("loss-is-yes", "4.1/8", "2/1", subtle=True)
class ConnectedAfterLoss(AsyncClient):
    """A connection that is lost before the reply to the login is reported as established."""

    async def connect(self) -> None:
        try:
            await super().connect()
        except LinkLost:
            if self._transport is None:
                raise
