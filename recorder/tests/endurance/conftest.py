"""A recorder as a user runs it, and clients of a virtual controller that store all their bytes.

A client knows all bytes that it has sent and that were answered. The tests compare a recording with
them, whatever process was killed during it.
"""

import os
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import count, cycle, islice
from pathlib import Path
from typing import Any

import pytest

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.transfer import Chunk
from scaraspec.traffic.wire import EARLIER_FILE, Kind, WireEvent
from scaraspec_recorder.sinks.gap_filler import NOT_RECORDED
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.spool.locks import spool_folder
from scaraspec_recorder.spool.spool import read_checkpoint

TIMEOUT_S = 60.0
PACE_S = 0.002
# Needed to follow the requests of a file that starts in the middle.
UNACCOUNTED = (EARLIER_FILE, NOT_RECORDED)
UPLOAD = bytes(range(256)) * 12
POLLS = (
    "get_status",
    "get_joint_angles",
    "get_tool_coordinates",
    "get_motor_temperatures",
    "get_digital_inputs",
    "get_running_program",
)


def _has_replies_or_failed(talker: Any, count: int) -> bool:
    return bool(talker.reply_count >= count or talker.failure)


def wait_until(condition: Callable[[], Any]) -> Any:
    """Wait until another process changes this; return the result."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while not (found := condition()):
        assert time.monotonic() < deadline_s, "timeout"
        select.select([], [], [], 0.01)
    return found


def request(name: str, value: Any = None) -> bytes:
    command = BY_NAME[name]
    return Frame(A2C, command.opcode, command.request.encode(value)).encode()


def shift() -> list[bytes]:
    """The requests that a client repeats: queries, and sometimes an upload."""
    polls = [request(name) for name in POLLS] * 10
    pieces = [UPLOAD[at : at + 200] for at in range(0, len(UPLOAD), 200)]
    chunks = [Chunk(len(UPLOAD), 200 * n, len(piece), piece) for n, piece in enumerate(pieces)]
    upload = [request("upload_name", b"kill.rob"), *(request("upload_chunk", c) for c in chunks)]
    return polls + upload


@dataclass
class Session:
    """One connection with the bytes of its client. Its unique address identifies the session."""

    client: str
    begun_ns: int
    bytes: dict[Direction, bytearray] = field(
        default_factory=lambda: {A2C: bytearray(), C2A: bytearray()}
    )
    answers: list[tuple[int, int, dict[Direction, int]]] = field(default_factory=list)
    """For each exchange: time of the reply, duration, and the number of bytes until then."""
    ended_ns: int = 0
    complete: bool = False
    """Whether the client ended it."""


class Talker(threading.Thread):
    """A client that sends requests, waits for the replies, and reconnects after a disconnect.

    Args:
        numbers: Session numbers, shared with other talkers.
        address: Address of the recorder.
        exchanges: Exchanges of a session after the login; None for no limit.
    """

    def __init__(
        self, numbers: Iterator[int], address: tuple[str, int], exchanges: int | None = None
    ) -> None:
        super().__init__(daemon=True)
        self.sessions: list[Session] = []
        self.failure: BaseException | None = None
        self._numbers = numbers
        self._address = address
        self._exchanges = exchanges
        self._stopped = threading.Event()

    @property
    def reply_count(self) -> int:
        """Return the number of replies."""
        return sum(len(session.answers) for session in self.sessions)

    def stop(self) -> None:
        """End the session in order."""
        self._stopped.set()
        self.join(TIMEOUT_S)
        assert not self.is_alive()
        if self.failure:
            raise self.failure

    def run(self) -> None:
        try:
            number = next(self._numbers)
            while not self._stopped.wait(PACE_S):
                if self._connect(number):
                    number = next(self._numbers)
        except BaseException as error:  # noqa: BLE001 - raised in the test's own thread by `stop`
            self.failure = error

    def _connect(self, number: int) -> bool:
        """Run a session, if a recorder is listening."""
        with socket.socket() as sock:
            sock.settimeout(TIMEOUT_S)
            sock.bind((f"127.1.{number >> 8}.{number & 0xFF}", 0))
            try:
                sock.connect(self._address)
            except ConnectionError:
                return False
            host, port = sock.getsockname()
            session = Session(f"{host}:{port}", time.time_ns())
            self.sessions.append(session)
            with suppress(ConnectionError, EOFError):  # disconnected, by reset or in order
                self._talk(sock, session, number)
                session.complete = True
            session.ended_ns = time.time_ns()
            return True

    def _talk(self, sock: socket.socket, session: Session, number: int) -> None:
        framer = Framer(C2A)
        self._exchange(sock, session, framer, request("login", b"password"))
        # The name identifies the session where only its bytes are known.
        self._exchange(sock, session, framer, request("upload_name", b"%d.rob" % number))
        for question in islice(cycle(shift()), self._exchanges):
            if self._stopped.wait(PACE_S):
                return
            self._exchange(sock, session, framer, question)

    def _exchange(
        self, sock: socket.socket, session: Session, framer: Framer, question: bytes
    ) -> None:
        begun_ns = time.time_ns()
        sock.sendall(question)
        session.bytes[A2C] += question
        while True:
            data = sock.recv(1 << 16)
            if not data:
                raise EOFError
            session.bytes[C2A] += data
            if found := framer.feed(data):
                break
        (answer,) = found
        assert isinstance(answer, Frame)
        assert answer.opcode == question[1], "a reply to another request"
        now_ns = time.time_ns()
        passed = {way: len(data) for way, data in session.bytes.items()}
        session.answers.append((now_ns, now_ns - begun_ns, passed))


class Recorder:
    """`scaraspec record`, started in its own process group like by a service manager.

    Args:
        url: The controller.
        out: The folder.
        log: The output of all its processes.
    """

    def __init__(self, url: str, out: Path, log: Path) -> None:
        self.address = ("127.0.0.1", 0)
        self.url, self.out = url, out
        self.environment = dict(os.environ)
        self._log = log
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, *options: str) -> None:
        """Start, and wait until it listens: at the same address each time."""
        begin = self._log.stat().st_size if self._log.exists() else 0
        listen = "{}:{}".format(*self.address)
        arguments = ("record", self.url, "--listen", listen, "--out", str(self.out), *options)
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "scaraspec", *arguments],
                stdout=log,
                stderr=log,
                start_new_session=True,
                env=self.environment,
            )

        def listening() -> Any:
            assert self._process
            assert self._process.poll() is None, self._log.read_text()
            reported = self._log.read_bytes()[begin:].decode()
            return re.search(r"^recording 127\.0\.0\.1:(\d+) ", reported, re.MULTILINE)

        self.address = ("127.0.0.1", int(wait_until(listening)[1]))

    def kill(self, victim: str) -> int:
        """Kill one process or all, wait until they are dead, and return the time."""
        assert self._process
        own = {name: self.child(name) for name in ("tap", "writer")}
        watches = {name: os.pidfd_open(pid) for name, pid in own.items()}
        killed_ns = time.time_ns()
        if victim in own:
            os.kill(own[victim], signal.SIGKILL)
            dying = [watches[victim]]
        else:
            (os.killpg if victim == "all" else os.kill)(self._process.pid, signal.SIGKILL)
            self._process.wait(TIMEOUT_S)
            dying = list(watches.values())
        for watch in dying:
            assert select.select([watch], [], [], TIMEOUT_S)[0], "it does not die"
        for watch in watches.values():
            os.close(watch)
        return killed_ns

    def child(self, name: str) -> int:
        """Return the process id of a child process, as soon as it exists."""
        return int(wait_until(lambda: self.find_child(name)))

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal; return the exit status."""
        assert self._process
        self._process.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        """Wait for the end; return the exit status."""
        assert self._process
        return self._process.wait(TIMEOUT_S)

    @property
    def pid(self) -> int:
        """The process id of the recorder itself."""
        assert self._process
        return self._process.pid

    def close(self) -> None:
        """Kill all processes that still run."""
        if self._process and self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait(TIMEOUT_S)

    def find_child(self, name: str) -> int | None:
        """Return the process id of a child process, found by its name; None if there is none."""
        with suppress(OSError):  # the process has ended
            for child in Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text().split():
                with suppress(OSError):
                    if Path(f"/proc/{child}/comm").read_text().strip() == f"scara-{name}":
                        return int(child)
        return None

    @property
    def running(self) -> bool:
        """Whether the recorder itself runs."""
        return self._process is not None and self._process.poll() is None


