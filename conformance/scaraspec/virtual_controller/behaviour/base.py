"""Base class of the behaviour: the robot, the store, and the frames after the first reply."""

from collections.abc import Iterable
from dataclasses import replace
from enum import Enum
from typing import Any, Final

from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.readings import Dialect
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.robot import Robot
from scaraspec.virtual_controller.session import Request, Session
from scaraspec.virtual_controller.store import Store, StoreError

NAME_MAX_BYTES: Final = 244
"""The maximum frame data of 255 bytes (A-5-20), minus the other bytes of the 0x0A reply (L226)."""


MAX_COORDINATE: Final = 1e6
"""Limit of the absolute value of a coordinate, in mm or degrees."""


class Silence(Enum):
    """The return value of a method that sends no first reply."""

    SILENCE = "silence"


SILENCE: Final = Silence.SILENCE
ACCEPTED: Final = Acceptance(accepted=True)


def refused(code: str) -> Acceptance:
    """Return a first reply that refuses the command with a code of table 8-1."""
    return Acceptance(accepted=False, code=code)


def are_coordinates(values: Iterable[float]) -> bool:
    """Whether all values are within the limit of coordinates."""
    return all(abs(value) <= MAX_COORDINATE for value in values)


class Base:
    """One robot and its clients.

    Attributes:
        dialect: One reading of every open point.
        store: Programs and settings.
        robot: The plant and its current task.
        sessions: The sessions by connection number.
        powered: Whether the robot is on; 0x60 shuts it down.
    """

    def __init__(self, plant: Plant, store: Store, dialect: Dialect) -> None:
        self.dialect = dialect
        self.store = store
        self.robot = Robot(plant)
        self.sessions: dict[int, Session] = {}
        self.powered = True
        self._deferred: list[tuple[Session, Frame]] = []

    @property
    def plant(self) -> Plant:
        """The simulated hardware of the robot."""
        return self.robot.plant

    def send_after_reply(self, session: Session, frame: Frame) -> None:
        """Send a frame after the current first reply."""
        self._deferred.append((session, frame))

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Send a final result after the current first reply."""
        assert request.command.result is not None, "only two-stage commands have a final result"
        data = request.command.result.encode(outcome, self.dialect)
        self.send_after_reply(request.session, Frame(C2A, request.frame.opcode, data, tagged=True))

    def save(self, **changes: Any) -> bool:
        """Change settings and return whether they were stored."""
        if self.plant.disk_full:
            return False
        try:
            self.store.save(replace(self.store.settings, **changes))
        except StoreError:
            return False
        return True

    def remove(self, name: bytes) -> bool:
        """Delete a stored file and return whether it existed and was deleted."""
        try:
            self.store.delete(name)
        except StoreError:
            return False
        return True

    def is_program(self, name: bytes) -> bool:
        """Whether a program with this name is stored, and its name fits in every reply."""
        return (
            name in self.store and len(name) <= NAME_MAX_BYTES and self.has_program_extension(name)
        )

    def has_program_extension(self, name: bytes) -> bool:
        """Whether the reading of ``prog_ext`` allows this program name (A-0-9)."""
        extension = self.dialect["prog_ext"]
        return extension == "any" or name.endswith(extension.encode())

    def is_text(self, data: bytes) -> bool:
        """Whether these bytes are valid text with the reading of ``text_encoding`` (A-T-2)."""
        encoding = self.dialect["text_encoding"]
        try:
            return encoding == "bytes" or data.decode(encoding) is not None
        except UnicodeDecodeError:
            return False

    def accepts_thetas(self, theta_y: float, theta_z: float) -> bool:
        """Whether thetaY and thetaZ, which have no meaning, may have these values (A-4.21-3)."""
        return self.dialect["theta_yz"] != "reject" or theta_y == theta_z == 0
