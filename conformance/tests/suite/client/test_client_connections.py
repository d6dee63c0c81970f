"""Clients may connect, log in and disconnect in ways that the document leaves open."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from scaraspec.client import AsyncClient, ClientError
from scaraspec.client.driver import Driver
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Case

Certified = Callable[..., tuple[Case, ...]]
Defect = Callable[..., dict[str, str]]


class LogsInAgain(AsyncClient):
    """Logs in twice, and again after each failure (A-4.1-2)."""

    _again = False

    async def connect(self) -> None:
        await super().connect()
        await self.login("password")

    async def perform(self, call: Any) -> Any:
        try:
            return await super().perform(call)
        except ClientError:
            if self._core.logged_in and not self._again:
                self._again = True
                await super().login("password")
                self._again = False
            raise


def test_further_logins(wrong: Defect) -> None:
    """A client may log in again at any time."""
    assert not wrong(LogsInAgain, frozenset({"2/10", "3/33", "4.35/1"}))


class ConnectsOnce(Driver):
    """Refuses to connect before a disconnect."""

    async def _connect(self, *where: Any, **more: Any) -> None:
        if self._client:
            raise ClientError("it is connected already")
        await super()._connect(*where, **more)


class Tardy(Driver):
    """Reports every answer one second late."""

    def __init__(self, write: Any, make: Any) -> None:
        def late(answer: Any) -> None:
            asyncio.get_running_loop().call_later(1.0, write, answer)

        super().__init__(late, make)


class Threaded(Driver):
    """Starts the later of two operations first, as two threads may."""

    async def _do(self, number: Any, name: str, values: dict[str, Any]) -> None:
        await asyncio.sleep(1 / number)
        await super()._do(number, name, values)


@pytest.mark.parametrize("driver", [ConnectsOnce, Tardy, Threaded])
def test_drivers(wrong: Defect, driver: type[Driver]) -> None:
    """A driver may be slow, keep an ended connection, and start operations in any order."""
    only = frozenset({"2/1", "3/1", "3/19", "3/20", "3/25", "3/29", "4.35/6"})
    assert not wrong(AsyncClient, only, driver=driver)


class Returns(AsyncClient):
    """Reconnects once when the controller has ended the connection."""

    returning: asyncio.Task[None] | None = None
    _left = False

    async def close(self) -> None:
        self._left = True
        await super().close()

    def _connection_lost(self, reason: str) -> None:
        super()._connection_lost(reason)
        if not self._left and self.returning is None:
            self.returning = asyncio.get_running_loop().create_task(self._return())

    async def _return(self) -> None:
        self._core = self.core(self.dialect)
        with suppress(ClientError):
            await self.connect()


class WaitsForReturns(Driver):
    """Starts no operation while the client reconnects."""

    async def _do(self, number: Any, name: str, values: dict[str, Any]) -> None:
        if isinstance(self._client, Returns) and self._client.returning:
            await self._client.returning
        await super()._do(number, name, values)


def test_reconnecting_without_repeating(wrong: Defect) -> None:
    """A client may reconnect and log in by itself after a lost link."""
    assert not wrong(Returns, frozenset({"4/16"}))


def test_reconnecting(wrong: Defect) -> None:
    """A disconnect works while the client waits for the reply to a login of its own."""
    patient = DEFAULT.replace(reply_timeout="20")
    assert not wrong(Returns, frozenset({"2/1", "3/29", "4.8/11"}), patient, WaitsForReturns)


class HalfCloses(AsyncClient):
    """Closes only after the controller has closed its half of the connection."""

    async def close(self) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write_eof()
            await self.wait_for(self._transport.is_closing)
        await super().close()


def test_half_closing(wrong: Defect) -> None:
    """The suite closes a connection that the client has half-closed."""
    assert not wrong(HalfCloses, frozenset({"4.7/1", "4.8/11"}))


class LooksForAListener(AsyncClient):
    """Connects and disconnects once before the real connection."""

    async def connect(self) -> None:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_connection(asyncio.Protocol, *self._address)
        transport.close()
        await super().connect()


def test_looking_for_a_listener(wrong: Defect) -> None:
    """A connection without any byte is not the one of the connect operation."""
    assert not wrong(LooksForAListener, frozenset({"4.7/1", "4.8/11"}))


class StopsElsewhere(AsyncClient):
    """Uses a second connection for emergency stops (A-2-2)."""

    _at_once = False

    async def connect(self) -> None:
        self._elsewhere = AsyncClient(f"tcp://{':'.join(map(str, self._address))}")
        if self._at_once:
            await self._elsewhere.connect()
            await self._elsewhere.login("password")
        await super().connect()

    async def emergency_stop(self) -> None:
        async with self._elsewhere:
            await self._elsewhere.login("password")
            await self._elsewhere.emergency_stop()


class ConnectsTwice(StopsElsewhere):
    """Opens the second connection at the start."""

    _at_once = True


@pytest.mark.parametrize("make", [StopsElsewhere, ConnectsTwice])
def test_further_connections(certified: Certified, make: type[AsyncClient]) -> None:
    """Requests on a connection that the suite does not serve are inconclusive."""
    cases = certified(make, frozenset({"4.17/1", "4.17/2"}))
    assert {case.verdict for case in cases} == {Verdict.INCONCLUSIVE}
    assert all("(A-2-2)" in case.message for case in cases)
