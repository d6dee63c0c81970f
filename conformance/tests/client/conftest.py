"""What the tests of the client share: plays, in which a test is the controller and the clock."""

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
    """Opcode and data of what a client sent, which must be whole untagged frames (3/1, 3/15)."""
    framer = Framer(A2C)
    found = framer.feed(data)
    assert framer.held_bytes == 0
    assert not any(isinstance(item, Skipped) for item in found), data.hex(" ")
    return [(frame.opcode, frame.data) for frame in found if isinstance(frame, Frame)]


class Play:
    """A core on the stage: the test asks, speaks for the controller and lets time pass."""

    def __init__(self, dialect: Dialect = DEFAULT, *, login_required: bool = False) -> None:
        self.core = ClientCore(dialect, login_required=login_required)
        self.now_s = 100.0

    def ask(self, name: str, value: Any = None) -> PendingOperation:
        """The user gives a command."""
        return self.begin(self.core.command(name, value))

    def begin(self, operation: PendingOperation) -> PendingOperation:
        """The user gives a command that was prepared."""
        self.core.begin(operation, self.now_s)
        return operation

    def sent(self) -> list[tuple[int, bytes]]:
        """What the client has sent since the last look, as opcode and data."""
        return frames_of(self.core.bytes_to_send())

    def says(self, opcode: int, data: bytes = b"", *, tagged: bool = False) -> list[Event]:
        """The controller sends a frame."""
        return self.hears(Frame(C2A, opcode, data, tagged).encode())

    def hears(self, data: bytes) -> list[Event]:
        """Bytes arrive."""
        return self.core.feed(data, self.now_s)

    def waits(self, seconds: float) -> None:
        """Nothing arrives for so long; time goes from deadline to deadline, as in a shell."""
        until_s = self.now_s + seconds
        while (due_s := self.core.deadline_s) is not None and due_s <= until_s:
            self.now_s = max(self.now_s, due_s)
            self.core.tick(self.now_s)
        self.now_s = until_s


class ScriptedLink:
    """A link to a controller that is a function: a request in, delayed bytes out; time is free.

    Args:
        answer: Gives for each frame the bytes to send back, or the ending, each with its delay.
    """

    def __init__(
        self, answer: Callable[[int, bytes], Iterable[tuple[float, bytes | Ending]]]
    ) -> None:
        self.now_s = 1000.0
        self.asked: list[tuple[int, bytes]] = []
        self.closed = False
        self._answer = answer
        self._coming: deque[tuple[float, bytes | Ending]] = deque()

    def send(self, data: bytes) -> int:
        """Take requests and plan the answers."""
        for opcode, request in frames_of(data):
            self.asked.append((opcode, request))
            for delay_s, what in self._answer(opcode, request):
                self._coming.append((self.now_s + delay_s, what))
        self._coming = deque(sorted(self._coming, key=lambda coming: coming[0]))
        return 0

    def receive(self, deadline_s: float) -> Arrival | None:
        """Go to the next arrival or to the deadline."""
        if self.closed:
            raise LinkError("this link has been closed")
        if self._coming and self._coming[0][0] <= deadline_s:
            when_s, what = self._coming.popleft()
            self.now_s = max(self.now_s, when_s)
            return Arrival(0, what)
        self.now_s = max(self.now_s, deadline_s)
        return None

    def half_close(self) -> None:
        """Fail: no client does this."""
        raise AssertionError("a client has half-closed or reset its link")

    def close(self) -> None:
        """End it."""
        self.closed = True

    def reset(self) -> None:
        """Fail: no client does this."""
        raise AssertionError("a client has half-closed or reset its link")


@pytest.fixture(scope="session")
def new_play() -> type[Play]:
    """Makes plays."""
    return Play


@pytest.fixture
def play() -> Play:
    """A play in the default dialect, logged in."""
    return Play()


@pytest.fixture(scope="session")
def scripted_link() -> type[ScriptedLink]:
    """Makes links to scripted controllers."""
    return ScriptedLink
