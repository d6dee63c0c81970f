"""Access to a client under test: how the suite starts operations and where the client connects.

A client with a driver process uses real time and real sockets. A client in memory uses a simulated
clock. The rest of the suite does not depend on the difference.
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
    """Access to a client under test.

    Attributes:
        host: The address that the client connects to.
        port: The port that the client connects to.
        connected_port: The local port of the latest connection.
        folder: The folder with the files that the client uploads and downloads.
        answer_timeout_s: How long the client may take to answer an operation.
        attended: An operator controls the client. The suite then omits unnecessary steps.
        real_time: The client's clock is not simulated.
    """

    attended: bool
    real_time: bool
    host: str
    port: int
    connected_port: int
    folder: Path
    answer_timeout_s: float

    @property
    def now_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""

    @property
    def now_s(self) -> float:
        """The current time in seconds, on the clock that deadlines use."""

    @property
    def unmatched_lines(self) -> Sequence[str]:
        """The lines of the driver that answer no operation."""

    @property
    def complaints(self) -> str:
        """The end of its error output, for the report."""

    def begin(self, name: str, /, **values: Any) -> Call:
        """Start an operation without waiting for its answer.

        Raises:
            DriverError: The driver accepts no more operations.
        """

    def pump(self) -> None:
        """Process the answers received so far.

        Raises:
            DriverError: The driver has ended, or its output does not stop.
        """

    def wait(self, deadline_s: float) -> None:
        """Wait until the client answers or the deadline passes."""

    def accept(self, deadline_s: float) -> Link | None:
        """Return the next connection; None at the deadline or if the client answers first."""

    def listen_at_default(self) -> bool:
        """Also listen at port 8877 (2/3). Return False if the port is not available."""

    def ask_operator(self, sentence: str) -> Call | None:
        """Ask the operator whether the sentence is true; None without an operator."""

    def restart(self) -> None:
        """Stop the client and start it again.

        Raises:
            DriverError: The client cannot be started.
        """


class DriverAccess:
    """Access to a client through a driver process.

    Args:
        command: The driver's command line.
        answer_timeout_s: How long the client may take to answer an operation.

    Raises:
        DriverError: The driver cannot be started.
        OSError: No port is available, or the folder cannot be created.
    """

    attended = False
    real_time = True

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
        """See `transports.clock`."""
        return now_ns()

    @property
    def now_s(self) -> float:
        """The monotonic clock of the system."""
        return time.monotonic()

    @property
    def unmatched_lines(self) -> Sequence[str]:
        """The lines of its stdout that answer no operation."""
        return self._driver.unmatched_lines

    @property
    def complaints(self) -> str:
        """The end of its stderr."""
        return self._driver.stderr

    def begin(self, name: str, /, **values: Any) -> Call:
        """Write a request line to the driver; see `Access.begin`."""
        return self._driver.begin(name, **values)

    def pump(self) -> None:
        """Read its stdout; see `Access.pump`."""
        self._driver.pump()

    def wait(self, deadline_s: float) -> None:
        """Wait for its stdout; see `Access.wait`."""
        wait_readable(deadline_s, self._driver)

    def accept(self, deadline_s: float) -> Link | None:
        """Accept a connection; see `Access.accept`."""
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

    def ask_operator(self, sentence: str) -> Call | None:  # noqa: ARG002 - the driver itself reports this
        """Return None: a driver has no operator."""
        return None

    def restart(self) -> None:
        """Restart the process; see `Access.restart`."""
        self._driver.restart()

    def close(self) -> None:
        """Stop the process and remove its files."""
        self._driver.close()
        for listener in self._listeners:
            listener.close()
        self._scratch.cleanup()