class Plant:
    """A virtual controller, a recorder between it and clients."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.log = folder / "recorder.log"
        self.talkers: list[Talker] = []
        self._stack = stack
        self._numbers = count(1)
        ready = folder / "ready"
        controller = subprocess.Popen(
            [
                *(sys.executable, "-m", "scaraspec", "controller"),
                *("--listen", "127.0.0.1:0", "--ready-file", str(ready)),
            ],
            stdout=subprocess.DEVNULL,
        )
        stack.callback(controller.wait)
        stack.callback(controller.kill)
        wait_until(ready.exists)
        self.recorder = Recorder(f"tcp://{ready.read_text().strip()}", folder / "out", self.log)
        self.out.mkdir()
        stack.callback(lambda: shutil.rmtree(self._spool, ignore_errors=True))
        stack.callback(self.recorder.close)

    @property
    def out(self) -> Path:
        """The folder of the recorder."""
        return self.recorder.out

    @property
    def sessions(self) -> list[Session]:
        return [session for talker in self.talkers for session in talker.sessions]

    def talk(self, talkers: int, exchanges: int | None = None) -> None:
        """Start clients; with a number of exchanges, each of their sessions has so many."""
        for _ in range(talkers):
            self.talkers.append(Talker(self._numbers, self.recorder.address, exchanges))
            self.talkers[-1].start()

    def stop_clients(self) -> None:
        """End the clients."""
        for talker in self.talkers:
            talker.stop()

    def wait_for_replies(self, count: int) -> None:
        """Wait until each client has this number of further replies."""
        for talker in self.talkers:
            wait_until(partial(_has_replies_or_failed, talker, talker.reply_count + count))

    def wait_for_recording(self) -> None:
        """Wait until bytes that are sent from now on are in a file."""
        recorded_bytes = self._recorded_bytes()
        wait_until(lambda: self._recorded_bytes() > recorded_bytes)

    @property
    def _spool(self) -> Path:
        return spool_folder(self.out)  # a test may choose another folder

    def _recorded_bytes(self) -> int:
        return Progress.read(read_checkpoint(self._spool).get("state", {})).a2c.recorded_bytes

    def wait_for_output(self, *words: str) -> None:
        """Wait for a line of the recorder that contains all these words."""
        wait_until(
            lambda: any(
                all(word in line for word in words) for line in self.log.read_text().splitlines()
            )
        )


@dataclass
class Stream:
    """One direction of a session, joined from all files."""

    data: bytearray = field(default_factory=bytearray)
    lost: list[tuple[int, int]] = field(default_factory=list)
    """Start and end of the bytes that are counted as not recorded."""

    def add(self, event: WireEvent) -> None:
        """Add bytes or a gap; bytes in two files must be equal."""
        begin, data = event.offset_bytes, event.data
        if event.kind is Kind.GAP:
            if begin + event.length_bytes <= len(self.data):
                return  # of unknown length, or in an earlier file
            assert event.note not in UNACCOUNTED, "an unaccounted gap"
            self.lost.append((begin, begin + event.length_bytes))
            data = bytes(event.length_bytes)
        assert begin <= len(self.data), "a hole"
        assert self.data[begin : begin + len(data)] == data[: len(self.data) - begin]
        self.data[begin : begin + len(data)] = data

    def matches(self, passed: bytes) -> bool:
        """Return whether the recorded part equals the sent bytes, except for gaps."""
        expected = bytearray(passed[: len(self.data)])
        for begin, end in self.lost:
            expected[begin:end] = bytes(len(expected[begin:end]))
        return self.data[: len(expected)] == expected


def read(out: Path) -> dict[str, dict[Direction, Stream]]:
    """Return what the files of a folder contain of each client.

    A file is empty if its writer was killed before it wrote.
    """
    found: dict[str, dict[Direction, Stream]] = {}
    files = [file for file in out.glob("*.mcap") if file.stat().st_size]
    for file in sorted(files, key=_begin_ns):
        clients: dict[str, str] = {}
        for event in read_mcap(file):
            if event.kind is Kind.OPENED:
                clients[event.connection] = event.note.partition(" > ")[0]
            elif event.kind in (Kind.BYTES, Kind.GAP):
                client = clients[event.connection]
                streams = found.setdefault(client, {way: Stream() for way in Direction})
                streams[event.direction].add(event)
    return found


def _begin_ns(file: Path) -> int:
    return next((event.time_ns for event in read_mcap(file)), 0)


@pytest.fixture(scope="session")
def recorded() -> Callable[[Path], dict[str, dict[Direction, Stream]]]:
    """Return a function that reads the recorded bytes of each client from all files of a folder."""
    return read


@pytest.fixture
def plant(tmp_path: Path) -> Iterator[Plant]:
    with ExitStack() as stack:
        plant = Plant(tmp_path, stack)
        yield plant
    print(plant.log.read_text())  # noqa: T201 - shown where the test fails
