"""Breaking: where faults of clauses 2 and 3 take hold: bytes in and out, death, and lateness.

No fault stands here.
"""

from abc import ABC, abstractmethod
from typing import Any

from scaraspec.protocol.frames import Frame, Skipped, StreamItem
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Close, Session


class OtherFramer(ControllerCore):
    """Sessions have another kind of inlet."""

    framer: type[RequestFramer] = RequestFramer

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        self.sessions[connection].framer = self.framer(self.dialect)


class Mortal(ControllerCore):
    """Can die: all clients are cut off, and nobody is taken any more."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.dead = False

    def die(self, now_s: float) -> None:
        """End every session."""
        self.dead = True
        for session in list(self.sessions.values()):
            self._end(session, now_s)

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Take nobody when dead."""
        return [Close(connection)] if self.dead else super().open(connection, now_s, link)


class Skips(Mortal, ABC):
    """Does something about bytes that are no frame."""

    @abstractmethod
    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:
        """What it does."""

    def _process_items(self, session: Session, found: list[StreamItem], now_s: float) -> None:
        for item in found:
            if isinstance(item, Skipped) and session.connection in self.sessions:
                self.skipped(session, item, now_s)
        super()._process_items(session, found, now_s)


class SendsLater(ControllerCore):
    """Sends frames when their time has come."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._due: list[tuple[float, Session, Frame]] = []

    def send_at(self, time_s: float, session: Session, frame: Frame) -> None:
        """Send a frame at this instant, if its client is still there."""
        self._due.append((time_s, session, frame))

    @property
    def next_event_s(self) -> float | None:
        """The sooner of what is due."""
        times_s = [time_s for time_s, _, _ in self._due]
        other_s = super().next_event_s
        return min(times_s if other_s is None else [*times_s, other_s], default=None)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        due = [entry for entry in self._due if entry[0] <= now_s]
        self._due = [entry for entry in self._due if entry[0] > now_s]
        for _, session, frame in due:
            ControllerCore.emit(self, session, frame)


class AltersBytes(ControllerCore, ABC):
    """Sends other bytes for a frame."""

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is sent in place of these bytes of a frame."""

    def transmit(self, session: Session, data: bytes) -> None:
        """Send something else."""
        super().transmit(session, self.altered(data))
