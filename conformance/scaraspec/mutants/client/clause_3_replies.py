"""Faults of clause 3: what is made of frames, and of bytes that are none."""

import asyncio
from collections.abc import Container, Iterable
from typing import ClassVar

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event, UnexpectedFrame
from scaraspec.client.pending_operation import PendingOperation, Stage, TwoStage
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.frames import GoesDeaf
from scaraspec.mutants.operators.client.process_memory import memory
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import TAG, Frame, Framer, Skipped, SkipReason, StreamItem
from scaraspec.protocol.payloads import FLAG

_RESULT_BEGINS = bytes((C2A.start, TAG))

# Counting, and the tag


@mutant("ends-at-the-first-mark", "3/9")
class EndsAtTheFirstMark(ClientCore):
    """A frame is taken to end at the first AA, even in its data."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        return super()._dispatch(frame._replace(data=frame.data.partition(b"\xaa")[0]), now_s)


@mutant("begins-anew-at-each-start", "3/9", subtle=True)
class BeginsAnewAtEachStart(ClientCore):
    """Data are taken to begin behind the last CC in them."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        return super()._dispatch(frame._replace(data=frame.data.rpartition(b"\xcc")[2]), now_s)


@mutant("takes-lengths-for-marks", "3/9", subtle=True)
class TakesLengthsForMarks(ClientCore):
    """A frame whose length is AA is taken to end there."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        ends = len(frame.data) == C2A.end
        return super()._dispatch(frame._replace(data=b"") if ends else frame, now_s)


@mutant("takes-lengths-for-tags", "3/9", subtle=True)
class TakesLengthsForTags(ClientCore):
    """A frame whose length is 90 is taken for a final result that nobody awaits."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        return [] if len(frame.data) == TAG else super()._dispatch(frame, now_s)


@mutant("looks-for-results-in-data", "3/9", subtle=True)
class LooksForResultsInData(ClientCore):
    """Whatever looks like a final result counts as one, in the data of any frame."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        events = super()._dispatch(frame, now_s)
        if not frame.tagged:
            within = Framer(C2A).feed(frame.data[frame.data.find(_RESULT_BEGINS) :])
            for found in within:
                if isinstance(found, Frame) and found.tagged:
                    events += super()._dispatch(found, now_s)
        return events


@mutant("looks-into-strays", "3/9", subtle=True)
class LooksIntoStrays(ClientCore):
    """In the data of a frame that nobody awaits the reply is looked for that is awaited."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        events = super()._dispatch(frame, now_s)
        if any(isinstance(event, UnexpectedFrame) for event in events):
            for found in Framer(C2A).feed(frame.data):
                if isinstance(found, Frame):
                    events += super()._dispatch(found, now_s)
        return events


class _TaglessFramer(Framer):
    """Knows of no tag."""

    def __init__(self) -> None:
        super().__init__(C2A)
        self._tag = -1
        self._loop_constants = (*self._loop_constants[:3], self._tag, self._loop_constants[4])


@mutant("takes-the-tag-for-an-opcode", "3/13")
class TakesTheTagForAnOpcode(ClientCore):
    """The tag 90 is taken for an opcode, and the opcode behind it for a length."""

    def __init__(self, *args: object, **values: object) -> None:
        super().__init__(*args, **values)  # type: ignore[arg-type] # handed on
        self._framer = _TaglessFramer()


@mutant("knows-the-tag-of-programs", "3/13", subtle=True)
class KnowsTheTagOfPrograms(ClientCore):
    """Only the tagged frames of programs are known."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        known = not frame.tagged or frame.opcode in (0x30, 0x31, 0x32)
        return super()._dispatch(frame, now_s) if known else []


@mutant("loses-the-tag-between-segments", "3/13", subtle=True)
class LosesTheTagBetweenSegments(ClientCore):
    """A segment that ends with the tag leaves nothing behind."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Take it, but for a tag at its end."""
        return super().feed(data.removesuffix(b"\xcc\x90"), now_s)


@mutant("loses-what-follows-results", "3/13", subtle=True)
class LosesWhatFollowsResults(ClientCore):
    """A frame that comes with a tagged one ahead of it in its segment is lost."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        items = list(found)
        behind = [isinstance(item, Frame) and item.tagged for item in items[:-1]]
        kept = [item for item, lost in zip(items, [False, *behind], strict=False) if not lost]
        return super()._process_items(kept, now_s)


# What nobody has defined


@mutant("takes-the-undefined-for-replies", "3/22")
class TakesTheUndefinedForReplies(ClientCore):
    """A frame with an undefined opcode is taken for the reply to what was asked last."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.opcode not in BY_OPCODE and self._open:
            frame = frame._replace(opcode=self._open[-1].command.opcode)
        return super()._dispatch(frame, now_s)


