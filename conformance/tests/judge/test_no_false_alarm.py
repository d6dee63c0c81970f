"""No false alarms: the judge reads conforming clients and a virtual controller of any dialect.

A session is a list of steps that hypothesis draws. After a false alarm hypothesis shortens it.
SCARASPEC_FULL=1 tries about sixteen times as many.
"""

import os
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any, Literal

import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import (
    BY_NAME,
    COMMANDS,
    Command,
    MoveTarget,
    PasswordChange,
    Point,
    PortValue,
)
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.errors import FAILURES
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import JogDirection
from scaraspec.protocol.program_files import Node, NodeType, Program, SetOutput, WaitSeconds, build
from scaraspec.protocol.readings import READINGS, Dialect
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.engine.strategies import payload_values
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.transports.link import Ending
from scaraspec.transports.memory import MemoryLink, MemoryNetwork
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.session import Action
from scaraspec.virtual_controller.store import Store

BATCHES = 400 if os.environ.get("SCARASPEC_FULL") else 24

NOT_CONFORMING = {("prelogin", "all"), ("busy_reply", "queue"), ("err_sep", "space")}
"""Readings that the register lists but does not permit (A-4-4, A-4-2, A-0-2)."""

WAIT = Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(2))
OUTPUT = Node(b"", NodeType.SET_OUTPUT, data=SetOutput(4, 3, 1, 0))
PROGRAMS = {
    b"short.rob": build(Program(nodes=(WAIT,))),
    b"long.rob": build(Program(nodes=(WAIT, OUTPUT, WAIT, WAIT))),
    b"empty.txt": build(Program(nodes=())),
}
CONTENTS = (PROGRAMS[b"long.rob"], b"x" * 400, b"no program", bytes(range(256)) * 3)


class Tap:
    """A recorder between a network and a core, which keeps all traffic as wire events."""

    def __init__(self, core: ControllerCore) -> None:
        self.events: list[WireEvent] = []
        self._core = core
        self._offsets: dict[tuple[int, Direction], int] = {}
        self._live: set[int] = set()

    @property
    def next_event_s(self) -> float | None:
        return self._core.next_event_s

    def open(
        self, connection: int, now_s: float, link: Literal["tcp", "serial"]
    ) -> Sequence[Action]:
        self._live.add(connection)
        self._add(connection, A2C, Kind.OPENED, now_s)
        return self._record(self._core.open(connection, now_s, link), now_s)

    def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
        self._add(connection, A2C, Kind.BYTES, now_s, data)
        return self._record(self._core.receive(connection, data, now_s), now_s)

    def close(self, connection: int, now_s: float) -> Sequence[Action]:
        self._end(connection, A2C, now_s)
        return self._record(self._core.close(connection, now_s), now_s)

    def advance(self, now_s: float) -> Sequence[Action]:
        return self._record(self._core.advance(now_s), now_s)

    def _record(self, actions: Sequence[Action], now_s: float) -> Sequence[Action]:
        for action in actions:
            if action.data is None:
                self._end(action.connection, C2A, now_s)
            elif action.connection in self._live:
                self._add(action.connection, C2A, Kind.BYTES, now_s, action.data)
        return actions

    def _end(self, connection: int, direction: Direction, now_s: float) -> None:
        if connection in self._live:
            self._live.remove(connection)
            self._add(connection, direction, Kind.CLOSED, now_s)

    def _add(
        self, connection: int, direction: Direction, kind: Kind, now_s: float, data: bytes = b""
    ) -> None:
        time_ns = round(now_s * 1e9) + 1000 * len(self.events)  # no two events have the same time
        at = self._offsets.get((connection, direction), 0)
        self._offsets[connection, direction] = at + len(data)
        self.events.append(WireEvent(time_ns, str(connection), direction, kind, data, at))


class Client:
    """One connection, and what was received on it."""

    def __init__(self, link: MemoryLink, dialect: Dialect) -> None:
        self.link = link
        self.open = True
        self._dialect = dialect
        self._framer = Framer(C2A)

    def ask(self, name: str, value: Any = None, *, answer: bool = False) -> list[Frame]:
        """Send a request, or a reply to a chunk; return what arrives at once."""
        command = BY_NAME[name]
        payload = command.reply if answer else command.request
        opcode = command.opcode
        if command.alternate_opcode and self._dialect["op_get_default"] == "0x13":
            opcode = command.alternate_opcode
        self.send(Frame(A2C, opcode, payload.encode(value, self._dialect)).encode())
        return self.receive_frames()

    def send(self, data: bytes) -> None:
        """Send bytes, unless the controller has closed the connection."""
        self.receive_frames()
        if self.open:
            self.link.send(data)

    def receive_frames(self) -> list[Frame]:
        """Return what has arrived; disconnect if the controller has closed the connection."""
        frames = []
        while self.open and (arrival := self.link.receive(self.link.now_s)):
            if isinstance(arrival.content, Ending):
                self.hang_up()
            else:
                frames += [f for f in self._framer.feed(arrival.content) if isinstance(f, Frame)]
        return frames

    def hang_up(self) -> None:
        """Close the connection."""
        self.open = False
        self.link.close()


