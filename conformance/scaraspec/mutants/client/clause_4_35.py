"""Mutants of clause 4.35: the shutdown, and the end of the link after it."""

from typing import Final

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation, TwoStage
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.messages import (
    loss_is_success,
    operations,
    request_after,
    request_data,
)
from scaraspec.protocol.frames import Frame

_OFF: Final = "shutdown"


class _SettlesLater(PendingOperation):
    def _accept(self, value: None, now_s: float) -> list[Frame]:  # noqa: ARG002 - there is none
        self.deadline_s = now_s + 0.02
        return []

    def expire(self, now_s: float) -> list[Frame]:
        if self.accepted:
            self.settle(None)
            return []
        return super().expire(now_s)


row(
    "shutdown-says-one",
    "4.35/1",
    "The shutdown request contains a 1.",
    request_data(_OFF, lambda data: data + b"1"),
)
row(
    "shutdown-keeps-the-target",
    "4.35/1",
    "The shutdown request contains the target of the last move.",
    request_after(_OFF, "set_tool_coordinates", lambda data, last: data + last),
    subtle=True,
)
row(
    "shutdown-waits-for-results",
    "4.35/6",
    "The shutdown waits for a final result.",
    operations(TwoStage, _OFF),
)
row(
    "shutdown-needs-time",
    "4.35/6",
    "If the link is lost within 20 ms after the reply, the shutdown is reported as an error.",
    operations(_SettlesLater, _OFF),
    subtle=True,
)


@mutant("lost-link-ends-all-well", "4.35/6", subtle=True)
class CompletesCommandsAfterShutdown(ClientCore):
    """If the link is lost after a shutdown, all pending commands are reported as done."""

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        events: list[Event] = []
        for operation in tuple(self._open) if self._expected_link_end == _OFF else ():
            operation.settle(None)
            events += self._after_step(operation, now_s)
        return events + super().connection_lost(reason, now_s)


row(
    "takes-loss-for-shutdown",
    "T/9",
    "A shutdown that was not answered before the link was lost is reported as done.",
    loss_is_success(_OFF),
    subtle=True,
)
