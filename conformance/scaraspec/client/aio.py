"""The asyncio shell: an `AsyncClient` that may be used from several tasks of one loop.

Here the core meets an asyncio transport and the loop's clock.
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
    """A two-stage command under way; made by the ``start_`` methods of an `AsyncClient`."""

    def __init__(self, client: "AsyncClient", operation: PendingOperation) -> None:
        super().__init__(operation)
        self._client = client

    async def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the final result, as `Pending.wait` does."""
        if not await self._client.wait_for(lambda: self._operation.settled, timeout_s):
            raise self._no_result(timeout_s)
        self._operation.outcome()


class AsyncClient(ClientBase):
    """A client of one controller on the network, for asyncio.

    ``async with AsyncClient("tcp://192.168.1.2", password="password") as client:`` connects, logs
    in, and closes at the end. For serial lines and Bluetooth use `Client`, in a thread.

    Args:
        url: Where to connect, ``tcp://host[:8877]``.
        password: What to log in with; None if `login` is called later.
        dialect: The readings to speak.
        connect_timeout_s: How long to wait for the connection.

    Raises:
        UrlError: The text is no such URL.
    """

    core: ClassVar[type[ClientCore]] = ClientCore
    """What is inside; a client that is wrong on purpose has another one."""

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
                UserMessage("{url} is no network link: use Client, in a thread", url=url)
            )
        self._address = address
        self._password = password
        self._connect_timeout_s = connect_timeout_s
        self._transport: asyncio.Transport | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._waiters: set[asyncio.Future[None]] = set()

    async def connect(self) -> None:
        """Open the link, and log in if there is a password; `async with` does both.

        Raises:
            LinkLost: There is no connection to be had.
            LoginFailed: The controller refused the password; the link is closed again.
        """
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(self._connect_timeout_s):
                self._transport, _ = await loop.create_connection(
                    lambda: _Wire(self._data_received, self._connection_lost), *self._address
                )
        except (OSError, UnicodeError) as error:
            if isinstance(error, TimeoutError):
                why: str = UserMessage(
                    "no answer in {connect_timeout_s:g} s",
                    connect_timeout_s=self._connect_timeout_s,
                )
            else:
                why = getattr(error, "strerror", None) or "there is no such host"
            raise LinkLost(f"cannot connect to {self._address}: {why}") from None
        await self._login()

    async def close(self) -> None:
        """Close the link; calls that wait end with `LinkLost`."""
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
        """Carry out an operation to its end; used by its method."""
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
        """Carry out an operation up to its first reply; used by its ``start_`` method."""
        operation = await self._begin(call)
        await self.wait_for(lambda: operation.accepted is not None or operation.settled)
        if not operation.accepted and not isinstance(operation.error, Refused):
            operation.outcome()
        return AsyncPending(self, operation)

    async def wait_for(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Wait until something is so.

        Returns:
            Whether it is; False when `timeout_s` have passed without.
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

    def _tick(self, due_s: float) -> None:
        self._core.tick(max(due_s, _now_s()))  # alarms may come early by the clock's resolution
        self._update()

    def _update(self) -> None:
        """The core has moved: send what it wants sent, set its alarm, wake who waits."""
        if self._transport is not None:
            self._transport.write(self._core.bytes_to_send())
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._core.deadline_s is not None:
            loop = asyncio.get_running_loop()
            due_s = self._core.deadline_s
            self._timer = loop.call_at(due_s, self._tick, due_s)
        waiters, self._waiters = self._waiters, set()
        for waiter in waiters:
            if not waiter.done():
                waiter.set_result(None)


class _Wire(asyncio.Protocol):
    """Where asyncio brings the bytes."""

    def __init__(
        self, hear: Callable[[bytes], None], connection_lost: Callable[[str], None]
    ) -> None:
        self._data_received = hear
        self._connection_lost = connection_lost

    def data_received(self, data: bytes) -> None:
        """Tell what has arrived."""
        self._data_received(data)

    def connection_lost(self, error: Exception | None) -> None:
        """Tell that the link has ended."""
        self._connection_lost(LINK_LOST_REASONS[Ending.RESET if error else Ending.CLOSED])


def _now_s() -> float:
    return asyncio.get_running_loop().time()
