"""A connection of the tap that applies injected faults.

Bytes are recorded as received, before any fault. Each fault is a separate record after them
(`Kind.INJECTED`). A half-close is recorded when it is forwarded.
"""

import asyncio
import math
from collections.abc import Iterable
from typing import Final

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.fault_injection.injector import (
    Action,
    Forward,
    HalfClose,
    InjectionNote,
    Injector,
    ResetBoth,
)
from scaraspec_recorder.fault_injection.rules import Injection
from scaraspec_recorder.tap import tcp
from scaraspec_recorder.tap.tap import Connection, SocketEnd, Tap

HELD_BYTES: Final = 256 << 10
"""Bytes of a direction that may be delayed, plus one read, before its sender is paused."""


class _InjectedEnd(SocketEnd):
    """One socket of the connection. Received bytes go through the injector."""

    connection: "InjectedConnection"
    blocked = False  # the write buffer of this socket is full

    def data_received(self, data: bytes, time_ns: int = 0, kernel_time: bool = False) -> None:  # noqa: FBT001, FBT002 - as in `SocketEnd`
        if self.peer.transport:
            # The injector decides whether and when they are forwarded.
            passage = (time_ns or self._now_ns(), self.received_bytes, data, 0, kernel_time)
            self._append(Kind.BYTES, self.stream, *passage)
            self.received_bytes += len(data)
            self.connection.received(self, data)
        else:
            super().data_received(
                data, time_ns, kernel_time
            )  # delivered again after the connection is made

    def pause_writing(self) -> None:
        self.blocked = True
        super().pause_writing()

    def resume_writing(self) -> None:
        self.blocked = False
        super().resume_writing()

    def resume(self) -> None:
        if self.connection.has_room(self):
            super().resume()


class InjectedConnection(Connection):
    """A client's connection and its upstream connection, with injected faults.

    Args:
        injection: The rules.
        tap: The tap.
        number: Number of the connection, counted from 1.
    """

    end_type = _InjectedEnd
    client: _InjectedEnd
    upstream: _InjectedEnd

    def __init__(self, injection: Injection, tap: Tap, number: int) -> None:
        super().__init__(tap, number)
        self._injector = Injector(injection, number)
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None

    def received(self, end: SocketEnd, data: bytes) -> None:
        """Process received bytes, which are already recorded."""
        if not self._ended:
            self._do(self._injector.receive(self._direction(end), data, self._loop.time()))

    def has_room(self, end: SocketEnd) -> bool:
        """Whether more bytes may be read from this socket."""
        peer = self.upstream if end is self.client else self.client
        waiting_bytes = self._injector.queued_bytes(self._direction(end))
        return not self._ended and not peer.blocked and waiting_bytes <= HELD_BYTES

    def half_closed(self, end: SocketEnd) -> None:
        """Process a half-close; it is forwarded after the queued bytes."""
        self._do(self._injector.finish(self._direction(end), self._loop.time()))

    def _end(self, kind: Kind, end: SocketEnd, note: str) -> None:
        self._do(self._injector.flush())
        super()._end(kind, end, note)

    def _tick(self) -> None:
        self._do(self._injector.tick(self._loop.time()))

    def _do(self, actions: Iterable[Action]) -> None:
        for action in actions:
            end = self.client if action.direction is A2C else self.upstream
            match action:
                case InjectionNote(_, note):
                    self._record(Kind.INJECTED, end, note)
                case Forward(_, data):
                    transport = end.peer.transport
                    if transport and not transport.is_closing():
                        transport.write(data)
                case HalfClose():
                    super().half_closed(end)
                case ResetBoth():
                    self._cut(end)
        for each in self._ends:
            if self.has_room(each):
                each.resume()
            else:
                each.pause()
        self._set_timer()

    def _cut(self, end: SocketEnd) -> None:
        """Reset both sockets after forwarded bytes are sent."""
        self._end(Kind.RESET, end, "cut by an injected fault")
        for each in self._ends:
            if each.transport:
                tcp.reset_when_flushed(each.transport)

    def _set_timer(self) -> None:
        if self._timer:
            self._timer.cancel()
        next_s = self._injector.next_s
        self._timer = self._loop.call_at(next_s, self._tick) if next_s < math.inf else None

    def _direction(self, end: SocketEnd) -> Direction:
        return A2C if end is self.client else C2A
