"""Operators that change connections: received bytes, crashes, and frames that are sent later."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from scaraspec.protocol.frames import Frame, Skipped, StreamItem
from scaraspec.protocol.readings import Dialect
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Close, Session

Core = type[ControllerCore]


def received_bytes(change: Callable[[bytes], bytes]) -> Core:
    """The bytes that arrive together are changed."""

    class ReceivedBytes(ControllerCore):
        def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
            return super().receive(connection, change(data), now_s)

    return ReceivedBytes


def with_framer(make: Callable[[Dialect], RequestFramer]) -> Core:
    """Sessions use another request framer."""

    class OtherFramer(ControllerCore):
        def _add_session(self, connection: int, carrier: Carrier) -> None:
            super()._add_session(connection, carrier)
            self.sessions[connection].framer = make(self.dialect)

    return OtherFramer


def finds(receive: Callable[[RequestFramer, bytes, float], list[StreamItem]]) -> Core:
    """`receive` replaces the method of the request framer of each session."""
    return with_framer(type("Finds", (RequestFramer,), {"receive": receive}))


class Crashes(ControllerCore):
    """Base class: `crash` closes all connections; later ones are closed at once."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.crashed = False

    def crash(self, now_s: float) -> None:
        """Close all connections and accept no new one."""
        self.crashed = True
        for session in list(self.sessions.values()):
            self._end(session, now_s)

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        return [Close(connection)] if self.crashed else super().open(connection, now_s, link)


class HandlesSkipped(Crashes, ABC):
    """Base class: calls `skipped` for bytes that are no frame."""

    @abstractmethod
    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:
        """Called with each run of skipped bytes."""

    def _process_items(self, session: Session, found: list[StreamItem], now_s: float) -> None:
        for item in found:
            if isinstance(item, Skipped) and session.connection in self.sessions:
                self.skipped(session, item, now_s)
        super()._process_items(session, found, now_s)


def on_skipped(skipped: Callable[[Crashes, Session, Skipped, float], None]) -> Core:
    """`skipped` is called with each run of bytes that are no frame."""
    return type("OnSkipped", (HandlesSkipped,), {"skipped": skipped})


def crashes_on_skipped(when: Callable[[Skipped], bool]) -> Core:
    """The controller crashes on bytes that are no frame, if the condition holds."""
    return on_skipped(lambda core, _session, item, now_s: core.crash(now_s) if when(item) else None)


def crashes_on_bytes(when: Callable[[bytes], bool]) -> Core:
    """The controller crashes when the bytes that arrive together fulfil a condition."""

    class CrashesOnBytes(Crashes):
        def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
            if when(data):
                self.crash(now_s)
            return super().receive(connection, data, now_s)

    return CrashesOnBytes


class SendsLater(ControllerCore):
    """Sends frames some time after the current request."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.now_s = 0.0
        self._due: list[tuple[float, Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self.now_s = now_s
        super().handle(session, frame, now_s)

    def send_later(self, delay_s: float, session: Session, frame: Frame) -> None:
        """Send a frame after a time, if its client is still connected."""
        self._due.append((self.now_s + delay_s, session, frame))

    @property
    def next_event_s(self) -> float | None:
        times_s = [time_s for time_s, _, _ in self._due]
        other_s = super().next_event_s
        return min(times_s if other_s is None else [*times_s, other_s], default=None)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        due = [entry for entry in self._due if entry[0] <= now_s]
        self._due = [entry for entry in self._due if entry[0] > now_s]
        for _, session, frame in due:
            ControllerCore.emit(self, session, frame)
