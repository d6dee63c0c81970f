"""Faults of clause 4.17: an emergency stop that is held back, or confused with what it stops."""

from abc import ABC, abstractmethod
from typing import ClassVar, Final

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation, Stage, TwoStage
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_STOP: Final = "emergency_stop"
_OPCODE: Final = BY_NAME[_STOP].opcode


@mutant("stop-says-how", "4.17/1")
class StopSaysHow(AltersRequests):
    """The stop carries a 1."""

    name = _STOP

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"1"


@mutant("stop-names-the-program", "4.17/1", subtle=True)
class StopNamesTheProgram(AltersRequests):
    """The stop carries the name of the program that was run last, since it "stops programs"."""

    name = _STOP
    _ran = b""

    def _altered(self, frame: Frame) -> Frame:
        if frame.opcode == BY_NAME["run_program"].opcode:
            self._ran = frame.data
        return super()._altered(frame)

    def altered(self, data: bytes) -> bytes:
        """Name it."""
        return data + self._ran


@mutant("interrupted-result-ends-the-stop", "4.17/9", subtle=True)
class InterruptedResultEndsTheStop(ClientCore):
    """While a stop is carried out any result is taken for its own."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged and self._executing(_STOP):
            frame = frame._replace(opcode=_OPCODE)
        return super()._dispatch(frame, now_s)


@mutant("stop-ends-all-well", "4.17/9", subtle=True)
class StopEndsAllWell(ClientCore):
    """The success of a stop is taken for that of what it stops."""

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        events = super()._after_step(operation, now_s)
        if operation.command.name == _STOP and operation.settled and operation.error is None:
            for other in self._executing():
                other.settle(None)
                events += super()._after_step(other, now_s)
        return events


@mutant("unasked-result-ends-the-link", "4.17/9", subtle=True)
class UnaskedResultEndsTheLink(ClientCore):
    """At a result that nobody here has asked for the client gives up the connection."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged and not any(e.command.opcode == frame.opcode for e in self._executing()):
            return self.connection_lost("an unasked result", now_s)
        return super()._dispatch(frame, now_s)


class _VainStopEndsEverything(ClientCore):
    """What goes on when a stop was not made is taken for stopped."""

    accepted: ClassVar[bool]
    """Whether the stop had been accepted."""

    def _after_two_stage_step(self, operation: TwoStage, now_s: float) -> list[Event]:
        events = super()._after_two_stage_step(operation, now_s)
        vain = operation.command.name == _STOP and operation.error is not None
        if vain and operation.accepted is self.accepted:
            for other in self._executing():
                other.interrupt("there was a stop")
                events += self._after_step(other, now_s)
        return events


@mutant("failed-stop-ends-everything", "4.17/9", subtle=True)
class FailedStopEndsEverything(_VainStopEndsEverything):
    """What goes on when a stop has failed is taken for stopped."""

    accepted = True


@mutant("refused-stop-ends-everything", "4.17/9", subtle=True)
class RefusedStopEndsEverything(_VainStopEndsEverything):
    """What goes on when a stop was refused is taken for stopped."""

    accepted = False


@mutant("stop-waits-for-what-it-stops", "4.17/9", subtle=True)
class StopWaitsForWhatItStops(ClientCore):
    """The success of a stop counts only when what it stops has told a result of its own."""

    _kept: Frame | None = None

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        stopped = any(e.command.name != _STOP for e in self._executing())
        if frame.tagged and frame.opcode == _OPCODE and stopped:
            self._kept = frame
            return []
        events = super()._dispatch(frame, now_s)
        if frame.tagged and self._kept:
            events += super()._dispatch(self._kept, now_s)
        return events


class _HoldsTheStop(ClientCore, ABC):
    """The stop is not sent while certain other things are open."""

    @abstractmethod
    def hinders(self, operation: PendingOperation) -> bool:
        """Whether it waits for that."""

    def is_free(self, slot: str) -> bool:
        """Wait."""
        return super().is_free(slot) and not (slot == _STOP and any(map(self.hinders, self._open)))


@mutant("queries-hold-the-stop", "4.17/10")
class QueriesHoldTheStop(_HoldsTheStop):
    """The stop waits for the reply to a query."""

    def hinders(self, operation: PendingOperation) -> bool:
        """Wait for queries."""
        return not isinstance(operation, TwoStage)


@mutant("orders-hold-the-stop", "4.17/10", subtle=True)
class OrdersHoldTheStop(_HoldsTheStop):
    """The stop waits for the first reply to another order."""

    def hinders(self, operation: PendingOperation) -> bool:
        """Wait for first replies."""
        return isinstance(operation, TwoStage) and operation.stage is Stage.REQUESTED


@mutant("execution-holds-the-stop", "4.17/10", subtle=True)
class ExecutionHoldsTheStop(_HoldsTheStop):
    """The stop waits until what executes has ended by itself."""

    def hinders(self, operation: PendingOperation) -> bool:
        """Wait for final results."""
        return isinstance(operation, TwoStage) and operation.stage is Stage.EXECUTING


@mutant("remembers-the-stop", "4.17/9", subtle=True)
class RemembersTheStop(ClientCore):
    """Behind a stop whatever takes more than a quarter of a second is told as stopped."""

    _stopped = False
    _accepted_s = 0.0
    _patience_s = 0.25

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if not frame.tagged:
            self._accepted_s = now_s
        elif frame.opcode == _OPCODE:
            self._stopped = True
        elif self._stopped and now_s - self._accepted_s > self._patience_s:
            frame = frame._replace(data=b"00|00")
        return super()._dispatch(frame, now_s)
