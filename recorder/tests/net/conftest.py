"""Simulated computers: network namespaces, connected by virtual cables.

There are a client, a controller, and the recorder's computer between them, which forwards packets.
Only file descriptors keep a namespace, so that the system removes it with the process, however that
ends. The real network is never changed.
"""

import asyncio
import ctypes
import os
import socket
import struct
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Self

import pytest

from recipes import recipe
from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool.records import Record
from scaraspec_recorder.tap import tcp
from scaraspec_recorder.tap.routes import Mode, Route, route
from scaraspec_recorder.tap.tap import Tap, new_event_loop

TIMEOUT_S = 10.0
CLIENT = "10.77.1.2"
CLIENTS_GATEWAY = "10.77.1.1"
CONTROLLERS_GATEWAY = "10.77.2.1"
CONTROLLER = ("10.77.2.2", 8877)

_CLONE_NEWNET = 0x40000000
_libc = ctypes.CDLL(None, use_errno=True)


def _call(function: Any, *arguments: int) -> None:
    if function(*arguments):
        raise OSError(ctypes.get_errno(), f"{function.__name__}: {os.strerror(ctypes.get_errno())}")


@contextmanager
def _returning() -> Iterator[None]:
    """Switch this thread back to its original network namespace."""
    here = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
    try:
        yield
    finally:
        _call(_libc.setns, here, _CLONE_NEWNET)
        os.close(here)


