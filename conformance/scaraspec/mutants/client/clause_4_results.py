"""Faults of clause 4: final results that are mistaken, missed, or not awaited."""

from collections.abc import Iterable
from typing import ClassVar

from scaraspec.client.core import ClientCore, Event, FrameAccepted, OperationSettled
from scaraspec.client.errors import ReplyTimeout
from scaraspec.client.pending_operation import PendingOperation, Stage, TwoStage
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersResults, OtherTwoStage
from scaraspec.protocol.commands import BY_OPCODE, Parsed
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, Framer, StreamItem

_STATUS = 0x09
_IMPATIENT_S = 0.25


def _executes(frame: Frame) -> bool:
    command = BY_OPCODE.get(frame.opcode)
    return command is not None and command.two_stage


# Not told by their tag


@mutant("tells-results-by-their-data", "4/9", subtle=True)
class TellsResultsByTheirData(ClientCore):
    """What begins with 11 or 00 is taken for a final result, with or without its tag."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        tagged = frame.tagged or (_executes(frame) and frame.data[:2] in (b"11", b"00"))
        return super()._dispatch(frame._replace(tagged=tagged), now_s)


@mutant("refusal-with-eleven-is-success", "4/9")
class RefusalWithElevenIsSuccess(ClientCore):
    """A refusal with the code 11 is taken for a success, which ends in 11 too."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged or not _executes(frame) or frame.data != b"0|11":
            return super()._dispatch(frame, now_s)
        events = super()._dispatch(frame._replace(data=b"1"), now_s)
        return events + super()._dispatch(frame._replace(data=b"11", tagged=True), now_s)


@mutant("failure-with-eleven-is-success", "4/9")
class FailureWithElevenIsSuccess(AltersResults):
    """A failure with the code 11 is taken for a success: only the end of the data is looked at."""

    def altered(self, data: bytes) -> bytes:
        """Look at that."""
        return data[-2:] if data.endswith(b"11") else data


class _EndsAtOnce(TwoStage):
    """It has ended when it was accepted."""

    def _accept(self, value: None, now_s: float) -> list[Frame]:
        super()._accept(value, now_s)
        self.settle(None)
        return []


@mutant("first-reply-is-the-result", "4/9")
class FirstReplyIsTheResult(OtherTwoStage):
    """The first reply is taken for the final result."""

    shape = _EndsAtOnce


class _TakesAnyResult(TwoStage):
    """Any result ends it."""

    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        """Do not look at the opcode."""
        if self.stage is Stage.EXECUTING:
            return parsed.part == "result"
        return super().expects(frame, parsed)


@mutant("any-result-ends-it", "4/9", "4.17/9", subtle=True)
class AnyResultEndsIt(OtherTwoStage):
    """Behind the tag the opcode is not looked at: the first result ends what was begun first."""

    shape = _TakesAnyResult


@mutant("refusal-ends-the-first", "4/9", subtle=True)
class RefusalEndsTheFirst(ClientCore):
    """A second order that is refused ends the first one, which goes on."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        name = BY_OPCODE[frame.opcode].name if _executes(frame) else ""
        first = self._executing(name) if name and not frame.tagged else []
        events = super()._dispatch(frame, now_s)
        if frame.data[:1] == b"0":
            for operation in first:
                operation.interrupt("it was refused")
                events += self._after_step(operation, now_s)
        return events


# Right behind the first reply


def _first_reply(event: Event) -> bool:
    return (
        isinstance(event, FrameAccepted)
        and isinstance(event.operation, TwoStage)
        and event.operation.stage is Stage.EXECUTING
    )


@mutant("drops-what-follows-the-first-reply", "4/10")
class DropsWhatFollowsTheFirstReply(ClientCore):
    """What comes in the same segment as a first reply is thrown away."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        events: list[Event] = []
        for item in found:
            events += super()._process_items([item], now_s)
            if any(map(_first_reply, events)):
                break
        return events


@mutant("flushes-behind-the-first-reply", "4/10", subtle=True)
class FlushesBehindTheFirstReply(ClientCore):
    """Behind a first reply the buffer is emptied, and with it the beginning of the result."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Empty it."""
        events = super().feed(data, now_s)
        if any(map(_first_reply, events)):
            self._framer = Framer(C2A)
        return events


