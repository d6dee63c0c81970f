"""Mutants of clause 4: final results that are misread, missed, or not awaited."""

import asyncio
from collections.abc import Callable, Iterable
from typing import ClassVar, TypeVar

from scaraspec.client.aio import AsyncClient
from scaraspec.client.base import CLOSED_LOCALLY
from scaraspec.client.core import ClientCore, Event, FrameAccepted, OperationSettled
from scaraspec.client.errors import LinkLost, ReplyTimeout
from scaraspec.client.operations import Call
from scaraspec.client.pending_operation import PendingOperation, Stage, TwoStage
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import received, received_items
from scaraspec.mutants.operators.client.messages import operations, result_data
from scaraspec.mutants.operators.client.process_memory import memory
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE, Parsed
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, Framer, StreamItem

T = TypeVar("T")


def _executes(frame: Frame) -> bool:
    command = BY_OPCODE.get(frame.opcode)
    return command is not None and command.two_stage


# The tag and the opcode of a result


def _tagged_by_data(frame: Frame) -> Frame:
    tagged = frame.tagged or (_executes(frame) and frame.data[:2] in (b"11", b"00"))
    return frame._replace(tagged=tagged)


class _EndsWhenAccepted(TwoStage):
    def _accept(self, value: None, now_s: float) -> list[Frame]:
        super()._accept(value, now_s)
        self.settle(None)
        return []


class _TakesAnyResult(TwoStage):
    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        if self.stage is Stage.EXECUTING:
            return parsed.part == "result"
        return super().expects(frame, parsed)


row(
    "tells-results-by-their-data",
    "4/9",
    "A reply that begins with 11 or 00 is taken as a final result without its tag.",
    received(_tagged_by_data),
    subtle=True,
)


@mutant("refusal-with-eleven-is-success", "4/9")
class RefusalWithElevenIsSuccess(ClientCore):
    """A refusal with the code 11 is taken as a success."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged or not _executes(frame) or frame.data != b"0|11":
            return super()._dispatch(frame, now_s)
        events = super()._dispatch(frame._replace(data=b"1"), now_s)
        return events + super()._dispatch(frame._replace(data=b"11", tagged=True), now_s)


row(
    "failure-with-eleven-is-success",
    "4/9",
    "A failure with the code 11 is taken as a success.",
    result_data(lambda data: data[-2:] if data.endswith(b"11") else data),
)
row(
    "first-reply-is-the-result",
    "4/9",
    "The first reply is taken as the final result.",
    operations(_EndsWhenAccepted),
)
row(
    "any-result-ends-it",
    "4/9 4.17/9",
    "A final result with any opcode ends the command that was started first.",
    operations(_TakesAnyResult),
    subtle=True,
)


@mutant("refusal-ends-the-first", "4/9", subtle=True)
class RefusalEndsExecutingCommand(ClientCore):
    """The refusal of a command ends the same command that still executes."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        name = BY_OPCODE[frame.opcode].name if _executes(frame) else ""
        first = self._executing(name) if name and not frame.tagged else []
        events = super()._dispatch(frame, now_s)
        if frame.data[:1] == b"0":
            for operation in first:
                operation.interrupt("it was refused")
                events += self._after_step(operation, now_s)
        return events


# Directly after the first reply


def _first_reply(event: Event) -> bool:
    return (
        isinstance(event, FrameAccepted)
        and isinstance(event.operation, TwoStage)
        and event.operation.stage is Stage.EXECUTING
    )


@mutant("drops-what-follows-the-first-reply", "4/10")
class DropsFramesAfterFirstReply(ClientCore):
    """Frames after a first reply in the same segment are dropped."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        events: list[Event] = []
        for item in found:
            events += super()._process_items([item], now_s)
            if any(map(_first_reply, events)):
                break
        return events


@mutant("flushes-behind-the-first-reply", "4/10", subtle=True)
class FlushesBufferAfterFirstReply(ClientCore):
    """After a first reply, the receive buffer with the beginning of the result is emptied."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        if any(map(_first_reply, events)):
            self._framer = Framer(C2A)
        return events


