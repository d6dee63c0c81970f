"""An independent observer on both sides of the recorder: tcpdump, whose captures are compared.

By default the traffic is small; with SCARASPEC_FULL=1 it is a gigabyte in each direction, and
10,000 connections.
"""

import asyncio
import json
import os
import random
import re
import signal
import socket
import subprocess
import threading
from collections import Counter
from contextlib import closing
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from ledger import Ledger
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.recording import record
from scaraspec_recorder.sources.pcap_reader import read_pcap
from scaraspec_recorder.tap.routes import Mode

pytestmark = [pytest.mark.network, pytest.mark.parametrize("mode", Mode)]

FULL = os.environ.get("SCARASPEC_FULL") == "1"
BULK_BYTES = 1 << 30 if FULL else 64 << 20
CONNECTIONS = 10_000 if FULL else 300
AT_ONCE = 100
TIMEOUT_S = 900.0 if FULL else 60.0
PIECES = (1, 3, 4, 212, 1460, 65_536, 300_000)


class Stream:
    """Size and hash of the bytes of one direction."""

    def __init__(self) -> None:
        self._size_bytes = 0
        self._hash = sha256()

    def add(self, data: bytes) -> None:
        self._size_bytes += len(data)
        self._hash.update(data)

    def __str__(self) -> str:
        return f"{self._size_bytes} {self._hash.hexdigest()}"


class Witness:
    """tcpdump on the cable of a machine, for a server with this port."""

    def __init__(self, machine: Any, path: Path, port: int = DEFAULT_PORT) -> None:
        self._machine = machine
        self._path, self._port = path, port
        self._marker = random.Random(path.name).randbytes(32)
        self._complete = threading.Event()
        with machine.inside():
            self._process = subprocess.Popen(
                ["tcpdump", "-i", "eth0", "-n", "-U", "-B", "131072", "-w", "-", "tcp or udp"],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        while b"listening on eth0" not in (line := self._process.stderr.readline()):
            assert line, "tcpdump has not started"
        self._copying = threading.Thread(target=self._copy)
        self._copying.start()

    def close(self) -> None:
        """Stop when all packets are in the file; none may be missing."""
        with self._machine.inside(), socket.socket(type=socket.SOCK_DGRAM) as sock:
            sock.sendto(self._marker, (self._machine.gateway, 9))
        complete = self._complete.wait(TIMEOUT_S)
        self._process.send_signal(signal.SIGINT)
        self._copying.join()
        _, reported = self._process.communicate()
        assert complete
        assert re.search(rb"^0 packets dropped by kernel", reported, re.MULTILINE), reported

    def connections(self) -> Counter[tuple[str, str]]:
        """The streams of each connection, in both directions."""
        seen: dict[str, dict[Direction, Stream]] = {}
        for event in read_pcap(self._path, port=self._port):
            assert event.kind is not Kind.GAP
            ways = seen.setdefault(event.connection, {A2C: Stream(), C2A: Stream()})
            ways[event.direction].add(event.data)
        return Counter((str(ways[A2C]), str(ways[C2A])) for ways in seen.values())

    def _copy(self) -> None:
        end = b""
        with self._path.open("wb") as file:
            while data := os.read(self._process.stdout.fileno(), 1 << 20):
                file.write(data)
                end = end[-len(self._marker) :] + data
                if self._marker in end:
                    self._complete.set()


def ledger(folder: Path) -> Counter[tuple[str, str]]:
    """The recorded streams of each connection, in both directions; no bytes may be missing."""
    accounts = json.loads((folder / "ledger.json").read_text())
    ways: dict[str, dict[str, str]] = {}
    for name, account in accounts.items():
        _, connection, way = name.split("/")
        assert account["received_bytes"] == account["recorded_bytes"], account
        stream = f"{account['recorded_bytes']} {account['sha256_recorded']}"
        ways.setdefault(connection, {})[way] = stream
    return Counter((streams[A2C.value], streams[C2A.value]) for streams in ways.values())


async def send(sock: socket.socket, seed: int, size_bytes: int) -> str:
    """Send random bytes in random pieces, then the end."""
    dice, sent = random.Random(seed), Stream()
    while size_bytes:
        piece = dice.randbytes(min(dice.choice(PIECES), size_bytes))
        size_bytes -= len(piece)
        sent.add(piece)
        await asyncio.get_running_loop().sock_sendall(sock, piece)
    sock.shutdown(socket.SHUT_WR)
    return str(sent)


async def receive(sock: socket.socket) -> str:
    """Receive until the end."""
    received = Stream()
    while data := await asyncio.get_running_loop().sock_recv(sock, 1 << 20):
        received.add(data)
    return str(received)


async def talk(sock: socket.socket, seed: int, size_bytes: int) -> tuple[str, str]:
    """Send and receive at the same time."""
    with sock:
        sock.settimeout(0)
        return await asyncio.gather(send(sock, seed, size_bytes), receive(sock))


def conversation(
    lab: Any, mode: Mode, folder: Path, connections: int, size_bytes: int
) -> tuple[Counter[tuple[str, str]], Counter[tuple[str, str]]]:
    """Run connections through a complete recorder; return the streams that each side has seen."""
    places = asyncio.Semaphore(AT_ONCE)

    async def clients_part(seed: int) -> tuple[str, str]:
        async with places:
            sock = lab.client.new_socket()
            sock.settimeout(0)
            await asyncio.get_running_loop().sock_connect(sock, lab.address(mode))
            up, down = await talk(sock, seed, size_bytes)
            return up, down

    async def controllers_part(server: socket.socket) -> list[tuple[str, str]]:
        talks = []
        for number in range(connections):
            sock, _ = await asyncio.get_running_loop().sock_accept(server)
            talks.append(asyncio.create_task(talk(sock, connections + number, size_bytes)))
        return [(up, down) for down, up in await asyncio.gather(*talks)]

    async def hold() -> tuple[Counter[tuple[str, str]], Counter[tuple[str, str]]]:
        limit_bytes = 4 * BULK_BYTES  # large, because a delay of the writing is not tested here
        with lab.serve() as server:
            server.settimeout(0)
            async with record(
                lab.route(mode), [lab.listen(mode)], folder, [Ledger], limit_bytes=limit_bytes
            ):
                parts = [clients_part(number) for number in range(connections)]
                controllers = asyncio.ensure_future(controllers_part(server))
                clients = await asyncio.gather(*parts)
        return Counter(clients), Counter(controllers.result())

    with lab.middle.inside():
        return asyncio.run(asyncio.wait_for(hold(), TIMEOUT_S))


@pytest.mark.parametrize(
    ("connections", "size_bytes"), [(1, BULK_BYTES), (CONNECTIONS, 2000)], ids=["bulk", "many"]
)
def test_bytes_pass_unchanged_and_are_all_recorded(
    lab: Any,
    mode: Mode,
    connections: int,
    size_bytes: int,
    tmp_path: Path,
) -> None:
    """For every connection, the bytes sent, on both cables, received and recorded are equal."""
    lab.install(mode)
    port = lab.listen(mode)[1] if mode is Mode.EXPLICIT else DEFAULT_PORT
    with (
        closing(Witness(lab.client, tmp_path / "client.pcap", port)) as near,
        closing(Witness(lab.controller, tmp_path / "controller.pcap")) as far,
    ):
        clients, controllers = conversation(lab, mode, tmp_path, connections, size_bytes)
    assert clients.total() == connections
    assert clients == controllers
    assert clients == near.connections() == far.connections()
    assert clients == ledger(tmp_path)
    for capture in tmp_path.glob("*.pcap"):
        capture.unlink()  # files of gigabytes, which are not needed after success
