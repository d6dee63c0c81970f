"""Base: what the methods of all commands share: the robot, its store, and what goes out later."""

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
"""255 (A-5-20) less what surrounds a name in its longest reply, ``1|name|DDHHMMSS`` (L226)."""


MAX_COORDINATE: Final = 1e6
"""mm or degrees; what lies beyond is no coordinate."""


class Silence(Enum):
    """What a method returns where nothing is to be answered."""

    SILENCE = "silence"


SILENCE: Final = Silence.SILENCE
ACCEPTED: Final = Acceptance(accepted=True)


def refused(code: str) -> Acceptance:
    """A refusing first reply, with its reason from table 8-1."""
    return Acceptance(accepted=False, code=code)


def are_coordinates(values: Iterable[float]) -> bool:
    """Whether these numbers can be coordinates at all."""
    return all(abs(value) <= MAX_COORDINATE for value in values)


class Base:
    """One robot and its clients.

    Attributes:
        dialect: One reading of every open point.
        store: Programs and settings.
        robot: The plant and what it is doing.
        sessions: The clients, by connection.
        powered: Whether the robot is on; 0x60 switches it off.
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
        """The robot's physical side."""
        return self.robot.plant

    def later(self, session: Session, frame: Frame) -> None:
        """Send a frame after the first reply that is being made."""
        self._deferred.append((session, frame))

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Send a final result, later."""
        assert request.command.result is not None, "only two-stage commands have a final result"
        data = request.command.result.encode(outcome, self.dialect)
        self.later(request.session, Frame(C2A, request.frame.opcode, data, tagged=True))

    def save(self, **changes: Any) -> bool:
        """Change settings; whether that could be stored."""
        if self.plant.disk_full:
            return False
        try:
            self.store.save(replace(self.store.settings, **changes))
        except StoreError:
            return False
        return True

    def remove(self, name: bytes) -> bool:
        """Delete a stored file; whether there was one and it is gone."""
        try:
            self.store.delete(name)
        except StoreError:
            return False
        return True

    def is_program(self, name: bytes) -> bool:
        """Whether a program of this name is stored, and can be named in every reply."""
        return (
            name in self.store and len(name) <= NAME_MAX_BYTES and self.has_program_extension(name)
        )

    def has_program_extension(self, name: bytes) -> bool:
        """Whether the reading of ``prog_ext`` lets this be a program's name (A-0-9)."""
        extension = self.dialect["prog_ext"]
        return extension == "any" or name.endswith(extension.encode())

    def is_text(self, data: bytes) -> bool:
        """Whether the reading of ``text_encoding`` lets these bytes be text (A-T-2)."""
        encoding = self.dialect["text_encoding"]
        try:
            return encoding == "bytes" or data.decode(encoding) is not None
        except UnicodeDecodeError:
            return False

    def accepts_thetas(self, theta_y: float, theta_z: float) -> bool:
        """Whether thetaY and thetaZ, which mean nothing, may have these values (A-4.21-3)."""
        return self.dialect["theta_yz"] != "reject" or theta_y == theta_z == 0
