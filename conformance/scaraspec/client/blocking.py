"""The blocking client: `Client`, which several threads may use.

It connects the core to a link. It starts no thread: one of the waiting threads receives from the
link for all; when it has its reply, another waiting thread takes over.
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
from scaraspec.transports.url import parse
from scaraspec.user_message import sentence_of

T = TypeVar("T")

_LISTEN_S = (
    0.25  # time within which a receiving thread notices that another thread closed the client
)


class Pending(PendingBase):
    """A two-stage command in progress, returned by the ``start_`` methods of `Client`."""

    def __init__(self, client: "Client", operation: PendingOperation) -> None:
        super().__init__(operation)
        self._client = client

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the final result.

        Args:
            timeout_s: Timeout in seconds; None for no timeout. While `get_status` reports that
                the robot is running, continue to wait (4/11).

        Raises:
            Refused: The controller refused the command.
            Failed: The command failed; `Interrupted` if it was interrupted.
            ReplyTimeout: No result within `timeout_s`. `wait` may be called again.
            LinkLost: The link ended before the result.
            ProtocolError: The result cannot be decoded.
        """
        if not self._client.wait_for(lambda: self._operation.settled, timeout_s):
            raise self._no_result(timeout_s)
        self._operation.outcome()


class Client(ClientBase):
    """A blocking client of one controller.

    ``with Client("tcp://192.168.1.2", password="password") as client:`` connects, logs in, and
    closes the link at the end. A client connects once; create a new client for another link.

    Args:
        link: URL (``tcp://host[:8877]``, ``serial:///dev/rfcomm0``,
            ``rfcomm://AA:BB:CC:DD:EE:FF/1``), or an open link.
        password: Password for the login; None to call `login` later, or for a link that needs no
            login (L83).
        dialect: The readings to use.
        connect_timeout_s: Timeout of the connection in seconds.

    Raises:
        UrlError: `link` is not a valid link URL.
    """

    def __init__(
        self,
        link: str | Link,
        *,
        password: Text | None = None,
        dialect: Dialect = DEFAULT,
        connect_timeout_s: float = CONNECT_TIMEOUT_S,
    ) -> None:
        needs_login = not isinstance(link, str) or parse(link).needs_login
        super().__init__(ClientCore(dialect, login_required=needs_login))
        self._url = link if isinstance(link, str) else None
        self._open_link = None if isinstance(link, str) else link
        self._password = password
        self._connect_timeout_s = connect_timeout_s
        self._condition = threading.Condition(threading.Lock())
        self._listening = False
        self._closed = False

    def connect(self) -> None:
        """Open the link, and log in if a password is set. A ``with`` statement calls it.

        Raises:
            LinkLost: The connection cannot be established.
            LoginFailed: The controller refused the password. The link is closed again.
        """
        if self._open_link is None and self._url is not None:
            try:
                self._open_link = connect(self._url, self._connect_timeout_s)
            except LinkError as error:
                raise LinkLost(sentence_of(error)) from None
        if self._password is not None:
            try:
                self.login(self._password)
            except BaseException:
                self.close()
                raise

    def close(self) -> None:
        """Close the link. Waiting calls raise `LinkLost`. Closing twice has no effect."""
        with self._condition:
            if self._open_link is None or self._closed:
                return
            self._closed = True
            self._core.connection_lost(CLOSED_LOCALLY, self._open_link.now_s)
            if not self._listening:  # otherwise the receiving thread owns the link and closes it
                self._open_link.close()
            self._condition.notify_all()

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
        """Perform an operation and return its result. The methods of the operations call it."""
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
        """Perform an operation up to its first reply. The ``start_`` methods call it."""
        operation = self._begin(call)
        self.wait_for(lambda: operation.accepted is not None or operation.settled)
        if not operation.accepted and not isinstance(operation.error, Refused):
            operation.outcome()
        return Pending(self, operation)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Receive, or wait for the thread that receives, until `condition()` is true.

        Returns:
            True if the condition is met; False after `timeout_s` seconds.
        """
        with self._condition:
            return self._wait_for(condition, timeout_s)

    @property
    def _link(self) -> Link:
        if self._open_link is None:
            raise LinkLost(NOT_CONNECTED)
        return self._open_link

    def _begin(self, call: Call[T]) -> PendingOperation:
        operation = call.prepare(self._core)
        with self._condition:
            self._wait_for(lambda: self._core.is_free(operation.slot), None)
            self._core.begin(operation, self._link.now_s)
            self._flush()
        return operation

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float | None) -> bool:
        """Do the same as `wait_for`, with the lock held."""
        limit_s = None if timeout_s is None else self._link.now_s + timeout_s
        while not condition():
            now_s = self._link.now_s
            if limit_s is not None and now_s >= limit_s:
                return False
            deadlines_s = (now_s + _LISTEN_S, self._core.deadline_s, limit_s)
            until_s = min(each_s for each_s in deadlines_s if each_s is not None)
            if self._listening:
                self._condition.wait(max(0.0, until_s - now_s))
            else:
                self._listen(until_s)
        return True

    def _listen(self, until_s: float) -> None:
        """Pass the next bytes, or the time, to the core. The lock is released while it waits."""
        self._listening = True
        self._condition.release()
        try:
            arrival = self._link.receive(until_s)
        finally:
            self._condition.acquire()
            self._listening = False
            self._condition.notify_all()
            if self._closed:
                self._link.close()
        now_s = self._link.now_s
        if arrival is None:
            self._core.tick(now_s)
        elif isinstance(arrival.content, Ending):
            self._core.connection_lost(LINK_LOST_REASONS[arrival.content], now_s)
        else:
            self._core.feed(arrival.content, now_s)
            self._core.tick(now_s)  # received bytes do not extend a timeout
        self._flush()
        if self._core.must_close and not self._closed:
            self._closed = True
            self._link.close()

    def _flush(self) -> None:
        data = self._core.bytes_to_send()
        if not data:
            return
        try:
            self._link.send(data)
        except LinkError as error:
            self._core.connection_lost(sentence_of(error), self._link.now_s)
