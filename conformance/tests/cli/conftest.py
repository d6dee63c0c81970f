"""Processes as a user starts them, and an independent relay that records the bytes."""

import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, suppress

import pytest
from warm_process import WarmProcess

from scaraspec.cli.main import main

TIMEOUT_S = 60
Send = Callable[[bytes], None]


class Witness:
    """A relay that keeps every byte and shares no code with the recorder."""

    def __init__(self, upstream: tuple[str, int]) -> None:
        self._upstream = upstream
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._listener.getsockname()
        self.seen: list[tuple[bytearray, bytearray]] = []
        """Per connection: bytes from the client, bytes from the controller."""
        self._pumps: list[threading.Thread] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """Accept no more connections, and wait until the open ones end."""
        self._listener.close()
        for pump in self._pumps:
            pump.join(TIMEOUT_S)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            server = socket.create_connection(self._upstream, TIMEOUT_S)
            kept = bytearray(), bytearray()
            self.seen.append(kept)
            for ways in ((client, server, kept[0]), (server, client, kept[1])):
                pump = threading.Thread(target=_pump, args=ways, daemon=True)
                self._pumps.append(pump)
                pump.start()


def _pump(source: socket.socket, target: socket.socket, kept: bytearray) -> None:
    while data := source.recv(65536):
        kept += data
        target.sendall(data)
    target.shutdown(socket.SHUT_WR)


class Relay:
    """A relay between processes and a controller.

    Args:
        upstream: The address of the controller.
        watch: Receives the function that forwards data to the controller; returns a function that
            is called in its place.

    Attributes:
        address: The address of the relay.
        arrived: Released once for each new connection.
        open: While this is not set, nothing is forwarded on new connections.
    """

    def __init__(self, upstream: tuple[str, int], watch: Callable[[Send], Send]) -> None:
        self._upstream, self._watch = upstream, watch
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._listener.getsockname()
        self.arrived, self.open = threading.Semaphore(0), threading.Event()
        self.open.set()
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self.open.set()
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                threading.Thread(target=self._pass, args=(client,), daemon=True).start()

    def _pass(self, client: socket.socket) -> None:
        self.arrived.release()
        self.open.wait()
        with (
            suppress(OSError),
            client,
            socket.create_connection(self._upstream, TIMEOUT_S) as server,
        ):
            ways = {client: (server, self._watch(server.sendall)), server: (client, client.sendall)}
            while ways:
                for source in select.select([*ways], (), ())[0]:
                    target, send = ways[source]
                    if data := source.recv(65536):
                        send(data)
                    else:
                        target.shutdown(socket.SHUT_WR)
                        del ways[source]


class Processes:
    """Starts `scaraspec` and ends all processes with the test.

    Attributes:
        viewer: Whether the extra ``view`` is found; importing it takes longer than a short run.
    """

    def __init__(self) -> None:
        self._running: list[WarmProcess] = []
        self.viewer = False

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command until it ends."""
        process = self._start(*arguments, merged=False)
        out, error = process.communicate(TIMEOUT_S)
        return subprocess.CompletedProcess(arguments, process.wait(), out, error)

    def start(self, *arguments: str) -> WarmProcess:
        """Start a command. Its errors are in its output, too."""
        return self._start(*arguments, merged=True)

    def _start(self, *arguments: str, merged: bool) -> WarmProcess:
        process = WarmProcess(*arguments, merged=merged, viewer=self.viewer)
        self._running.append(process)
        return process

    def controller(self, *arguments: str) -> tuple[str, int]:
        """Start the virtual controller and return its address."""
        process = self.start("controller", "--listen", "127.0.0.1:0", *arguments)
        return address_in(process)

    def end(self) -> None:
        """Kill the processes and their children: a stopped child would keep its output open."""
        for process in self._running:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


def address_in(process: WarmProcess | subprocess.Popen[str]) -> tuple[str, int]:
    """The first address in the first line of a process."""
    assert process.stdout
    line = process.stdout.readline()
    found = re.search(r"(127\.0\.0\.1):(\d+)", line)
    assert found, line
    return found[1], int(found[2])


@pytest.fixture(autouse=True, scope="session")
def restore_signals() -> None:
    """Restore signals: a shell starts background processes with SIGINT ignored."""
    for number, usual in (
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGHUP, signal.SIG_DFL),
    ):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


@pytest.fixture
def processes() -> Iterator[Processes]:
    """Starts processes."""
    processes = Processes()
    yield processes
    processes.end()


@pytest.fixture
def viewer(processes: Processes) -> None:
    """Let the processes draw their recordings."""
    processes.viewer = True


@pytest.fixture
def refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., str]:
    """Run `scaraspec` in this process with arguments that it refuses; return its error message."""

    def run(*arguments: str) -> str:
        monkeypatch.setattr(sys, "argv", ["scaraspec", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capsys.readouterr()
        assert (ended.value.code, printed.out, printed.err.count("\n")) == (2, "", 1), printed
        return printed.err

    return run


@pytest.fixture
def witness() -> Callable[[tuple[str, int]], AbstractContextManager[Witness]]:
    """Makes witnesses: ``with witness(upstream) as one``."""
    return lambda upstream: closing(Witness(upstream))


@pytest.fixture
def relay() -> Callable[..., AbstractContextManager[Relay]]:
    """Makes relays: ``with relay(upstream) as one``."""
    return lambda upstream, watch=lambda send: send: closing(Relay(upstream, watch))
