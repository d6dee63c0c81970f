"""Mutants of clauses 4.3 and 4.4: the network settings."""

from scaraspec.client.aio import AsyncClient
from scaraspec.client.errors import LinkLost
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.messages import (
    loss_is_success,
    reply_data,
    request_data,
    request_fields,
)

# 4.3


def _gateway_before_mask(data: bytes) -> bytes:
    ip, mask, gateway = data.split(b"|")
    return b"|".join((ip, gateway, mask))


def _octal(number: bytes) -> bytes:
    padded = number.startswith(b"0") and not number.strip(b"01234567")
    return b"%d" % int(number, 8) if padded else number


def _octal_addresses(data: bytes) -> bytes:
    texts = [[_octal(number) for number in text.split(b".")] for text in data.split(b"|")]
    return b"|".join(map(b".".join, texts))


row(
    "asks-for-the-first-network",
    "4.3/1",
    "The request for the network settings contains the number of an interface.",
    request_data("get_network", lambda data: data + b"0"),
)
row(
    "reads-columns",
    "4.3/5",
    "The three addresses are read at the columns that they have in the document.",
    reply_data("get_network", lambda data: b"|".join((data[:11], data[12:25], data[26:]))),
)
row(
    "reads-fourteen-characters",
    "4.3/5",
    "Only fourteen characters of an address are read.",
    reply_data("get_network", lambda data: b"|".join(text[:14] for text in data.split(b"|"))),
    subtle=True,
)
row(
    "reads-thirty-six-bytes",
    "4.3/5",
    "Only 36 bytes of the reply are read, the length that the document prints.",
    reply_data("get_network", lambda data: data[:36]),
    subtle=True,
)
row(
    "gateway-for-mask",
    "4.3/5 T/9",
    "Gateway and mask are swapped.",
    reply_data("get_network", _gateway_before_mask),
)
row(
    "reads-padding-as-octal",
    "4.3/5",
    "A number of an address with leading zeros is read as octal.",
    reply_data("get_network", _octal_addresses),
    subtle=True,
)

# 4.4

row(
    "mask-first",
    "4.4/1",
    "The mask is sent before the address.",
    request_fields("set_network", lambda fields: [fields[1], fields[0], fields[2]]),
)
row(
    "without-gateway",
    "4.4/1",
    "The gateway is not sent.",
    request_fields("set_network", lambda fields: fields[:2]),
)
row(
    "gateway-is-the-first-host",
    "4.4/1",
    "The first address of the network is sent as the gateway.",
    request_fields(
        "set_network", lambda fields: [*fields[:2], fields[0].rpartition(b".")[0] + b".1"]
    ),
    subtle=True,
)


@mutant("loss-is-failure", "4.4/6")
class FailsOnLoss(AsyncClient):
    """If the connection ends within 1 s after a new network was accepted, an error is reported."""

    gone = False

    async def set_network(self, ip: str, mask: str, gateway: str) -> None:
        await super().set_network(ip, mask, gateway)
        if await self.wait_for(lambda: self.gone, 1.0):
            raise LinkLost("the network was lost")

    def _connection_lost(self, reason: str) -> None:
        self.gone = True
        super()._connection_lost(reason)


row(
    "takes-loss-for-anew-network",
    "T/9",
    "A new network that was not answered before the link was lost is reported as set.",
    loss_is_success("set_network"),
    subtle=True,
)