def has_reply(frames: list[Frame], name: str, data: bytes) -> bool:
    """Return whether the frames contain a reply to this command with this data."""
    return any(
        frame.opcode == BY_NAME[name].opcode and not frame.tagged and frame.data[:1] == data
        for frame in frames
    )


class Session:
    """A controller and its clients; each method is a step."""

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.plant = Plant(datetime(2026, 2, 28, 23, 58), now_s=0.0)  # noqa: DTZ001 - the document names no zone
        self.store = Store()
        for name, content in PROGRAMS.items():
            self.store.write(name, content)
        self.tap = Tap(ControllerCore(self.plant, self.store, dialect))
        self.network = MemoryNetwork(self.tap)
        self.password = b"password"
        self.clients: list[Client] = []

    def client(self, number: int) -> Client | None:
        """One of the connected clients."""
        for client in self.clients:
            client.receive_frames()
        self.clients = [client for client in self.clients if client.open]
        return self.clients[number % len(self.clients)] if self.clients else None

    def connect(self) -> None:
        """A client connects and logs in."""
        client = Client(self.network.connect(), self.dialect)
        client.receive_frames()
        if client.open and has_reply(client.ask("login", self.password), "login", b"1"):
            self.clients.append(client)
        elif client.open:
            client.hang_up()

    def mistake(self, password: bytes) -> None:
        """A client connects, tries a password that is probably wrong, and disconnects."""
        client = Client(self.network.connect(), self.dialect)
        client.ask("login", password)
        if client.open:
            client.hang_up()

    def hang_up(self, number: int) -> None:
        """A client disconnects."""
        if client := self.client(number):
            client.hang_up()

    def ask(self, number: int, name: str, value: Any) -> None:
        """A client sends a request."""
        if client := self.client(number):
            client.ask(name, value)

    def query_several(self, number: int, names: Sequence[str]) -> None:
        """A client sends several queries, one after the other."""
        for name in names:
            self.ask(number, name, None)
            self.wait(0.001)

    def ask_slowly(self, number: int, name: str, cut: int) -> None:
        """A client sends a request without data in two pieces."""
        if client := self.client(number):
            data = Frame(A2C, BY_NAME[name].opcode).encode()
            client.send(data[:cut])
            self.wait(0.1)
            client.send(data[cut:])

    def change_password(self, number: int, new: bytes) -> None:
        """A client sets another password."""
        client = self.client(number)
        change = PasswordChange(self.password, new)
        if client and has_reply(client.ask("set_password", change), "set_password", b"1"):
            self.password = new

    def upload(self, number: int, name: bytes, content: bytes, most_chunks: int) -> None:
        """A client uploads a file, or a part of it."""
        client = self.client(number)
        if not client or not has_reply(client.ask("upload_name", name), "upload_name", b"1"):
            return
        for chunk in list(chunks_of(content))[:most_chunks]:
            if not has_reply(client.ask("upload_chunk", chunk), "upload_chunk", b"1"):
                return

    def download(self, number: int, name: bytes, most_chunks: int) -> None:
        """A client downloads a file, or a part of it."""
        client = self.client(number)
        if not client:
            return
        frames = client.ask("download_name", name)
        for _ in range(most_chunks):
            if not any(frame.opcode == BY_NAME["download_chunk"].opcode for frame in frames):
                return
            frames = client.ask("download_chunk", True, answer=True)  # noqa: FBT003 - the flag's value

    def wait(self, duration_s: float) -> None:
        self.network.run_until(self.network.now_s + duration_s)

    def fault(self, code: str, lasting: bool) -> None:  # noqa: FBT001 - a step's argument
        self.plant.fail(code, self.network.now_s, lasting=lasting)
        self.wait(0.001)

    def recover(self, number: int) -> None:
        """The fault is repaired, and a client resets the robot."""
        self.plant.repair()
        self.ask(number, "reset", None)
        self.wait(10.0)

    def events(self) -> list[WireEvent]:
        """All traffic, after all connections are closed."""
        while client := self.client(0):
            client.hang_up()
        return self.tap.events


