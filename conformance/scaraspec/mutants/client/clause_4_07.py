"""Faults of 4.7 and 4.8: version and status."""

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import Event
from scaraspec.client.results import Status
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.frames import GoesDeaf
from scaraspec.mutants.operators.client.messages import AltersReplies, AltersRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.errors import lookup
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame

# 4.7


@mutant("asks-for-the-version-of-something", "4.7/1")
class AsksForTheVersionOfSomething(AltersRequests):
    """The version is asked for with a blank."""

    name = "get_version"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b" "


@mutant("five-characters", "4.7/5")
class FiveCharacters(AltersReplies):
    """Of a version five characters are read."""

    name = "get_version"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        return data[:5]


@mutant("three-numbers", "4.7/5", subtle=True)
class ThreeNumbers(AltersReplies):
    """A version is told as three numbers, without the zeros that they begin with."""

    name = "get_version"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        numbers = data.split(b".")
        if not all(number.isdigit() for number in numbers):
            return data
        return b".".join(b"%d" % int(number) for number in numbers)


@mutant("sixty-four-characters", "4.7/5", subtle=True)
class SixtyFourCharacters(AltersReplies):
    """Of a version 64 characters are read."""

    name = "get_version"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        return data[:64]


@mutant("end-of-the-last-version", "4.7/5", "T/9", subtle=True)
class EndOfTheLastVersion(AltersReplies):
    """A version that is shorter than the one before is told with the end of that one."""

    name = "get_version"
    _buffer = b""

    def altered(self, data: bytes) -> bytes:
        """Read it into the same buffer."""
        self._buffer = data + self._buffer[len(data) :]
        return self._buffer


# 4.8


@mutant("asks-for-the-status-with-data", "4.8/1")
class AsksForTheStatusWithData(AltersRequests):
    """The status is asked for with a NUL."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"\0"


@mutant("wants-capitals", "4.8/11", subtle=True)
class WantsCapitals(AltersReplies):
    """A code in small letters is told as idle."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Read it, or not."""
        return b"00" if data != data.upper() else data


@mutant("reads-codes-as-numbers", "4.8/11", "T/9")
class ReadsCodesAsNumbers(AsyncClient):
    """A code is told as the number that its digits give."""

    async def get_status(self) -> Status:
        """Read it."""
        status = await super().get_status()
        digits = "".join(filter(str.isdigit, status.code))
        return status._replace(code=digits.zfill(2))


@mutant("goes-deaf-at-unknown-codes", "4.8/11", subtle=True)
class GoesDeafAtUnknownCodes(GoesDeaf):
    """A code that table 8-1 lacks is the last thing that it hears."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.opcode == BY_NAME["get_status"].opcode:
            self.deaf |= lookup(show(frame.data)) is None
        return super()._dispatch(frame, now_s)


@mutant("unknown-is-idle", "4.8/11", subtle=True)
class UnknownIsIdle(AltersReplies):
    """A code that table 8-1 lacks is told as idle."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Take it so."""
        return data if lookup(show(data)) else b"00"


@mutant("knows-single-faults-only", "4.8/11", subtle=True)
class KnowsSingleFaultsOnly(AltersReplies):
    """Codes of several motors at once cannot be read."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Read it, or not."""
        code = lookup(show(data))
        return b"" if code and len(code.joints) > 1 else data
