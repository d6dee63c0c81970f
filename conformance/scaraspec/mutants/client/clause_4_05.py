"""Faults of 4.5 and 4.6: the time."""

from datetime import datetime

from scaraspec.client.aio import AsyncClient
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests

# 4.5


@mutant("short-years", "4.5/1")
class ShortYears(AltersRequests):
    """The year is sent with two digits."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Shorten it."""
        return data[2:]


@mutant("separated-time", "4.5/1")
class SeparatedTime(AltersRequests):
    """The time is sent with marks between its parts."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return b"%b-%b-%b %b:%b:%b" % (data[:4], *(data[i : i + 2] for i in range(4, 14, 2)))


@mutant("unpadded-time", "4.5/1", subtle=True)
class UnpaddedTime(AltersRequests):
    """Hours below ten are sent with one digit."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Shorten them."""
        return data[:8] + b"%d" % int(data[8:10]) + data[10:]


@mutant("twelve-hours", "4.5/1", "T/10", subtle=True)
class TwelveHours(AltersRequests):
    """The hours are sent as a clock with hands shows them."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Make them so."""
        return data[:8] + b"%02d" % ((int(data[8:10]) + 11) % 12 + 1) + data[10:]


@mutant("december-is-thirteen", "4.5/2", subtle=True)
class DecemberIsThirteen(AltersRequests):
    """The months are counted from 1, and then another 1 is added to the last of them."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data[:4] + b"13" + data[6:] if data[4:6] == b"12" else data


@mutant("midnight-is-twenty-four", "4.5/2", subtle=True)
class MidnightIsTwentyFour(AltersRequests):
    """Midnight is sent as the hour 24."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Make it so."""
        return data[:8] + b"24" + data[10:] if data[8:10] == b"00" else data


@mutant("sends-any-digits", "4.5/2")
class SendsAnyDigits(AsyncClient):
    """Whatever has fourteen digits is sent as a time."""

    class core(AltersRequests):  # noqa: N801 - it fills in the attribute
        """Sends the text that it was given."""

        name = "set_time"
        text = ""

        def altered(self, data: bytes) -> bytes:  # noqa: ARG002 - that it was made of another time
            """Send it."""
            return self.text.encode()

    async def set_time(self, time: datetime | str) -> None:
        """Set it."""
        assert isinstance(self._core, self.core)
        self._core.text = str(time)
        await super().set_time(datetime(2000, 1, 1))  # noqa: DTZ001 - the document names no zone


@mutant("every-year-is-leap", "4.5/2", subtle=True)
class EveryYearIsLeap(AsyncClient):
    """The 29th of February is sent in every year."""

    class core(AltersRequests):  # noqa: N801 - it fills in the attribute
        """Sends the year that it was given."""

        name = "set_time"
        year = ""

        def altered(self, data: bytes) -> bytes:
            """Send it."""
            return self.year.encode() + data[4:]

    async def set_time(self, time: datetime | str) -> None:
        """Set it, as if it were a leap year."""
        assert isinstance(self._core, self.core)
        self._core.year = str(time)[:4]
        await super().set_time(f"2000{str(time)[4:]}")


# 4.6


@mutant("asks-with-its-own-time", "4.6/1")
class AsksWithItsOwnTime(AltersRequests):
    """The time is asked for with the client's own."""

    name = "get_time"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"20141222143000"