numbers = st.integers(0, 2)
stored = st.sampled_from([*PROGRAMS, b"new.rob", b"nope.rob"])
likely: dict[str, SearchStrategy[Any]] = {
    "run_program": stored,
    "simulate_program": stored,
    "delete_program": stored,
    "set_default_program": stored,
    "set_tool_coordinates": st.builds(
        MoveTarget,
        st.integers(1, 100),
        st.sampled_from([200, 300, -250]),
        st.sampled_from([0, 100, -200]),
        st.sampled_from([160, 250, 340]),
        st.sampled_from([0, 90]),
        st.just(0),
        st.just(0),
    ),
    "jog": st.sampled_from(JogDirection),
    "emergency_stop": st.none(),
    "reset": st.none(),
    "set_digital_output": st.builds(PortValue, st.integers(1, 16), st.integers(0, 1)),
    "set_gripper_center": st.builds(Point, *[st.sampled_from([0.0, 12.5])] * 3),
}
REQUESTED = [c for c in COMMANDS if c.initiator is A2C and c.clause < "5" and c.name != "login"]


def requests(command: Command) -> SearchStrategy[tuple[Any, ...]]:
    """Steps that send this request, with any valid value or, mostly, a useful one."""
    value = payload_values(command.request)
    if command.name in likely:
        value = likely[command.name] | likely[command.name] | value
    return st.tuples(st.just("ask"), numbers, st.just(command.name), value)


queries = [c.name for c in REQUESTED if c.hazard is Hazard.READ_ONLY and not c.request.fields]
usual = st.one_of(
    st.just(("wait", 0.0)),  # first, because hypothesis shrinks unneeded steps to it
    st.tuples(st.just("wait"), st.sampled_from([0.001, 0.05, 0.3, 1.0, 3.0])),
    st.sampled_from([c for c in REQUESTED if c.name in likely]).flatmap(requests),
    st.tuples(
        st.just("query_several"), numbers, st.just(("get_status", "get_running_program") * 2)
    ),
    st.tuples(
        st.just("query_several"), numbers, st.just(("get_joint_angles", "get_tool_coordinates") * 2)
    ),
    st.tuples(st.just("query_several"), numbers, st.lists(st.sampled_from(queries), max_size=4)),
    st.tuples(
        st.just("upload"),
        numbers,
        st.sampled_from([b"new.rob", b"other.rob"]),
        st.sampled_from(CONTENTS),
        st.sampled_from([9, 1]),
    ),
    st.tuples(st.just("download"), numbers, stored, st.sampled_from([9, 1])),
)
rare = st.one_of(
    st.just(("connect",)),
    st.tuples(st.just("hang_up"), numbers),
    st.tuples(st.just("mistake"), payload_values(BY_NAME["login"].request)),
    st.tuples(st.just("change_password"), numbers, payload_values(BY_NAME["login"].request)),
    st.tuples(st.just("ask_slowly"), numbers, st.sampled_from(queries), st.integers(1, 3)),
    st.sampled_from(REQUESTED).flatmap(requests),
    st.just(("wait", 31.0)),
    st.tuples(st.just("fault"), st.sampled_from(sorted(c.text for c in FAILURES)), st.booleans()),
    st.tuples(st.just("recover"), numbers),
)
steps = st.integers(0, 3).flatmap(lambda number: rare if number == 3 else usual)
unusual = st.sampled_from(
    [
        (key, option.name)
        for key, reading in READINGS.items()
        for option in reading.options[1:]
        if (key, option.name) not in NOT_CONFORMING
    ]
)


@pytest.mark.parametrize("batch", range(BATCHES))
def test_conforming_peers_have_no_failures(judged: Callable[..., Any], batch: int) -> None:
    """Conforming peers get no finding worse than tolerated, in any dialect."""

    # After ten examples hypothesis mostly varies earlier ones, so that many short runs find more.
    @seed(batch)
    @settings(max_examples=10, suppress_health_check=[HealthCheck.too_slow])
    @given(st.lists(unusual, max_size=5).map(dict), st.lists(steps, min_size=20, max_size=60))
    def judge(readings: dict[str, str], steps: list[tuple[Any, ...]]) -> None:
        session = Session(Dialect.of(**readings))
        session.connect()
        for name, *arguments in steps:
            getattr(session, name)(*arguments)
        record = judged(session.events(), session.dialect)
        assert [
            (f.requirement, f.verdict.value, f.message, f.expected, f.observed)
            for f in record.findings
            if f.verdict is not Verdict.TOLERATED
        ] == []

    judge()
