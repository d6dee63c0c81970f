"""Access: how the suite gets at a client under test: what orders it about, and where it connects.

A client behind a driver lives in real time and on real sockets; one in memory has a clock that
jumps. Which of them it is, nothing else in the suite knows.
"""

import socket
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Protocol

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.driver import Driver
from scaraspec.suite.client.harness.watched_link import WatchedLink
from scaraspec.transports.clock import now_ns
from scaraspec.transports.link import Link
from scaraspec.transports.tcp import wait_readable

LOOPBACK: Final = "127.0.0.1"


class Access(Protocol):
    """A way to a client under test.

    Attributes:
        host: Where it is to connect.
        port: The port of that.
        dialled_port: The port at which the latest connection came.
        folder: Where its files are: those to send, and those that it fetches.
        answer_s: For how long it may think about an order.
        attended: An operator works it, who is spared what is not necessary.
    """

    attended: bool
    host: str
    port: int
    connected_port: int
    folder: Path
    answer_timeout_s: float

    @property
    def now_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""

    @property
    def now_s(self) -> float:
        """The present instant of the clock that deadlines refer to."""

    @property
    def unmatched_lines(self) -> Sequence[str]:
        """What was said that answers no order."""

    @property
    def complaints(self) -> str:
        """The end of what it complained of, for the report."""

    def begin(self, name: str, /, **values: Any) -> Call:
        """Order an operation, and go on.

        Raises:
            DriverError: Nobody takes orders any more.
        """

    def pump(self) -> None:
        """Take what it has said so far.

        Raises:
            DriverError: It has ended, or floods.
        """

    def wait(self, deadline_s: float) -> None:
        """Let time pass until it says something, or until then."""

    def accept(self, deadline_s: float) -> Link | None:
        """The next connection; None if none came, or if it said something first."""

    def listen_at_default(self) -> bool:
        """Also listen at port 8877 (2/3); whether that can be done."""

    def ask_operator(self, sentence: str) -> Call | None:
        """Ask whoever watches it whether this is so; None where nobody does."""

    def restart(self) -> None:
        """End it, and start it anew.

        Raises:
            DriverError: It cannot be started.
        """


class DriverAccess:
    """A client behind a driver process.

    Args:
        command: The driver's command line.
        answer_s: For how long it may think about an order.

    Raises:
        DriverError: It cannot be started.
        OSError: There is no port to be had, or no folder.
    """

    attended = False

    def __init__(self, command: str, answer_timeout_s: float = 10.0) -> None:
        self.answer_timeout_s = answer_timeout_s
        self._driver = Driver(command)
        self._scratch = tempfile.TemporaryDirectory(prefix="scaraspec-")
        self.folder = Path(self._scratch.name)
        self._listeners = [socket.create_server((LOOPBACK, 0))]
        self.host, self.port = LOOPBACK, self._listeners[0].getsockname()[1]
        self.connected_port = self.port

    @property
    def now_ns(self) -> int:
        """See `links.clock`."""
        return now_ns()

    @property
    def now_s(self) -> float:
        """The system's monotonic clock."""
        return time.monotonic()

    @property
    def unmatched_lines(self) -> Sequence[str]:
        """Lines of its stdout that answer nothing."""
        return self._driver.unmatched_lines

    @property
    def complaints(self) -> str:
        """The end of its stderr."""
        return self._driver.stderr

    def begin(self, name: str, /, **values: Any) -> Call:
        """Write an order; see `Access.begin`."""
        return self._driver.begin(name, **values)

    def pump(self) -> None:
        """Read its stdout; see `Access.pump`."""
        self._driver.pump()

    def wait(self, deadline_s: float) -> None:
        """Wait for its stdout; see `Access.wait`."""
        wait_readable(deadline_s, self._driver)

    def accept(self, deadline_s: float) -> Link | None:
        """Take a connection; see `Access.accept`."""
        ready = wait_readable(deadline_s, self._driver, *self._listeners)
        for listener in self._listeners:
            if listener in ready:
                connected, _ = listener.accept()
                self.connected_port = listener.getsockname()[1]
                return WatchedLink(connected, self._driver)
        return None

    def listen_at_default(self) -> bool:
        """Also listen at port 8877; see `Access.listen_at_default`."""
        with suppress(OSError):
            self._listeners.append(socket.create_server((LOOPBACK, DEFAULT_PORT)))
        return len(self._listeners) > 1

    def ask_operator(self, sentence: str) -> Call | None:  # noqa: ARG002 - a driver says it by itself
        """Nobody is asked."""
        return None

    def restart(self) -> None:
        """Start the process anew; see `Access.restart`."""
        self._driver.restart()

    def close(self) -> None:
        """End the process, and take its files away."""
        self._driver.close()
        for listener in self._listeners:
            listener.close()
        self._scratch.cleanup()
