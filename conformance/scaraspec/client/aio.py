"""The asyncio client: `AsyncClient`, which several tasks of one event loop may use.

It connects the core to an asyncio transport and to the clock of the event loop.
"""

import asyncio
from collections.abc import Callable
from types import TracebackType
from typing import ClassVar, Self, TypeVar

from scaraspec.client.base import (
    CLOSED_LOCALLY,
    LINK_LOST_REASONS,
    NOT_CONNECTED,
    ClientBase,
    PendingBase,
)
from scaraspec.client.core import ClientCore
from scaraspec.client.errors import LinkLost, Refused
from scaraspec.client.operations import Call, Text
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.transports.connect import CONNECT_TIMEOUT_S
from scaraspec.transports.link import Ending
from scaraspec.transports.url import Tcp, UrlError, parse
from scaraspec.user_message import UserMessage

T = TypeVar("T")


class AsyncPending(PendingBase):
    """A two-stage command in progress, returned by the ``start_`` methods of `AsyncClient`."""

    def __init__(self, client: "AsyncClient", operation: PendingOperation) -> None:
        super().__init__(operation)
        self._client = client

    async def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the final result; arguments and exceptions as for `Pending.wait`."""
        if not await self._client.wait_for(lambda: self._operation.settled, timeout_s):
            raise self._no_result(timeout_s)
        self._operation.outcome()


class AsyncClient(ClientBase):
    """An asyncio client of one controller on the network.

    ``async with AsyncClient("tcp://192.168.1.2", password="password") as client:`` connects, logs
    in, and closes the link at the end. For serial lines and Bluetooth use `Client` in a thread.

    Args:
        url: ``tcp://host[:8877]``.
        password: Password for the login; None to call `login` later.
        dialect: The readings to use.
        connect_timeout_s: Timeout of the connection in seconds.

    Raises:
        UrlError: `url` is not a valid network link URL.
    """

    core: ClassVar[type[ClientCore]] = ClientCore
    """The class of the core; client mutants replace it."""

    def __init__(
        self,
        url: str,
        *,
        password: Text | None = None,
        dialect: Dialect = DEFAULT,
        connect_timeout_s: float = CONNECT_TIMEOUT_S,
    ) -> None:
        super().__init__(self.core(dialect))
        address = parse(url)
        if not isinstance(address, Tcp):
            raise UrlError(
                UserMessage("{url} is not a network link: use Client in a thread", url=url)
            )
        self._address = address
        self._password = password
        self._connect_timeout_s = connect_timeout_s
        self._transport: asyncio.Transport | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._waiters: set[asyncio.Future[None]] = set()

    async def connect(self) -> None:
        """Open the link, and log in if a password is set. An ``async with`` statement calls it.

        Raises:
            LinkLost: The connection cannot be established.
            LoginFailed: The controller refused the password. The link is closed again.
        """
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(self._connect_timeout_s):
                self._transport, _ = await loop.create_connection(
                    lambda: _Protocol(self._data_received, self._connection_lost), *self._address
                )
        except (OSError, UnicodeError) as error:
            if isinstance(error, TimeoutError):
                reason: str = UserMessage(
                    "no answer within {connect_timeout_s:g} s",
                    connect_timeout_s=self._connect_timeout_s,
                )
            else:
                reason = getattr(error, "strerror", None) or "the host is unknown"
            raise LinkLost(
                UserMessage(
                    "cannot connect to {address}: {reason}", address=self._address, reason=reason
                )
            ) from None
        await self._login()

    async def close(self) -> None:
        """Close the link. Waiting calls raise `LinkLost`."""
        self._connection_lost(CLOSED_LOCALLY)
        if self._transport is not None:
            self._transport.close()

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.close()

    async def perform(self, call: Call[T]) -> T:
        """Perform an operation and return its result. The methods of the operations call it."""
        operation = await self._begin(call)
        try:
            while not operation.settled:
                await self.wait_for(lambda: operation.settled or operation.has_progress)
                operation.report(call.progress)
        except BaseException:
            operation.abort()
            raise
        return call.convert(operation.outcome())

    async def start(self, call: Call[None]) -> AsyncPending:
        """Perform an operation up to its first reply. The ``start_`` methods call it."""
        operation = await self._begin(call)
        await self.wait_for(lambda: operation.accepted is not None or operation.settled)
        if not operation.accepted and not isinstance(operation.error, Refused):
            operation.outcome()
        return AsyncPending(self, operation)

    async def wait_for(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Wait until `condition()` is true.

        Returns:
            True if the condition is met; False after `timeout_s` seconds.
        """
        try:
            async with asyncio.timeout(timeout_s):
                while not condition():
                    waiter = asyncio.get_running_loop().create_future()
                    self._waiters.add(waiter)
                    await waiter
        except TimeoutError:
            return False
        return True

    async def _login(self) -> None:
        if self._password is None:
            return
        try:
            await self.login(self._password)
        except BaseException:
            await self.close()
            raise

    async def _begin(self, call: Call[T]) -> PendingOperation:
        if self._transport is None:
            raise LinkLost(NOT_CONNECTED)
        operation = call.prepare(self._core)
        await self.wait_for(lambda: self._core.is_free(operation.slot))
        self._core.begin(operation, _now_s())
        self._update()
        return operation

    def _data_received(self, data: bytes) -> None:
        self._core.feed(data, _now_s())
        self._update()

    def _connection_lost(self, reason: str) -> None:
        self._core.connection_lost(reason, _now_s())
        self._update()

    def _tick(self, deadline_s: float) -> None:
        self._core.tick(
            max(deadline_s, _now_s())
        )  # a timer may fire early by the clock's resolution
        self._update()

    def _update(self) -> None:
        """After a change of the core: send its bytes, set the timer, wake the waiting tasks."""
        if self._transport is not None:
            self._transport.write(self._core.bytes_to_send())
            if self._core.must_close:
                self._transport.close()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._core.deadline_s is not None:
            loop = asyncio.get_running_loop()
            deadline_s = self._core.deadline_s
            self._timer = loop.call_at(deadline_s, self._tick, deadline_s)
        waiters, self._waiters = self._waiters, set()
        for waiter in waiters:
            if not waiter.done():
                waiter.set_result(None)


class _Protocol(asyncio.Protocol):
    """The asyncio protocol: passes bytes and the end of the link to the client."""

    def __init__(
        self, data_received: Callable[[bytes], None], connection_lost: Callable[[str], None]
    ) -> None:
        self._data_received = data_received
        self._connection_lost = connection_lost

    def data_received(self, data: bytes) -> None:
        """Pass the received bytes on."""
        self._data_received(data)

    def connection_lost(self, error: Exception | None) -> None:
        """Report the end of the link."""
        self._connection_lost(LINK_LOST_REASONS[Ending.RESET if error else Ending.CLOSED])


def _now_s() -> float:
    return asyncio.get_running_loop().time()
