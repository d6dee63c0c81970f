"""The blocking shell: a `Client` that may be used from several threads.

Here the core meets a link and threads. No thread is started: of those that wait, one listens to
the link for all, and another takes over when it has what it waited for.
"""

import contextlib
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeVar

from scaraspec.client.base import (
    CLOSED_LOCALLY,
    LINK_LOST_REASONS,
    NOT_CONNECTED,
    ClientBase,
    PendingBase,
)
from scaraspec.client.core import ClientCore
from scaraspec.client.errors import ClientError, LinkLost, Refused
from scaraspec.client.operations import Call, Text
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.transfer import FileTransfer
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.transports.connect import CONNECT_TIMEOUT_S, connect
from scaraspec.transports.link import Ending, Link, LinkError
from scaraspec.transports.url import Tcp, parse

T = TypeVar("T")

_LISTEN_S = 0.25  # for how long a listener may miss that another thread has closed the client


class Pending(PendingBase):
    """A two-stage command under way; made by the ``start_`` methods of a `Client`."""

    def __init__(self, client: "Client", operation: PendingOperation) -> None:
        super().__init__(operation)
        self._client = client

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the final result.

        Args:
            timeout_s: How long; without bound if None. While `get_status` says that the robot is
                running, waiting on is right (4/11).

        Raises:
            Refused: It was not accepted.
            Failed: It was not done; `Interrupted` if something ended it before its time.
            ReplyTimeout: No result within `timeout_s`; it may be waited for again.
            LinkLost: The link ended before.
            ProtocolError: The result makes no sense.
        """
        if not self._client.wait_for(lambda: self._operation.settled, timeout_s):
            raise self._no_result(timeout_s)
        self._operation.outcome()


class Client(ClientBase):
    """A client of one controller.

    ``with Client("tcp://192.168.1.2", password="password") as client:`` connects, logs in, and
    closes at the end. A client connects once; for another link make another client.

    Args:
        link: Where to connect, as a URL (``tcp://host[:8877]``, ``serial:///dev/rfcomm0``,
            ``rfcomm://AA:BB:CC:DD:EE:FF/1``), or an open link.
        password: What to log in with; None if `login` is called later, or not needed (L83).
        dialect: The readings to speak.
        connect_timeout_s: How long to wait for the connection.

    Raises:
        UrlError: The text is no URL of a link.
    """

    def __init__(
        self,
        link: str | Link,
        *,
        password: Text | None = None,
        dialect: Dialect = DEFAULT,
        connect_timeout_s: float = CONNECT_TIMEOUT_S,
    ) -> None:
        network = not isinstance(link, str) or isinstance(parse(link), Tcp)
        super().__init__(ClientCore(dialect, login_required=network))
        self._url = link if isinstance(link, str) else None
        self._open_link = None if isinstance(link, str) else link
        self._password = password
        self._connect_timeout_s = connect_timeout_s
        self._turn = threading.Condition(threading.Lock())
        self._listening = False
        self._closed = False

    def connect(self) -> None:
        """Open the link, and log in if there is a password; `with` does both.

        Raises:
            LinkLost: There is no connection to be had.
            LoginFailed: The controller refused the password; the link is closed again.
        """
        if self._open_link is None and self._url is not None:
            try:
                self._open_link = connect(self._url, self._connect_timeout_s)
            except LinkError as error:
                raise LinkLost(str(error)) from None
        if self._password is not None:
            try:
                self.login(self._password)
            except BaseException:
                self.close()
                raise

    def close(self) -> None:
        """Close the link; calls that wait end with `LinkLost`. Nothing if it is closed already."""
        with self._turn:
            if self._open_link is None or self._closed:
                return
            self._closed = True
            self._core.connection_lost(CLOSED_LOCALLY, self._open_link.now_s)
            if not self._listening:  # else the listener closes it, which alone may touch it now
                self._open_link.close()
            self._turn.notify_all()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def perform(self, call: Call[T]) -> T:
        """Carry out an operation to its end; used by its method."""
        operation = self._begin(call)
        try:
            while not operation.settled:
                self.wait_for(lambda: operation.settled or operation.has_progress)
                operation.report(call.progress)
        except BaseException:
            operation.abort()
            if isinstance(operation, FileTransfer):
                with contextlib.suppress(ClientError):
                    self.wait_for(lambda: operation.settled, self.dialect.seconds("reply_timeout"))
            raise
        return call.convert(operation.outcome())

    def start(self, call: Call[None]) -> Pending:
        """Carry out an operation up to its first reply; used by its ``start_`` method."""
        operation = self._begin(call)
        self.wait_for(lambda: operation.accepted is not None or operation.settled)
        if not operation.accepted and not isinstance(operation.error, Refused):
            operation.outcome()
        return Pending(self, operation)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Listen, or wait for a thread that listens, until something is so.

        Returns:
            Whether it is; False when `timeout_s` have passed without.
        """
        with self._turn:
            return self._wait_for(condition, timeout_s)

    @property
    def _link(self) -> Link:
        if self._open_link is None:
            raise LinkLost(NOT_CONNECTED)
        return self._open_link

    def _begin(self, call: Call[T]) -> PendingOperation:
        operation = call.prepare(self._core)
        with self._turn:
            self._wait_for(lambda: self._core.is_free(operation.slot), None)
            self._core.begin(operation, self._link.now_s)
            self._flush()
        return operation

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float | None) -> bool:
        """Do as `wait_for` does, in a thread that holds the turn."""
        limit_s = None if timeout_s is None else self._link.now_s + timeout_s
        while not condition():
            now_s = self._link.now_s
            if limit_s is not None and now_s >= limit_s:
                return False
            instants = (now_s + _LISTEN_S, self._core.deadline_s, limit_s)
            until_s = min(instant for instant in instants if instant is not None)
            if self._listening:
                self._turn.wait(max(0.0, until_s - now_s))
            else:
                self._listen(until_s)
        return True

    def _listen(self, until_s: float) -> None:
        """Give the core what arrives next, or the time; others have their turn meanwhile."""
        self._listening = True
        self._turn.release()
        try:
            arrival = self._link.receive(until_s)
        finally:
            self._turn.acquire()
            self._listening = False
            self._turn.notify_all()
            if self._closed:
                self._link.close()
        now_s = self._link.now_s
        if arrival is None:
            self._core.tick(now_s)
        elif isinstance(arrival.content, Ending):
            self._core.connection_lost(LINK_LOST_REASONS[arrival.content], now_s)
        else:
            self._core.feed(arrival.content, now_s)
        self._flush()

    def _flush(self) -> None:
        data = self._core.bytes_to_send()
        if not data:
            return
        try:
            self._link.send(data)
        except LinkError as error:
            self._core.connection_lost(str(error), self._link.now_s)
