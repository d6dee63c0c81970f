"""What faults share: frames that are spoilt on their way out, and clients that hear no more."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import ClassVar

from scaraspec.client.core import ClientCore, Event
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame


class SpoilsFrames(ClientCore, ABC):
    """The frame of one request is not what it should be."""

    name: ClassVar[str]
    """The command in question."""

    @abstractmethod
    def spoiled(self, frame: bytes) -> bytes:
        """What is sent in place of the frame."""

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            meant = frame.opcode == BY_NAME[self.name].opcode
            self._outbox += self.spoiled(frame.encode()) if meant else frame.encode()


class GoesDeaf(ClientCore):
    """From some moment on nothing is heard on this connection."""

    deaf = False

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Hear it, or not."""
        return [] if self.deaf else super().feed(data, now_s)
