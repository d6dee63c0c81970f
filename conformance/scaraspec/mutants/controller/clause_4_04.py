"""Mutants of clause 4.4: setting the network."""

from collections.abc import Callable

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    answer,
    decoded,
    executes_first,
    on_request,
    reads,
)
from scaraspec.protocol.commands import Network
from scaraspec.protocol.fields import Address, Diagnostics
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


def _saves(change: Callable[[Network], dict[str, str]]) -> Core:
    """The settings that are saved are a function of the network in the request."""
    return on_request("set_network", lambda core, request: core.save(**change(request.value)))


def _parts(change: Callable[[int], int]) -> Core:
    """The numbers in the addresses of a request are changed."""

    def part(text: bytes) -> bytes:
        return b"%d" % change(int(text)) if text.isdigit() else text

    def parts(data: bytes) -> bytes:
        fields = [field.split(b".") for field in data.split(b"|")]
        return b"|".join(b".".join(map(part, field)) for field in fields)

    return reads("set_network", parts)


def _fields(change: Callable[[list[bytes]], list[bytes]]) -> Core:
    """The fields of a request are changed."""
    return reads("set_network", lambda data: b"|".join(change(data.split(b"|"))))


def _save_gateway(core: ControllerCore, frame: Frame, network: Network | None) -> Network | None:
    if network is None:
        gateway = Address("gateway").read(frame.data.rpartition(b"|")[2], Diagnostics())
        core.save(gateway=gateway or core.store.settings.gateway)
    return network


def _save_address(core: ControllerCore, frame: Frame, network: Network | None) -> Network | None:
    ip = Address("ip").read(frame.data.partition(b"|")[0], Diagnostics())
    core.save(ip=ip or core.store.settings.ip)
    return network


row(
    "network-is-forgotten",
    "4.4/4",
    "A new network is answered 1 but not stored.",
    on_request("set_network", lambda _core, request: request.value is not None),
)
row(
    "mask-and-gateway-are-mixed-up",
    "4.4/4",
    "Mask and gateway are exchanged when they are stored.",
    _saves(lambda new: {"ip": new.ip, "mask": new.gateway, "gateway": new.mask}),
)
row(
    "address-remains",
    "4.4/4",
    "Mask and gateway are stored, but the address is not changed.",
    _saves(lambda new: {"mask": new.mask, "gateway": new.gateway}),
)
row(
    "gateway-is-the-first-host",
    "4.4/4",
    "The gateway is always the first address of the network.",
    _saves(
        lambda new: {
            "ip": new.ip,
            "mask": new.mask,
            "gateway": f"{new.ip.rpartition('.')[0]}.1",
        }
    ),
)
row(
    "longest-address-is-cut",
    "4.4/4",
    "An address of fifteen characters loses its last one: there is no space for its NUL.",
    _saves(lambda new: {name: text[:14] for name, text in new._asdict().items()}),
    subtle=True,
)


@mutant("second-network-is-forgotten", "4.4/4", subtle=True)
class ForgetsSecondNetwork(ControllerCore):
    """Only the first new network since power-on is stored."""

    _set = False

    def set_network(self, request: Request) -> bool:
        self._set, before = True, self._set
        return before or super().set_network(request)


@mutant("first-network-ends-the-connection", "4.4/4", subtle=True)
class FirstNetworkEndsConnection(ControllerCore):
    """The first new network since power-on ends the connection and is not stored."""

    _received = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x05 and not self._received:
            self._received = True
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


row(
    "parts-above-the-highest-are-bounded",
    "4.4/5",
    "Numbers above 255 in an address are read as 255.",
    _parts(lambda number: min(number, 255)),
)
row(
    "parts-are-taken-modulo256",
    "4.4/5",
    "Only the lowest eight bits of the numbers in an address are used.",
    _parts(lambda number: number % 256),
)
row(
    "missing-parts-are-zero",
    "4.4/5",
    "An address of three numbers is completed with a zero.",
    _fields(lambda fields: [f + b".0" * max(3 - f.count(b"."), 0) for f in fields]),
)
row(
    "missing-gateway-is-taken",
    "4.4/5",
    "A request without gateway is accepted, and the gateway is the address.",
    _fields(lambda fields: [*fields, fields[0]] if len(fields) == 2 else fields),
)
row(
    "further-fields-are-overlooked",
    "4.4/5",
    "Fields after the gateway are ignored.",
    _fields(lambda fields: fields[:3]),
)
row(
    "network-answered-in-words",
    "4.4/2",
    "A new network is answered success or fail.",
    first_reply("set_network", lambda data: b"success" if data == b"1" else b"fail"),
)
row(
    "network-is-not-answered",
    "4.4/2 4.4/3",
    "A new network is stored but not answered, and the connection remains open.",
    answer("set_network", lambda _done: SILENCE),
)
row(
    "refused-network-is-set-in-part",
    "4.4/2",
    "The gateway of a network that is refused because of its other fields is stored.",
    decoded("set_network", _save_gateway),
)
row(
    "address-is-set-first",
    "4.4/2",
    "The address is stored before the other fields are checked; the network may be refused.",
    decoded("set_network", _save_address),
    subtle=True,
)
row(
    "new-network-answered-with-zero",
    "4.4/2",
    "A new network is stored but answered 0.",
    answer("set_network", lambda _done: False),
)

row(
    "two-networks-per-connection",
    "4.4/4",
    "Only the first two networks of a connection are stored; later ones are answered 1.",
    executes_first("set_network", 2),
    subtle=True,
)