@mutant("failure-must-come-later", "4/10", subtle=True)
class DropsFailureAfterFirstReply(ClientCore):
    """A failure in the same segment as the first reply is dropped."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        accepted, events = False, []
        for item in found:
            if accepted and isinstance(item, Frame) and item.tagged and item.data[:2] == b"00":
                continue
            now = super()._process_items([item], now_s)
            accepted = accepted or any(map(_first_reply, now))
            events += now
        return events


def _without_results_after_replies(items: list[StreamItem]) -> Iterable[StreamItem]:
    replied = False
    for item in items:
        if isinstance(item, Frame):
            if replied and item.tagged:
                continue
            replied = not item.tagged and not _executes(item)
        yield item


row(
    "result-behind-another-reply-is-lost",
    "4/10",
    "A final result after the reply to a query in the same segment is lost.",
    received_items(_without_results_after_replies),
    subtle=True,
)

# Long after the first reply


def _fail(operation: PendingOperation, _: float) -> list[Frame]:
    operation.fail(ReplyTimeout(f"{operation.command.name} has no result"))
    return []


def _succeed(operation: PendingOperation, _: float) -> list[Frame]:
    operation.settle(None)
    return []


def _repeat(operation: PendingOperation, now_s: float) -> list[Frame]:
    frames = operation.begin(now_s)
    operation.deadline_s = None
    return frames


def _result_timeout(
    timeout_s: float, expire: Callable[[PendingOperation, float], list[Frame]]
) -> type[ClientCore]:
    """If a final result does not arrive in time, `expire` is called."""

    class ResultTimeout(TwoStage):
        def _accept(self, value: None, now_s: float) -> list[Frame]:
            frames = super()._accept(value, now_s)
            self.deadline_s = now_s + timeout_s
            return frames

        def expire(self, now_s: float) -> list[Frame]:
            if self.stage is Stage.REQUESTED:
                return super().expire(now_s)
            return expire(self, now_s)

    return operations(ResultTimeout)


class _RepeatsUntilAccepted(TwoStage):
    def begin(self, now_s: float) -> list[Frame]:
        frames = super().begin(now_s)
        self.deadline_s = now_s + 0.25
        return frames

    def expire(self, now_s: float) -> list[Frame]:
        return self.begin(now_s) if self.stage is Stage.REQUESTED else super().expire(now_s)


class _RepeatsWhenAccepted(TwoStage):
    def _accept(self, value: None, now_s: float) -> list[Frame]:
        return [*super()._accept(value, now_s), self._request]


row(
    "waits-five-seconds",
    "4/11",
    "The final result is given up after 5 s.",
    _result_timeout(5.0, _fail),
)
row(
    "waits-ten-seconds",
    "4/11",
    "The final result is given up after 10.2 s.",
    _result_timeout(10.2, _fail),
    subtle=True,
)
row(
    "silence-is-success",
    "4/11",
    "A command without final result after 8 s is reported as done.",
    _result_timeout(8.0, _succeed),
    subtle=True,
)
row(
    "asks-again-when-it-takes-long",
    "4/16",
    "A command without final result after 3 s is sent again.",
    _result_timeout(3.0, _repeat),
    subtle=True,
)
row(
    "asks-again-until-accepted",
    "4/16",
    "A command is sent again every quarter of a second until its first reply arrives.",
    operations(_RepeatsUntilAccepted),
    subtle=True,
)
row(
    "asks-twice",
    "4/16",
    "A command is sent again as soon as it is accepted.",
    operations(_RepeatsWhenAccepted),
)


@mutant("asks-again-when-idle", "4/16", subtle=True)
class RepeatsWhenIdle(ClientCore):
    """A command without final result is sent again when the status of the robot is idle."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        events = super()._dispatch(frame, now_s)
        if frame.opcode == BY_NAME["get_status"].opcode and frame.data == b"00":
            for operation in self._executing():
                self._send(_repeat(operation, now_s))
        return events


@mutant("asks-again-on-the-next-link", "4/16", subtle=True)
class RepeatsAfterReconnect(ClientCore):
    """A command without final result when the link was lost is sent again after the next login."""

    _left: ClassVar[list[Frame]] = []

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            if _executes(frame):
                self._left[:] = [frame]
            super()._send([frame])

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        events = super()._after_step(operation, now_s)
        if (
            any(isinstance(event, OperationSettled) for event in events)
            and self._lost_reason is None
        ):
            if isinstance(operation, TwoStage):
                self._left.clear()
            elif self.logged_in and operation.command.name == "login":
                self._send(tuple(self._left))
        return events


def _reconnects(stage: Stage) -> type[AsyncClient]:
    """A command whose link is lost at this stage is sent again on a new connection."""

    class Remembers(ClientCore):
        def connection_lost(self, reason: str, now_s: float) -> list[Event]:
            if reason != CLOSED_LOCALLY and self._lost_reason is None:
                memory()["lost"] = [e.stage for e in self._open if isinstance(e, TwoStage)]
            return super().connection_lost(reason, now_s)

    class Reconnects(AsyncClient):
        core = Remembers

        async def perform(self, call: Call[T]) -> T:
            try:
                return await super().perform(call)
            except LinkLost:
                if stage not in memory().pop("lost", ()):
                    raise
            await asyncio.sleep(2.0)
            self._core = self.core(self.dialect)
            await self.connect()
            return await super().perform(call)

    return Reconnects


row(
    "reconnects-and-asks-again",
    "4/16",
    "After a lost link, the client connects by itself and repeats the command that executed.",
    _reconnects(Stage.EXECUTING),
)
row(
    "reconnects-and-asks-again-until-accepted",
    "4/16",
    "After a lost link, the client connects by itself and repeats the request without reply.",
    _reconnects(Stage.REQUESTED),
    subtle=True,
)