@mutant("goes-deaf-at-the-undefined", "3/22")
class GoesDeafAtTheUndefined(GoesDeaf):
    """A frame with an undefined opcode is the last thing that it hears."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        self.deaf |= frame.opcode not in BY_OPCODE
        return super()._dispatch(frame, now_s)


@mutant("goes-deaf-at-undefined-results", "3/22", subtle=True)
class GoesDeafAtUndefinedResults(GoesDeaf):
    """A tagged frame with an undefined opcode is the last thing that it hears."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        self.deaf |= frame.tagged and frame.opcode not in BY_OPCODE
        return super()._dispatch(frame, now_s)


# Late, in pieces, overtaken


@mutant("impatient-for-replies", "3/27")
class ImpatientForReplies(ClientCore):
    """A reply that takes more than a quarter of a second is not waited for."""

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        """Begin, and wait for a short time only."""
        super().begin(operation, now_s)
        if operation.deadline_s is not None:
            operation.deadline_s = now_s + 0.25


@mutant("forgets-its-request-at-results", "3/27")
class ForgetsItsRequestAtResults(ClientCore):
    """A final result makes it forget that it waits for replies."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged:
            kept = [each for each in self._open if each.stage is not Stage.REQUESTED]
            forgotten = [each for each in self._open if each.stage is Stage.REQUESTED]
            self._open = kept
            for each in forgotten:
                each.stage = Stage.EXECUTING
        return super()._dispatch(frame, now_s)


@mutant("ignores-replies-while-it-executes", "3/27", subtle=True)
class IgnoresRepliesWhileItExecutes(ClientCore):
    """While a two-stage command executes only its own frames are listened to."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        busy = any(isinstance(e, TwoStage) and e.stage is Stage.EXECUTING for e in self._open)
        return [] if busy and not frame.tagged else super()._dispatch(frame, now_s)


# Whose reply it is


@mutant("takes-replies-in-order", "3/33")
class TakesRepliesInOrder(ClientCore):
    """A reply is taken for that to the oldest request, whatever its opcode."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        asked = [each for each in self._open if each.stage is Stage.REQUESTED]
        if asked and not frame.tagged:
            frame = frame._replace(opcode=asked[0].command.opcode)
        return super()._dispatch(frame, now_s)


@mutant("takes-any-yes", "3/33", subtle=True)
class TakesAnyYes(ClientCore):
    """A yes is taken for that to the oldest open setting, whatever its opcode."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        settings = [each for each in self._open if each.command.reply is FLAG]
        if settings and frame.data == b"1":
            frame = frame._replace(opcode=settings[0].command.opcode)
        return super()._dispatch(frame, now_s)


@mutant("takes-one-pose-for-another", "3/33", subtle=True)
class TakesOnePoseForAnother(ClientCore):
    """Where the tool is, is taken for where it begins, if that is asked."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        begins, is_there = (
            BY_NAME[name].opcode for name in ("get_initial_tool_position", "get_tool_coordinates")
        )
        asked = [each.command.opcode for each in self._open]
        if frame.opcode == is_there and begins in asked and is_there not in asked:
            frame = frame._replace(opcode=begins)
        return super()._dispatch(frame, now_s)


@mutant("overlooks-tags-of-queries", "3/33", subtle=True)
class OverlooksTagsOfQueries(ClientCore):
    """A tag on the reply to a query is overlooked."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        command = BY_OPCODE.get(frame.opcode)
        one_stage = command is not None and not command.two_stage
        return super()._dispatch(frame._replace(tagged=False) if one_stage else frame, now_s)


@mutant("takes-results-for-replies", "3/33", subtle=True)
class TakesResultsForReplies(ClientCore):
    """A final result that comes ahead of the first reply is taken for both."""

    commands: ClassVar[Container[str]] = BY_NAME

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged and any(
            each.command.opcode == frame.opcode
            and each.command.name in self.commands
            and each.stage is Stage.REQUESTED
            for each in self._open
        ):
            super()._dispatch(Frame(C2A, frame.opcode, b"1"), now_s)
        return super()._dispatch(frame, now_s)


@mutant("takes-results-of-stops-for-replies", "3/33", subtle=True)
class TakesResultsOfStopsForReplies(TakesResultsForReplies):
    """A final result of a stop that comes ahead of its first reply is taken for both."""

    commands = ("emergency_stop",)


# Bytes that are no frame


