"""Faults of clause 4.4: setting the network."""

from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies, Mends
from scaraspec.protocol.commands import Command, Network
from scaraspec.protocol.fields import Address, Diagnostics
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.behaviour import SILENCE, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_ADDRESS_CHARACTERS = 14
_HIGHEST = 255


@mutant("network-is-forgotten", "4.4/4")
class NetworkIsForgotten(ControllerCore):
    """A new network is answered 1 and not set."""

    def set_network(self, request: Request) -> bool:
        """Do nothing."""
        return request.value is not None


@mutant("mask-and-gateway-are-mixed-up", "4.4/4")
class MaskAndGatewayAreMixedUp(ControllerCore):
    """Mask and gateway are stored in each other's place."""

    def set_network(self, request: Request) -> bool:
        """Store them so."""
        ip, mask, gateway = request.value
        return self.save(ip=ip, mask=gateway, gateway=mask)


@mutant("address-remains", "4.4/4")
class AddressRemains(ControllerCore):
    """Mask and gateway are set, the address remains."""

    def set_network(self, request: Request) -> bool:
        """Leave the address out."""
        return self.save(mask=request.value.mask, gateway=request.value.gateway)


@mutant("gateway-is-the-first-host", "4.4/4")
class GatewayIsTheFirstHost(ControllerCore):
    """The gateway is taken to be the first address of the net, whatever is sent."""

    def set_network(self, request: Request) -> bool:
        """Derive it."""
        ip, mask, _ = request.value
        return self.save(ip=ip, mask=mask, gateway=f"{ip.rpartition('.')[0]}.1")


@mutant("longest-address-is-cut", "4.4/4", subtle=True)
class LongestAddressIsCut(ControllerCore):
    """An address of fifteen characters loses its last one: there is no room for its NUL."""

    def set_network(self, request: Request) -> bool:
        """Cut each."""
        cut = [text[:_ADDRESS_CHARACTERS] for text in request.value]
        return self.save(**Network(*cut)._asdict())


@mutant("second-network-is-forgotten", "4.4/4", subtle=True)
class SecondNetworkIsForgotten(ControllerCore):
    """Only the first new network since power-on is set."""

    _set = False

    def set_network(self, request: Request) -> bool:
        """Set one."""
        self._set, before = True, self._set
        return before or super().set_network(request)


@mutant("first-network-ends-the-connection", "4.4/4", subtle=True)
class FirstNetworkEndsTheConnection(ControllerCore):
    """The first new network since power-on ends the connection, and is not set."""

    _set_one = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Set the others."""
        first = frame.opcode == 0x05 and not self._set_one
        self._set_one |= first
        if first:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


@mutant("parts-above-the-highest-are-bounded", "4.4/5")
class PartsAboveTheHighestAreBounded(Mends):
    """Parts of an address that are above 255 are taken for 255."""

    command = "set_network"

    def mended(self, data: bytes) -> bytes:
        """Bound each."""
        fields = [field.split(b".") for field in data.split(b"|")]
        bounded = [[_bounded(part) for part in parts] for parts in fields]
        return b"|".join(b".".join(parts) for parts in bounded)


def _bounded(part: bytes) -> bytes:
    return b"%d" % min(int(part), _HIGHEST) if part.isdigit() else part


@mutant("parts-are-taken-modulo256", "4.4/5")
class PartsAreTakenModulo256(Mends):
    """Of the parts of an address only the lowest eight bits are looked at."""

    command = "set_network"

    def mended(self, data: bytes) -> bytes:
        """Let them overflow."""
        fields = [field.split(b".") for field in data.split(b"|")]
        short = [[b"%d" % (int(p) % 256) if p.isdigit() else p for p in f] for f in fields]
        return b"|".join(b".".join(parts) for parts in short)


@mutant("missing-parts-are-zero", "4.4/5")
class MissingPartsAreZero(Mends):
    """An address of three parts is filled up with a zero."""

    command = "set_network"

    def mended(self, data: bytes) -> bytes:
        """Fill each up."""
        fields = [field + b".0" * max(3 - field.count(b"."), 0) for field in data.split(b"|")]
        return b"|".join(fields)


@mutant("missing-gateway-is-taken", "4.4/5")
class MissingGatewayIsTaken(Mends):
    """A request without gateway is taken, and the gateway is the address."""

    command = "set_network"

    def mended(self, data: bytes) -> bytes:
        """Fill it up."""
        return data + b"|" + data.partition(b"|")[0] if data.count(b"|") == 1 else data


@mutant("further-fields-are-overlooked", "4.4/5")
class FurtherFieldsAreOverlooked(Mends):
    """What stands behind the gateway is not looked at."""

    command = "set_network"

    def mended(self, data: bytes) -> bytes:
        """Drop it."""
        return b"|".join(data.split(b"|")[:3])


@mutant("network-answered-in-words", "4.4/2")
class NetworkAnsweredInWords(AltersReplies):
    """A new network is answered with a word."""

    opcode = 0x05

    def altered(self, data: bytes) -> bytes:
        """Say it in words."""
        return b"success" if data == b"1" else b"fail"


@mutant("network-is-not-answered", "4.4/2", "4.4/3")
class NetworkIsNotAnswered(ControllerCore):
    """A new network is set without any answer, while the connection remains."""

    def set_network(self, request: Request) -> Silence:  # type: ignore[override] # silence is the fault
        """Say nothing."""
        super().set_network(request)
        return SILENCE


@mutant("refused-network-is-set-in-part", "4.4/2")
class RefusedNetworkIsSetInPart(ControllerCore):
    """The gateway of a network that is refused for its other fields is set all the same."""

    def _value(self, command: Command, frame: Frame) -> Any:
        value = super()._value(command, frame)
        if command.name == "set_network" and value is None:
            gateway = Address("gateway").read(frame.data.rpartition(b"|")[2], Diagnostics())
            self.save(gateway=gateway or self.store.settings.gateway)
        return value


@mutant("address-is-set-first", "4.4/2", subtle=True)
class AddressIsSetFirst(ControllerCore):
    """The address of a network is set before the rest is looked at, which may be refused."""

    def _value(self, command: Command, frame: Frame) -> Any:
        if command.name == "set_network":
            ip = Address("ip").read(frame.data.partition(b"|")[0], Diagnostics())
            self.save(ip=ip or self.store.settings.ip)
        return super()._value(command, frame)


@mutant("new-network-answered-with-zero", "4.4/2")
class NewNetworkAnsweredWithZero(ControllerCore):
    """A new network is set and answered 0."""

    def set_network(self, request: Request) -> bool:
        """Set it, and say the contrary."""
        super().set_network(request)
        return False