@mutant("failure-must-come-later", "4/10", subtle=True)
class FailureMustComeLater(ClientCore):
    """A failure in the same segment as the first reply is not seen: only a success is so quick."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        accepted, events = False, []
        for item in found:
            if accepted and isinstance(item, Frame) and item.tagged and item.data[:2] == b"00":
                continue
            now = super()._process_items([item], now_s)
            accepted = accepted or any(map(_first_reply, now))
            events += now
        return events


@mutant("result-behind-another-reply-is-lost", "4/10", subtle=True)
class ResultBehindAnotherReplyIsLost(ClientCore):
    """A final result is not seen in the same segment behind the reply to something else."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        replied, events = False, []
        for item in found:
            if isinstance(item, Frame):
                if replied and item.tagged:
                    continue
                replied = not item.tagged and not _executes(item)
            events += super()._process_items([item], now_s)
        return events


# Long after it


class _Impatient(TwoStage):
    """Its result is not waited for without bound."""

    patience_s: ClassVar[float]

    def _accept(self, value: None, now_s: float) -> list[Frame]:
        frames = super()._accept(value, now_s)
        self.deadline_s = now_s + self.patience_s
        return frames

    def expire(self, now_s: float) -> list[Frame]:
        """Give up, whatever executes."""
        if self.stage is Stage.REQUESTED:
            return super().expire(now_s)
        return self.lost_patience()

    def lost_patience(self) -> list[Frame]:
        """Take it for lost."""
        self.fail(ReplyTimeout(f"{self.command.name} has no result"))
        return []


class _ForFiveSeconds(_Impatient):
    patience_s = 5.0


class _ForTenSeconds(_Impatient):
    patience_s = 10.2


class _ForgetsIt(_Impatient):
    patience_s = 8.0

    def lost_patience(self) -> list[Frame]:
        """Take it for done."""
        self.settle(None)
        return []


class _AsksAgain(_Impatient):
    patience_s = 3.0

    def lost_patience(self) -> list[Frame]:
        """Ask again."""
        self.deadline_s = None
        return [self._request]


@mutant("waits-five-seconds", "4/11")
class WaitsFiveSeconds(OtherTwoStage):
    """The final result is waited for as long as a first reply, five seconds."""

    shape = _ForFiveSeconds


@mutant("waits-ten-seconds", "4/11", subtle=True)
class WaitsTenSeconds(OtherTwoStage):
    """The final result is waited for hardly longer than ten seconds, whatever the robot says."""

    shape = _ForTenSeconds


@mutant("silence-is-success", "4/11", subtle=True)
class SilenceIsSuccess(OtherTwoStage):
    """A result that does not come in eight seconds is taken for a success."""

    shape = _ForgetsIt


@mutant("asks-again-when-it-takes-long", "4/16", subtle=True)
class AsksAgainWhenItTakesLong(OtherTwoStage):
    """What has not ended in three seconds is asked for again."""

    shape = _AsksAgain


class _AsksUntilAccepted(TwoStage):
    """It is asked for again every quarter of a second, until the first reply comes."""

    def begin(self, now_s: float) -> list[Frame]:
        frames = super().begin(now_s)
        self.deadline_s = now_s + _IMPATIENT_S
        return frames

    def expire(self, now_s: float) -> list[Frame]:
        return self.begin(now_s) if self.stage is Stage.REQUESTED else super().expire(now_s)


@mutant("asks-again-until-accepted", "4/16", subtle=True)
class AsksAgainUntilAccepted(OtherTwoStage):
    """What has not been accepted in a quarter of a second is asked for again."""

    shape = _AsksUntilAccepted


class _AsksTwice(TwoStage):
    """It is asked for again as soon as it was accepted."""

    def _accept(self, value: None, now_s: float) -> list[Frame]:
        return [*super()._accept(value, now_s), self._request]


@mutant("asks-twice", "4/16")
class AsksTwice(OtherTwoStage):
    """What was accepted is asked for once more, to be sure."""

    shape = _AsksTwice


@mutant("asks-again-when-idle", "4/16", subtle=True)
class AsksAgainWhenIdle(ClientCore):
    """What has not ended is asked for again when the robot says that it is idle."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        events = super()._dispatch(frame, now_s)
        status = (
            BY_OPCODE[frame.opcode].name == "get_status" if frame.opcode in BY_OPCODE else False
        )
        if status and frame.data == b"00":
            for operation in self._executing():
                self._send(operation.begin(now_s))
                operation.deadline_s = None
        return events


@mutant("asks-again-on-the-next-link", "4/16", subtle=True)
class AsksAgainOnTheNextLink(ClientCore):
    """What had not ended when the link was lost is asked for again behind the next login."""

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
