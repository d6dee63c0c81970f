"""Faults of 4.3 and 4.4: the network settings."""

from scaraspec.client.aio import AsyncClient
from scaraspec.client.errors import LinkLost
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import (
    AltersFields,
    AltersReplies,
    AltersRequests,
    TakesLossForSuccess,
)

# 4.3


@mutant("asks-for-the-first-network", "4.3/1")
class AsksForTheFirstNetwork(AltersRequests):
    """The network settings are asked for with the number of an interface."""

    name = "get_network"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"0"


@mutant("reads-columns", "4.3/5")
class ReadsColumns(AltersReplies):
    """The three addresses are read at the columns that they have in the document."""

    name = "get_network"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        return b"|".join((data[:11], data[12:25], data[26:]))


@mutant("reads-fourteen-characters", "4.3/5", subtle=True)
class ReadsFourteenCharacters(AltersReplies):
    """Of an address at most fourteen characters are read."""

    name = "get_network"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        return b"|".join(text[:14] for text in data.split(b"|"))


@mutant("reads-thirty-six-bytes", "4.3/5", subtle=True)
class ReadsThirtySixBytes(AltersReplies):
    """Of the reply 36 bytes are read, the length that the document prints."""

    name = "get_network"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        return data[:36]


@mutant("gateway-for-mask", "4.3/5", "T/9")
class GatewayForMask(AltersReplies):
    """Gateway and mask are told the other way round."""

    name = "get_network"

    def altered(self, data: bytes) -> bytes:
        """Swap them."""
        ip, mask, gateway = data.split(b"|")
        return b"|".join((ip, gateway, mask))


@mutant("reads-padding-as-octal", "4.3/5", subtle=True)
class ReadsPaddingAsOctal(AltersReplies):
    """Padded numbers of an address are read as octal ones."""

    name = "get_network"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        texts = [[_octal(n) for n in text.split(b".")] for text in data.split(b"|")]
        return b"|".join(map(b".".join, texts))


def _octal(text: bytes) -> bytes:
    """A number as C reads it."""
    padded = text.startswith(b"0") and not text.strip(b"01234567")
    return b"%d" % int(text, 8) if padded else text


# 4.4


@mutant("mask-first", "4.4/1")
class MaskFirst(AltersFields):
    """The mask is sent ahead of the address."""

    name = "set_network"

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Swap them."""
        return [fields[1], fields[0], fields[2]]


@mutant("without-gateway", "4.4/1")
class WithoutGateway(AltersFields):
    """The gateway is not sent."""

    name = "set_network"

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Leave it out."""
        return fields[:2]


@mutant("gateway-is-the-first-host", "4.4/1", subtle=True)
class GatewayIsTheFirstHost(AltersFields):
    """As the gateway the first address of the network is sent."""

    name = "set_network"

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Make it up."""
        return [*fields[:2], fields[0].rpartition(b".")[0] + b".1"]


@mutant("loss-is-failure", "4.4/6")
class LossIsFailure(AsyncClient):
    """A connection that ends behind the yes to a new network makes a failure of it."""

    gone = False

    async def set_network(self, ip: str, mask: str, gateway: str) -> None:
        """Set it, and wait for whether the connection lasts."""
        await super().set_network(ip, mask, gateway)
        if await self.wait_for(lambda: self.gone, 1.0):
            raise LinkLost("the network was lost")

    def _connection_lost(self, reason: str) -> None:
        self.gone = True
        super()._connection_lost(reason)


@mutant("takes-loss-for-anew-network", "T/9", subtle=True)
class TakesLossForANewNetwork(TakesLossForSuccess):
    """A link that is lost before a new network was answered is taken for the new network."""

    name = "set_network"