class Machine:
    """A simulated computer: a network namespace."""

    def __init__(self, gateway: str = "") -> None:
        self.gateway = gateway
        with _returning():
            _call(_libc.unshare, _CLONE_NEWNET)
            self._namespace = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        self.path = f"/proc/{os.getpid()}/fd/{self._namespace}"

    def close(self) -> None:
        os.close(self._namespace)

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Everything that this thread creates in this context (sockets, processes, threads) is on
        the machine."""
        with _returning():
            _call(_libc.setns, self._namespace, _CLONE_NEWNET)
            yield

    def run(self, command: str) -> str:
        """Run a shell command, and return its output."""
        with self.inside():
            done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout

    def new_socket(self) -> socket.socket:
        with self.inside():
            return socket.socket()

    def listen(self, address: tuple[str, int]) -> socket.socket:
        with self.inside():
            sock = tcp.listen(*address)
        sock.settimeout(TIMEOUT_S)
        return sock


class RunningTap:
    """A tap in a thread on one of the machines, and its records."""

    def __init__(self, machine: Machine, route: Route, listen: tuple[str, int]) -> None:
        self.records: list[Record] = []
        self._machine = machine
        self._received = threading.Condition()
        self._started = threading.Event()
        with machine.inside():
            self._listener = route.listen(*listen)
        self._route = route
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._started.wait(TIMEOUT_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(TIMEOUT_S)
        self._listener.close()

    def until(self, kind: Kind) -> Record:
        """Return the first record of this kind."""
        with self._received:
            assert self._received.wait_for(lambda: self._of(kind), TIMEOUT_S), f"there is no {kind}"
            return self._of(kind)[0]

    def until_received(self, direction: Direction, data: bytes) -> None:
        """Wait until the records contain all these bytes, the first ones of the only connection."""
        with self._received:
            assert self._received.wait_for(lambda: self.stream(direction) == data, TIMEOUT_S)

    def stream(self, direction: Direction) -> bytes:
        chunks = self._of(Kind.BYTES)
        return b"".join(chunk.payload for chunk in chunks if chunk.direction is direction)

    def notes(self, kind: Kind) -> list[str]:
        return [record.note for record in self._of(kind)]

    def _of(self, kind: Kind) -> list[Record]:
        return [record for record in self.records if record.kind is kind]

    def _take(self, *fields: Any) -> None:
        with self._received:
            self.records.append(Record(*fields))
            self._received.notify_all()

    def _run(self) -> None:
        with self._machine.inside(), asyncio.Runner(loop_factory=new_event_loop) as runner:
            runner.run(self._relay())

    async def _relay(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        tap = Tap(self._route, self._take)
        await tap.start(self._listener)
        self._started.set()
        await self._stop.wait()
        await tap.stop()


class Lab:
    """Three machines in a row; everything that it creates ends with it."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.client, self.controller = Machine(CLIENTS_GATEWAY), Machine(CONTROLLERS_GATEWAY)
        self.middle = Machine()
        self._stack = stack
        self._folder = folder
        for machine in (self.client, self.middle, self.controller):
            stack.callback(machine.close)
            machine.run("ip link set lo up")
        for name, machine, own in (
            ("clients", self.client, CLIENT),
            ("controllers", self.controller, CONTROLLER[0]),
        ):
            self.middle.run(f"ip link add {name} type veth peer name eth0 netns {machine.path}")
            self.middle.run(f"ip addr add {machine.gateway}/24 dev {name} && ip link set {name} up")
            machine.run(f"ip addr add {own}/24 dev eth0 && ip link set eth0 up")
            machine.run(f"ip route add default via {machine.gateway}")
        self.middle.run("echo 1 > /proc/sys/net/ipv4/ip_forward")

    def route(self, mode: Mode) -> Route:
        return route(mode, *CONTROLLER)

    def address(self, mode: Mode) -> tuple[str, int]:
        """The address that a client connects to."""
        return (CLIENTS_GATEWAY, 8878) if mode is Mode.EXPLICIT else CONTROLLER

    def listen(self, mode: Mode) -> tuple[str, int]:
        """The address that the recorder listens on."""
        return ("127.0.0.1" if mode is Mode.TPROXY else "0.0.0.0", 8878)

    def install(self, mode: Mode) -> None:
        """Run the installation commands of docs/transparent-proxy.md."""
        steps = recipe(mode, CONTROLLER[0])
        if steps.script:
            (self._folder / steps.file_name).write_text(steps.script)
        self._run(steps.install)

    def remove(self, mode: Mode) -> None:
        """Run the removal commands of that page."""
        self._run(recipe(mode, CONTROLLER[0]).remove)

    def load_again(self, mode: Mode) -> None:
        """Load only the nftables script."""
        self._run(f"nft -f {recipe(mode, CONTROLLER[0]).file_name}")

    def _run(self, commands: str) -> None:
        self.middle.run(f"set -e; cd '{self._folder}'\n{commands}")

    def tap(self, mode: Mode) -> RunningTap:
        running = RunningTap(self.middle, self.route(mode), self.listen(mode))
        return self._stack.enter_context(running)

    def serve(self) -> socket.socket:
        """Open the listening socket of the controller."""
        return self._stack.enter_context(self.controller.listen(CONTROLLER))

    def connect(
        self, address: tuple[str, int], machine: Machine | None = None, receive_bytes: int = 0
    ) -> socket.socket:
        """Connect from the client's machine, or from another one."""
        sock = self._stack.enter_context((machine or self.client).new_socket())
        if receive_bytes:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        sock.settimeout(TIMEOUT_S)
        sock.connect(address)
        return sock

    def accept(self, server: socket.socket) -> socket.socket:
        sock, _ = server.accept()
        sock.settimeout(TIMEOUT_S)
        return self._stack.enter_context(sock)


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    with ExitStack() as stack:
        yield Lab(tmp_path, stack)


@pytest.fixture(scope="session")
def receive() -> Callable[[socket.socket, int], bytes]:
    """Return a function that receives a number of bytes."""

    def receive(sock: socket.socket, size_bytes: int) -> bytes:
        data = bytearray()
        while len(data) < size_bytes:
            more = sock.recv(size_bytes - len(data))
            assert more, "the stream ended early"
            data += more
        return bytes(data)

    return receive


@pytest.fixture(scope="session")
def cut() -> Callable[[socket.socket], None]:
    """Return a function that closes a socket with RST."""

    def cut(sock: socket.socket) -> None:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        sock.close()

    return cut
