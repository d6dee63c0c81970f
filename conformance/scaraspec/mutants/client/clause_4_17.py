"""Mutants of clause 4.17: the emergency stop."""

from collections.abc import Callable
from typing import Final

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation, Stage, TwoStage
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import received_while
from scaraspec.mutants.operators.client.messages import request_after, request_data
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_STOP: Final = "emergency_stop"
_OPCODE: Final = BY_NAME[_STOP].opcode


def _executes(operation: PendingOperation) -> bool:
    return isinstance(operation, TwoStage) and operation.stage is Stage.EXECUTING


def _as_result_of_stop(frame: Frame, pending: list[PendingOperation]) -> Frame:
    stopping = any(_executes(each) and each.command.name == _STOP for each in pending)
    return frame._replace(opcode=_OPCODE) if frame.tagged and stopping else frame


row(
    "stop-says-how",
    "4.17/1",
    "The stop request contains a 1.",
    request_data(_STOP, lambda data: data + b"1"),
)
row(
    "stop-names-the-program",
    "4.17/1",
    "The stop request contains the name of the program that was run last.",
    request_after(_STOP, "run_program", lambda data, last: data + last),
    subtle=True,
)
row(
    "interrupted-result-ends-the-stop",
    "4.17/9",
    "While a stop executes, any final result is taken as its result.",
    received_while(_as_result_of_stop),
    subtle=True,
)


@mutant("stop-ends-all-well", "4.17/9", subtle=True)
class StopCompletesCommands(ClientCore):
    """After a successful stop, the stopped commands are reported as done."""

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        events = super()._after_step(operation, now_s)
        if operation.command.name == _STOP and operation.settled and operation.error is None:
            for other in self._executing():
                other.settle(None)
                events += super()._after_step(other, now_s)
        return events


@mutant("unasked-result-ends-the-link", "4.17/9", subtle=True)
class DisconnectsOnUnexpectedResult(ClientCore):
    """An unexpected final result ends the connection."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged and not any(e.command.opcode == frame.opcode for e in self._executing()):
            return self.connection_lost("an unexpected result", now_s)
        return super()._dispatch(frame, now_s)


def _unsuccessful_stop_interrupts(*, accepted: bool) -> type[ClientCore]:
    """Executing commands are interrupted after a stop that failed or was refused."""

    class UnsuccessfulStopInterrupts(ClientCore):
        def _after_two_stage_step(self, operation: TwoStage, now_s: float) -> list[Event]:
            events = super()._after_two_stage_step(operation, now_s)
            unsuccessful = operation.command.name == _STOP and operation.error is not None
            if unsuccessful and operation.accepted is accepted:
                for other in self._executing():
                    other.interrupt("there was a stop")
                    events += self._after_step(other, now_s)
            return events

    return UnsuccessfulStopInterrupts


row(
    "failed-stop-ends-everything",
    "4.17/9",
    "After a failed stop, executing commands are reported as interrupted.",
    _unsuccessful_stop_interrupts(accepted=True),
    subtle=True,
)
row(
    "refused-stop-ends-everything",
    "4.17/9",
    "After a refused stop, executing commands are reported as interrupted.",
    _unsuccessful_stop_interrupts(accepted=False),
    subtle=True,
)


@mutant("stop-waits-for-what-it-stops", "4.17/9", subtle=True)
class DelaysResultOfStop(ClientCore):
    """The result of a stop is processed only after the result of a stopped command."""

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


def _stop_waits_for(condition: Callable[[PendingOperation], bool]) -> type[ClientCore]:
    """The stop is not sent while an operation that satisfies the condition is pending."""

    class StopWaitsFor(ClientCore):
        def is_free(self, slot: str) -> bool:
            return super().is_free(slot) and not (slot == _STOP and any(map(condition, self._open)))

    return StopWaitsFor


row(
    "queries-hold-the-stop",
    "4.17/10",
    "The stop is not sent before the reply to a query.",
    _stop_waits_for(lambda operation: not isinstance(operation, TwoStage)),
)
row(
    "orders-hold-the-stop",
    "4.17/10",
    "The stop is not sent before the first reply to another two-stage command.",
    _stop_waits_for(
        lambda operation: isinstance(operation, TwoStage) and operation.stage is Stage.REQUESTED
    ),
    subtle=True,
)


@mutant("replies-hold-every-request", "4.17/10", subtle=True)
class OneRequestAtATime(ClientCore):
    """No request, not even the stop, is sent before the first reply to the previous one."""

    def is_free(self, _slot: str) -> bool:
        return all(operation.stage is not Stage.REQUESTED for operation in self._open)


row(
    "settings-hold-the-stop",
    "4.17/10",
    "The stop is not sent before the reply to a setting.",
    _stop_waits_for(lambda operation: operation.command.name.startswith("set_")),
    subtle=True,
)
row(
    "execution-holds-the-stop",
    "4.17/10",
    "The stop is not sent before the final result of an executing command.",
    _stop_waits_for(_executes),
    subtle=True,
)


@mutant("remembers-the-stop", "4.17/9", subtle=True)
class RemembersStop(ClientCore):
    """After a stop, a command that takes more than a quarter of a second is always interrupted."""

    _stopped = False
    _accepted_s = 0.0

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if not frame.tagged:
            self._accepted_s = now_s
        elif frame.opcode == _OPCODE:
            self._stopped = True
        elif self._stopped and now_s - self._accepted_s > 0.25:
            frame = frame._replace(data=b"00|00")
        return super()._dispatch(frame, now_s)
