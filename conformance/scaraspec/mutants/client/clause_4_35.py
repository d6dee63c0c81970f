"""Faults of clause 4.35: the shutdown, and the loss of the link behind it."""

from typing import Any, Final

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation, TwoStage
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests, TakesLossForSuccess
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_OFF: Final = "shutdown"
_MOMENT_S: Final = 0.02


@mutant("shutdown-says-one", "4.35/1")
class ShutdownSaysOne(AltersRequests):
    """The shutdown carries a 1."""

    name = _OFF

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"1"


@mutant("shutdown-keeps-the-target", "4.35/1", subtle=True)
class ShutdownKeepsTheTarget(AltersRequests):
    """The shutdown carries the target of the last move, which was in the buffer before."""

    name = _OFF
    _target = b""

    def _altered(self, frame: Frame) -> Frame:
        if frame.opcode == BY_NAME["set_tool_coordinates"].opcode:
            self._target = frame.data
        return super()._altered(frame)

    def altered(self, data: bytes) -> bytes:
        """Do not empty it."""
        return data + self._target


class _OtherShutdown(ClientCore):
    """The shutdown is carried out otherwise."""

    shape: type[PendingOperation]

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Take the other way."""
        if name != _OFF:
            return super().command(name, value)
        return self.shape(BY_NAME[name], value, self.dialect)


class _SettlesLater(PendingOperation):
    """It is over a moment after its reply."""

    def _accept(self, value: None, now_s: float) -> list[Frame]:  # noqa: ARG002 - there is none
        self.deadline_s = now_s + _MOMENT_S
        return []

    def expire(self, now_s: float) -> list[Frame]:
        """The link has lived for that long."""
        if self.accepted:
            self.settle(None)
            return []
        return super().expire(now_s)


@mutant("shutdown-waits-for-results", "4.35/6")
class ShutdownWaitsForResults(_OtherShutdown):
    """The shutdown has not ended before a final result, which never comes."""

    shape = TwoStage


@mutant("shutdown-needs-time", "4.35/6", subtle=True)
class ShutdownNeedsTime(_OtherShutdown):
    """A link that is lost right behind the reply makes the shutdown an error."""

    shape = _SettlesLater


@mutant("lost-link-ends-all-well", "4.35/6", subtle=True)
class LostLinkEndsAllWell(ClientCore):
    """What is open when the link is lost behind a shutdown counts as done."""

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        """Take it for that."""
        events: list[Event] = []
        for operation in tuple(self._open) if self._expected_link_end == _OFF else ():
            operation.settle(None)
            events += self._after_step(operation, now_s)
        return events + super().connection_lost(reason, now_s)


@mutant("takes-loss-for-shutdown", "T/9", subtle=True)
class TakesLossForShutdown(TakesLossForSuccess):
    """A link that is lost before the shutdown was answered is taken for the shutdown itself."""

    name = _OFF
