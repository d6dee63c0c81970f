"""The test bench: a core on a memory network, and clients, in simulated time."""

from collections.abc import Callable
from datetime import datetime
from typing import Literal

import pytest

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.program_files import Node, NodeType, Program, WaitSeconds, build
from scaraspec.protocol.readings import Dialect
from scaraspec.transports.link import Ending
from scaraspec.transports.memory import MemoryLink, MemoryNetwork
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.store import Store


class Client:
    """One connection, as its frames."""

    def __init__(self, link: MemoryLink) -> None:
        self.link = link
        self.ending: Ending | None = None
        self._framer = Framer(C2A)

    def send(self, name: str, data: bytes = b"") -> None:
        """Send the request of a command."""
        self.link.send(Frame(A2C, BY_NAME[name].opcode, data).encode())

    def receive(self, for_s: float = 0.0) -> list[tuple[str, bytes]]:
        """Return what arrives in a time: the name of the command (with ``*`` for a final result)
        and the data."""
        received = []
        deadline_s = self.link.now_s + for_s
        while self.ending is None:
            arrival = self.link.receive(deadline_s)
            if arrival is None:
                break
            if isinstance(arrival.content, Ending):
                self.ending = arrival.content
                break
            for frame in self._framer.feed(arrival.content):
                assert isinstance(frame, Frame), frame
                names = [name for name, row in BY_NAME.items() if row.opcode == frame.opcode]
                name = names[0] if names else f"0x{frame.opcode:02X}"
                received.append(("*" * frame.tagged + name, frame.data))
        return received

    def ask(self, name: str, data: bytes = b"") -> bytes | None:
        """Send a request and return the data of its immediate reply, which must be the only
        frame."""
        self.send(name, data)
        received = self.receive()
        if not received:
            return None
        ((answer, reported),) = received
        assert answer == name
        return reported

    def result(self, name: str, within_s: float = 60.0) -> bytes:
        """Wait for the final result of a command; no other frame may arrive."""
        deadline_s = self.link.now_s + within_s
        while self.link.now_s < deadline_s:
            received = self.receive(min(0.1, deadline_s - self.link.now_s))
            if received:
                ((answer, reported),) = received
                assert answer == f"*{name}"
                return reported
        raise AssertionError(f"no final result of {name} in {within_s} s")

    def where(self) -> list[float]:
        """The tool coordinates."""
        reported = self.ask("get_tool_coordinates")
        assert reported is not None
        return [float(number) for number in reported.split(b"|")]


class Bench:
    """A core, its plant and store, and its clients."""

    def __init__(self, readings: dict[str, str]) -> None:
        self.plant = Plant(datetime(2014, 12, 22, 14, 30), now_s=0.0)  # noqa: DTZ001 - the document names no zone (L172)
        self.store = Store()
        self.core = ControllerCore(self.plant, self.store, Dialect.of(**readings))
        self.network = MemoryNetwork(self.core)

    def guest(self, link: Literal["tcp", "serial"] = "tcp") -> Client:
        """Return a client that has connected, without a login."""
        return Client(self.network.connect(link))

    def client(self) -> Client:
        """A client that has logged in."""
        client = self.guest()
        assert (client.ask("login", b"password") or b"")[:1] == b"1"
        return client

    def break_motor(self, code: str, *, lasting: bool = False) -> None:
        """Inject a fault and advance the core."""
        self.plant.fail(code, self.network.now_s, lasting=lasting)
        self.network.run_until(self.network.now_s + 0.01)

    def pass_s(self, duration_s: float) -> None:
        self.network.run_until(self.network.now_s + duration_s)

    def store_program(self, name: bytes, *nodes: Node) -> None:
        """Store a program; one that waits for ten seconds if no nodes are given."""
        wait = Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(10))
        self.store.write(name, build(Program(nodes=nodes or (wait,))))


@pytest.fixture
def bench_of() -> Callable[..., Bench]:
    """Return a function that makes a bench whose controller follows the given readings."""
    return lambda **readings: Bench(readings)


@pytest.fixture
def bench(bench_of: Callable[..., Bench]) -> Bench:
    """A bench whose controller follows the default of every reading."""
    return bench_of()
