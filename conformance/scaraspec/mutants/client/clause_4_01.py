"""Faults of 4.1: the login."""

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import LinkLost
from scaraspec.client.pending_operation import Login, PendingOperation
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersReplies, AltersRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame

# What is sent


@mutant("passwords-in-small-letters", "4.1/1")
class PasswordsInSmallLetters(AltersRequests):
    """Passwords are sent in small letters."""

    name = "login"

    def altered(self, data: bytes) -> bytes:
        """Make them so."""
        return data.lower()


@mutant("cuts-long-passwords", "4.1/1", "T/10", subtle=True)
class CutsLongPasswords(AltersRequests):
    """Passwords are cut to sixteen characters."""

    name = "login"

    def altered(self, data: bytes) -> bytes:
        """Cut them."""
        return data[:16]


@mutant("trims-passwords", "4.1/1", subtle=True)
class TrimsPasswords(AltersRequests):
    """Blanks at the ends of a password are not sent."""

    name = "login"

    def altered(self, data: bytes) -> bytes:
        """Trim it."""
        return data.strip() or data


# What is made of the answer


@mutant("asks-for-the-status-when-refused", "4.1/5", subtle=True)
class AsksForTheStatusWhenRefused(ClientCore):
    """When its login was refused it asks for the status."""

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        if isinstance(operation, Login) and operation.error:
            self._send([Frame(A2C, BY_NAME["get_status"].opcode)])
        return super()._after_step(operation, now_s)


@mutant("goes-on-when-refused", "4.1/5")
class GoesOnWhenRefused(AsyncClient):
    """A refused login is told as such, and does not keep it from anything."""

    class core(ClientCore):  # noqa: N801 - it fills in the attribute
        """Takes itself for logged in."""

        def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
            events = super()._after_step(operation, now_s)
            self.logged_in |= isinstance(operation, Login)
            return events

    async def _login(self) -> None:
        if self._password is not None:
            await self.login(self._password)


@mutant("stops-when-refused", "4.1/5", subtle=True)
class StopsWhenRefused(GoesOnWhenRefused):
    """After a refused login nothing is sent but the emergency stop."""

    class core(ClientCore):  # noqa: N801 - it fills in the attribute
        """Takes itself for logged in where it is to stop."""

        def begin(self, operation: PendingOperation, now_s: float) -> None:
            """Send it."""
            logged_in = self.logged_in
            self.logged_in = logged_in or operation.command.name == "emergency_stop"
            super().begin(operation, now_s)
            self.logged_in = logged_in


@mutant("all-but-no-is-yes", "4.1/8")
class AllButNoIsYes(AltersReplies):
    """Every answer to the login but 0 is taken for a yes."""

    name = "login"

    def altered(self, data: bytes) -> bytes:
        """Take it so."""
        return data if data == b"0" else b"1"


@mutant("looks-at-the-first-character", "4.1/8", subtle=True)
class LooksAtTheFirstCharacter(AltersReplies):
    """Of the answer to the login only the first character is looked at."""

    name = "login"

    def altered(self, data: bytes) -> bytes:
        """Look at it."""
        return data[:1]


@mutant("nothing-is-yes", "4.1/8", subtle=True)
class NothingIsYes(AltersReplies):
    """An answer to the login without data is taken for a yes."""

    name = "login"

    def altered(self, data: bytes) -> bytes:
        """Take it so."""
        return data or b"1"


@mutant("loss-is-yes", "4.1/8", "2/1", subtle=True)
class LossIsYes(AsyncClient):
    """A connection that is lost before the login was answered is told as made."""

    async def connect(self) -> None:
        """Make it."""
        try:
            await super().connect()
        except LinkLost:
            if self._transport is None:
                raise
