"""Fixtures of the client tests: in a `Play` the test is the controller and the clock."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer, Skipped
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.transports.link import Arrival, Ending, LinkError


def frames_of(data: bytes) -> list[tuple[int, bytes]]:
    """Return opcode and data of sent frames; they must be complete and untagged (3/1, 3/15)."""
    framer = Framer(A2C)
    found = framer.feed(data)
    assert framer.buffered_bytes == 0
    assert not any(isinstance(item, Skipped) for item in found), data.hex(" ")
    return [(frame.opcode, frame.data) for frame in found if isinstance(frame, Frame)]


class Play:
    """A client core; the test sends requests, acts as the controller and advances the time."""

    def __init__(self, dialect: Dialect = DEFAULT, *, login_required: bool = False) -> None:
        self.core = ClientCore(dialect, login_required=login_required)
        self.now_s = 100.0

    def ask(self, name: str, value: Any = None) -> PendingOperation:
        """Start a command."""
        return self.begin(self.core.command(name, value))

    def begin(self, operation: PendingOperation) -> PendingOperation:
        """Start a prepared operation."""
        self.core.begin(operation, self.now_s)
        return operation

    def sent(self) -> list[tuple[int, bytes]]:
        """Return opcode and data of the frames sent since the last call."""
        return frames_of(self.core.bytes_to_send())

    def receive_frame(self, opcode: int, data: bytes = b"", *, tagged: bool = False) -> list[Event]:
        """Receive a frame from the controller."""
        return self.receive_bytes(Frame(C2A, opcode, data, tagged).encode())

    def receive_bytes(self, data: bytes) -> list[Event]:
        """Receive bytes."""
        return self.core.feed(data, self.now_s)

    def wait_for(self, seconds: float) -> None:
        """Receive nothing for `seconds`; the time advances from deadline to deadline."""
        until_s = self.now_s + seconds
        while (due_s := self.core.deadline_s) is not None and due_s <= until_s:
            self.now_s = max(self.now_s, due_s)
            self.core.tick(self.now_s)
        self.now_s = until_s


class ScriptedLink:
    """A link to a scripted controller: a function maps a request to delayed bytes. No real time.

    Args:
        answer: Returns the reply bytes, or the ending, with a delay in seconds, for each frame.
    """

    def __init__(
        self, answer: Callable[[int, bytes], Iterable[tuple[float, bytes | Ending]]]
    ) -> None:
        self.now_s = 1000.0
        self.requests: list[tuple[int, bytes]] = []
        self.closed = False
        self._answer = answer
        self._coming: deque[tuple[float, bytes | Ending]] = deque()

    def send(self, data: bytes) -> int:
        """Record requests and schedule the replies."""
        for opcode, request in frames_of(data):
            self.requests.append((opcode, request))
            for delay_s, what in self._answer(opcode, request):
                self._coming.append((self.now_s + delay_s, what))
        self._coming = deque(sorted(self._coming, key=lambda coming: coming[0]))
        return 0

    def receive(self, deadline_s: float) -> Arrival | None:
        """Advance to the next arrival or to the deadline."""
        if self.closed:
            raise LinkError("this link has been closed")
        if self._coming and self._coming[0][0] <= deadline_s:
            when_s, what = self._coming.popleft()
            self.now_s = max(self.now_s, when_s)
            return Arrival(0, what)
        self.now_s = max(self.now_s, deadline_s)
        return None

    def half_close(self) -> None:
        """Fail: a client never does this."""
        raise AssertionError("a client has half-closed or reset its link")

    def close(self) -> None:
        """Close the link."""
        self.closed = True

    def reset(self) -> None:
        """Fail: a client never does this."""
        raise AssertionError("a client has half-closed or reset its link")


@pytest.fixture(scope="session")
def new_play() -> type[Play]:
    """Return the class `Play`."""
    return Play


@pytest.fixture
def play() -> Play:
    """A logged-in `Play` in the default dialect."""
    return Play()


@pytest.fixture(scope="session")
def scripted_link() -> type[ScriptedLink]:
    """Return the class `ScriptedLink`."""
    return ScriptedLink
