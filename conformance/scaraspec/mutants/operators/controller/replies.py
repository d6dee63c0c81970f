"""What faulty controllers of clause 4 have in common: they answer or read one command otherwise.

No fault stands here.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session


class AltersReplies(ControllerCore, ABC):
    """The first replies to one command hold something else."""

    opcode: ClassVar[int]

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is sent in place of this data."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send something else."""
        if frame.opcode == self.opcode and not frame.tagged:
            frame = frame._replace(data=self.altered(frame.data))
        super().emit(session, frame)


class AltersLengths(ControllerCore, ABC):
    """The replies to one command have a length byte that does not count their data."""

    opcode: ClassVar[int]

    @abstractmethod
    def length(self, size_bytes: int) -> int:
        """The length byte of so much data."""

    def transmit(self, session: Session, data: bytes) -> None:
        """Put another length in."""
        if data[1] == self.opcode:
            data = data[:2] + bytes((self.length(data[2]) % 256,)) + data[3:]
        super().transmit(session, data)


class Mends(ControllerCore, ABC):
    """The requests of one command are read as if they were better than they are."""

    command: ClassVar[str]

    @abstractmethod
    def mended(self, data: bytes) -> bytes:
        """What is read in place of this data."""

    def _value(self, command: Command, frame: Frame) -> Any:
        if command.name == self.command:
            frame = frame._replace(data=self.mended(frame.data))
        return super()._value(command, frame)