class _DeafAt(GoesDeaf):
    """Bytes that are no frame are the last thing that it hears."""

    why: ClassVar[SkipReason]
    least_bytes: ClassVar[int] = 1

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        heard = []
        for item in found:
            if isinstance(item, Skipped) and item.why is self.why:
                self.deaf |= item.size_bytes >= self.least_bytes
            if not self.deaf:
                heard.append(item)
        return super()._process_items(heard, now_s)


@mutant("goes-deaf-at-stray-bytes", "3/19")
class GoesDeafAtStrayBytes(_DeafAt):
    """A byte between frames is the last thing that it hears."""

    why = SkipReason.STRAY


@mutant("goes-deaf-at-many-stray-bytes", "3/19", subtle=True)
class GoesDeafAtManyStrayBytes(_DeafAt):
    """More than a hundred bytes between frames are the last thing that it hears."""

    why = SkipReason.STRAY
    least_bytes = 100


@mutant("goes-deaf-at-wrong-ends", "3/20")
class GoesDeafAtWrongEnds(_DeafAt):
    """A frame with a wrong end byte is the last thing that it hears."""

    why = SkipReason.BAD_END


class _LosesResultsAmong(ClientCore):
    """A final result is dropped while certain other things are open."""

    names: ClassVar[Container[str]]
    """Their commands."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged and any(operation.command.name in self.names for operation in self._open):
            return []
        return super()._dispatch(frame, now_s)


@mutant("loses-results-among-chunks", "3/27", subtle=True)
class LosesResultsAmongChunks(_LosesResultsAmong):
    """What is done during a transfer is never told."""

    names = ("upload_name", "download_name")


@mutant("loses-results-in-lists", "3/27", subtle=True)
class LosesResultsInLists(_LosesResultsAmong):
    """What is done while the programs are listed is never told."""

    names = ("list_programs",)


@mutant("loses-results-in-settings", "3/27", subtle=True)
class LosesResultsInSettings(_LosesResultsAmong):
    """What is done while an output is set is never told."""

    names = ("set_digital_output",)


@mutant("overlooks-the-end", "3/20")
class OverlooksTheEnd(ClientCore):
    """The end byte of a frame is not looked at."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        return super()._process_items(map(_overlooked, found), now_s)


def _overlooked(item: StreamItem) -> StreamItem:
    """The frame that bytes with a wrong end would be."""
    if isinstance(item, Frame) or item.why is not SkipReason.BAD_END:
        return item
    size_bytes = item.data[2]
    return Frame(C2A, item.data[1], item.data[3 : 3 + size_bytes])


@mutant("overlooks-the-end-of-results", "3/20", subtle=True)
class OverlooksTheEndOfResults(ClientCore):
    """The end byte of a tagged frame is not looked at."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        return super()._process_items(map(_result_overlooked, found), now_s)


def _result_overlooked(item: StreamItem) -> StreamItem:
    """The tagged frame that bytes with a wrong end would be."""
    if isinstance(item, Frame) or item.why is not SkipReason.BAD_END or item.data[1] != TAG:
        return item
    return Frame(C2A, item.data[2], item.data[4:-1], tagged=True)


@mutant("keeps-half-frames-for-later", "3/29")
class KeepsHalfFramesForLater(AsyncClient):
    """What half a frame has left in the buffer stays there for the next connection."""

    class core(ClientCore):  # noqa: N801 - it fills in the attribute
        """Begins with the buffer of before, and never gives half a frame up."""

        def __init__(self, *args: object, **values: object) -> None:
            super().__init__(*args, **values)  # type: ignore[arg-type] # handed on
            self._framer = memory().setdefault("buffer", self._framer)

        @property
        def _partial_until_s(self) -> None:
            return None

        def connection_lost(self, reason: str, now_s: float) -> list[Event]:
            """Forget everything but the buffer."""
            held, self._framer = self._framer, Framer(C2A)
            events = super().connection_lost(reason, now_s)
            self._framer = held
            return events


@mutant("waits-for-the-rest-of-frames", "3/29", subtle=True)
class WaitsForTheRestOfFrames(AsyncClient):
    """It does not hang up before a frame that has begun is whole."""

    class core(ClientCore):  # noqa: N801 - it fills in the attribute
        """Tells whether a frame has begun."""

        @property
        def begun(self) -> bool:
            """Whether one has."""
            return self._framer.held_bytes > 0

    async def close(self) -> None:
        """Wait for the rest, and hang up."""
        if isinstance(self._core, self.core) and self._core.begun:
            await asyncio.sleep(60)
        await super().close()
