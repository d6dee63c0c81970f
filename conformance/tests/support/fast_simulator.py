"""A virtual controller whose clock is faster than that of the suite."""

from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Carrier


class FastSimulator(ControllerCore):
    """A simulator whose clock runs eight times as fast."""

    SCALE = 8

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        return super().open(connection, now_s * self.SCALE, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        return super().receive(connection, data, now_s * self.SCALE)

    def close(self, connection: int, now_s: float) -> list[Action]:
        return super().close(connection, now_s * self.SCALE)

    def advance(self, now_s: float) -> list[Action]:
        return super().advance(now_s * self.SCALE)

    @property
    def next_event_s(self) -> float | None:
        event_s = super().next_event_s
        return None if event_s is None else event_s / self.SCALE
