"""Mutants of clause 3: received frames, and bytes that are not a frame."""

import asyncio
from collections.abc import Collection, Iterable

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event, UnexpectedFrame
from scaraspec.client.pending_operation import PendingOperation, Stage, TwoStage
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import (
    ignores_after,
    received,
    received_bytes,
    received_items,
    received_while,
)
from scaraspec.mutants.operators.client.process_memory import memory
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE, Parsed
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import TAG, Frame, Framer, Skipped, SkipReason, StreamItem
from scaraspec.protocol.payloads import FLAG

_RESULT_BEGINS = bytes((C2A.start, TAG))

# Length and tag


def _frames_in(data: bytes) -> list[Frame]:
    return [item for item in Framer(C2A).feed(data) if isinstance(item, Frame)]


row(
    "ends-at-the-first-mark",
    "3/9",
    "The data of a frame end at their first AA.",
    received(lambda frame: frame._replace(data=frame.data.partition(b"\xaa")[0])),
)
row(
    "begins-anew-at-each-start",
    "3/9",
    "The data of a frame begin after their last CC.",
    received(lambda frame: frame._replace(data=frame.data.rpartition(b"\xcc")[2])),
    subtle=True,
)
row(
    "takes-lengths-for-marks",
    "3/9",
    "A frame with the length AA is read as a frame without data.",
    received(lambda frame: frame._replace(data=b"") if len(frame.data) == C2A.end else frame),
    subtle=True,
)
row(
    "takes-lengths-for-tags",
    "3/9",
    "A frame with the length 90 is dropped as an unexpected final result.",
    received(lambda frame: None if len(frame.data) == TAG else frame),
    subtle=True,
)


@mutant("looks-for-results-in-data", "3/9", subtle=True)
class FindsResultsInData(ClientCore):
    """A final result inside the data of another frame is processed."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        events = super()._dispatch(frame, now_s)
        if not frame.tagged:
            for found in _frames_in(frame.data[frame.data.find(_RESULT_BEGINS) :]):
                if found.tagged:
                    events += super()._dispatch(found, now_s)
        return events


@mutant("looks-into-strays", "3/9", subtle=True)
class FindsFramesInUnexpectedFrames(ClientCore):
    """A frame inside the data of an unexpected frame is processed."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        events = super()._dispatch(frame, now_s)
        if any(isinstance(event, UnexpectedFrame) for event in events):
            for found in _frames_in(frame.data):
                events += super()._dispatch(found, now_s)
        return events


@mutant("takes-the-tag-for-an-opcode", "3/13")
class ReadsTagAsOpcode(ClientCore):
    """The tag 90 is read as an opcode and the opcode after it as a length."""

    def __init__(self, *args: object, **values: object) -> None:
        super().__init__(*args, **values)  # type: ignore[arg-type] # handed on

        class TaglessFramer(Framer):
            def __init__(self) -> None:
                super().__init__(C2A)
                self._tag = -1
                direction, start, end, _, make = self._loop_constants
                self._loop_constants = (direction, start, end, self._tag, make)

        self._framer = TaglessFramer()


row(
    "knows-the-tag-of-programs",
    "3/13",
    "Tagged frames are dropped, except those of program runs, simulations and stops.",
    received(
        lambda frame: frame if not frame.tagged or frame.opcode in (0x30, 0x31, 0x32) else None
    ),
    subtle=True,
)
row(
    "loses-the-tag-between-segments",
    "3/13",
    "Start byte and tag at the end of a segment are lost.",
    received_bytes(lambda data: data.removesuffix(b"\xcc\x90")),
    subtle=True,
)


def _without_followers(items: list[StreamItem]) -> list[StreamItem]:
    lost = [False, *(isinstance(item, Frame) and item.tagged for item in items)]
    return [item for item, is_lost in zip(items, lost, strict=False) if not is_lost]


row(
    "loses-what-follows-results",
    "3/13",
    "A frame after a tagged frame in the same segment is lost.",
    received_items(_without_followers),
    subtle=True,
)

# Undefined opcodes


def _as_reply_to_last(frame: Frame, pending: list[PendingOperation]) -> Frame:
    if frame.opcode not in BY_OPCODE and pending:
        return frame._replace(opcode=pending[-1].command.opcode)
    return frame


row(
    "takes-the-undefined-for-replies",
    "3/22",
    "A frame with an undefined opcode is taken as the reply to the last request.",
    received_while(_as_reply_to_last),
)
row(
    "goes-deaf-at-the-undefined",
    "3/22",
    "After a frame with an undefined opcode, all received bytes are ignored.",
    ignores_after(lambda frame: frame.opcode not in BY_OPCODE),
)
row(
    "goes-deaf-at-undefined-results",
    "3/22",
    "After a tagged frame with an undefined opcode, all received bytes are ignored.",
    ignores_after(lambda frame: frame.tagged and frame.opcode not in BY_OPCODE),
    subtle=True,
)


# Late replies


@mutant("impatient-for-replies", "3/27")
class GivesUpReplies(ClientCore):
    """A reply is given up after a quarter of a second."""

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        super().begin(operation, now_s)
        if operation.deadline_s is not None:
            operation.deadline_s = now_s + 0.25


@mutant("forgets-its-request-at-results", "3/27")
class ForgetsRequestsAtResults(ClientCore):
    """After a final result, replies to pending requests are no longer awaited."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged:
            forgotten = [each for each in self._open if each.stage is Stage.REQUESTED]
            self._open = [each for each in self._open if each.stage is not Stage.REQUESTED]
            for each in forgotten:
                each.stage = Stage.EXECUTING
        return super()._dispatch(frame, now_s)


def _tagged_while_executing(frame: Frame, pending: list[PendingOperation]) -> Frame | None:
    busy = any(isinstance(e, TwoStage) and e.stage is Stage.EXECUTING for e in pending)
    return None if busy and not frame.tagged else frame


row(
    "ignores-replies-while-it-executes",
    "3/27",
    "While a two-stage command executes, all frames without a tag are ignored.",
    received_while(_tagged_while_executing),
    subtle=True,
)

# The request of a reply

_GET_INITIAL = BY_NAME["get_initial_tool_position"].opcode
_GET_TOOL = BY_NAME["get_tool_coordinates"].opcode


def _as_reply_to_oldest(frame: Frame, pending: list[PendingOperation]) -> Frame:
    requested = [each for each in pending if each.stage is Stage.REQUESTED]
    if requested and not frame.tagged:
        return frame._replace(opcode=requested[0].command.opcode)
    return frame


def _as_reply_to_setting(frame: Frame, pending: list[PendingOperation]) -> Frame:
    settings = [each for each in pending if each.command.reply is FLAG]
    if settings and frame.data == b"1":
        return frame._replace(opcode=settings[0].command.opcode)
    return frame


def _as_initial_position(frame: Frame, pending: list[PendingOperation]) -> Frame:
    requested = [each.command.opcode for each in pending]
    if frame.opcode == _GET_TOOL and _GET_INITIAL in requested and _GET_TOOL not in requested:
        return frame._replace(opcode=_GET_INITIAL)
    return frame


def _without_tag_of_query(frame: Frame) -> Frame:
    command = BY_OPCODE.get(frame.opcode)
    one_stage = command is not None and not command.two_stage
    return frame._replace(tagged=False) if one_stage else frame


def _results_are_replies(commands: Collection[str]) -> type[ClientCore]:
    """A final result before the first reply to one of these commands is taken as both."""

    class ResultsAreReplies(ClientCore):
        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            if frame.tagged and any(
                each.command.opcode == frame.opcode
                and each.command.name in commands
                and each.stage is Stage.REQUESTED
                for each in self._open
            ):
                super()._dispatch(Frame(C2A, frame.opcode, b"1"), now_s)
            return super()._dispatch(frame, now_s)

    return ResultsAreReplies


row(
    "takes-replies-in-order",
    "3/33",
    "A reply is taken as the reply to the oldest request, whatever its opcode.",
    received_while(_as_reply_to_oldest),
)
row(
    "takes-any-yes",
    "3/33",
    "A 1 is taken as the reply to the oldest pending setting, whatever its opcode.",
    received_while(_as_reply_to_setting),
    subtle=True,
)
row(
    "takes-one-pose-for-another",
    "3/33",
    "Tool coordinates are taken as the initial tool position if only that is requested.",
    received_while(_as_initial_position),
    subtle=True,
)
row(
    "overlooks-tags-of-queries",
    "3/33",
    "A tag on the reply to a query is ignored.",
    received(_without_tag_of_query),
    subtle=True,
)
row(
    "takes-results-for-replies",
    "3/33",
    "A final result before the first reply is taken as both.",
    _results_are_replies(BY_NAME),
    subtle=True,
)
row(
    "takes-results-of-stops-for-replies",
    "3/33",
    "A final result of a stop before its first reply is taken as both.",
    _results_are_replies({"emergency_stop"}),
    subtle=True,
)


@mutant("keeps-late-replies", "3/33", subtle=True)
class KeepsLateReplies(ClientCore):
    """A reply after the timeout of its request answers the next request of that command."""

    _late: Frame | None = None

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        events = super()._dispatch(frame, now_s)
        if isinstance(events[0], UnexpectedFrame):
            self._late = frame
        return events

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        super().begin(operation, now_s)
        late, self._late = self._late, None
        if late is not None:
            self._dispatch(late, now_s)


@mutant("takes-late-replies", "3/33", subtle=True)
class TakesLateReplies(ClientCore):
    """The late reply to a request that timed out answers the next request of that command."""

    def _is_owed(self, parsed: Parsed) -> bool:  # noqa: ARG002 - it owes nothing
        return False


# Bytes that are not a frame


def _ignores_after_skipped(reason: SkipReason, least_bytes: int = 1) -> type[ClientCore]:
    """After skipped bytes, all received bytes are ignored."""

    class IgnoresAfterSkipped(ClientCore):
        ignoring = False

        def feed(self, data: bytes, now_s: float) -> list[Event]:
            return [] if self.ignoring else super().feed(data, now_s)

        def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
            kept = []
            for item in found:
                if isinstance(item, Skipped) and item.reason is reason:
                    self.ignoring |= item.size_bytes >= least_bytes
                if not self.ignoring:
                    kept.append(item)
            return super()._process_items(kept, now_s)

    return IgnoresAfterSkipped


def _no_results_while(*commands: str) -> type[ClientCore]:
    """A final result is dropped while one of these commands is pending."""

    def drop(frame: Frame, pending: list[PendingOperation]) -> Frame | None:
        dropped = frame.tagged and any(each.command.name in commands for each in pending)
        return None if dropped else frame

    return received_while(drop)


def _any_end(item: StreamItem) -> StreamItem:
    if isinstance(item, Frame) or item.reason is not SkipReason.BAD_END:
        return item
    return Frame(C2A, item.data[1], item.data[3 : 3 + item.data[2]])


def _any_end_of_result(item: StreamItem) -> StreamItem:
    if isinstance(item, Frame) or item.reason is not SkipReason.BAD_END or item.data[1] != TAG:
        return item
    return Frame(C2A, item.data[2], item.data[4:-1], tagged=True)


row(
    "goes-deaf-at-stray-bytes",
    "3/19",
    "After a byte between frames, all received bytes are ignored.",
    _ignores_after_skipped(SkipReason.STRAY),
)
row(
    "goes-deaf-at-many-stray-bytes",
    "3/19",
    "After a hundred or more bytes between frames, all received bytes are ignored.",
    _ignores_after_skipped(SkipReason.STRAY, 100),
    subtle=True,
)
row(
    "goes-deaf-at-wrong-ends",
    "3/20",
    "After a frame with a wrong end byte, all received bytes are ignored.",
    _ignores_after_skipped(SkipReason.BAD_END),
)
row(
    "loses-results-among-chunks",
    "3/27",
    "A final result that arrives during a file transfer is lost.",
    _no_results_while("upload_name", "download_name"),
    subtle=True,
)
row(
    "loses-results-in-lists",
    "3/27",
    "A final result that arrives while the program list is pending is lost.",
    _no_results_while("list_programs"),
    subtle=True,
)
row(
    "loses-results-in-settings",
    "3/27",
    "A final result that arrives while the setting of an output is pending is lost.",
    _no_results_while("set_digital_output"),
    subtle=True,
)
row(
    "overlooks-the-end",
    "3/20",
    "The end byte of a frame is not checked.",
    received_items(lambda items: map(_any_end, items)),
)
row(
    "overlooks-the-end-of-results",
    "3/20",
    "The end byte of a tagged frame is not checked.",
    received_items(lambda items: map(_any_end_of_result, items)),
    subtle=True,
)


@mutant("keeps-half-frames-for-later", "3/29")
class KeepsBufferBetweenConnections(AsyncClient):
    """An incomplete frame stays in the buffer for the next connection."""

    class core(ClientCore):  # noqa: N801 - it fills in the attribute
        """The core shares the buffer and never discards an incomplete frame."""

        def __init__(self, *args: object, **values: object) -> None:
            super().__init__(*args, **values)  # type: ignore[arg-type] # handed on
            self._framer = memory().setdefault("buffer", self._framer)

        @property
        def _partial_until_s(self) -> None:
            return None

        def connection_lost(self, reason: str, now_s: float) -> list[Event]:
            held, self._framer = self._framer, Framer(C2A)
            events = super().connection_lost(reason, now_s)
            self._framer = held
            return events


@mutant("waits-for-the-rest-of-frames", "3/29", subtle=True)
class WaitsForIncompleteFrame(AsyncClient):
    """The connection is not closed within 60 s if a frame is incomplete."""

    async def close(self) -> None:
        if self._core._framer.buffered_bytes:  # noqa: SLF001 - the fault is in there
            await asyncio.sleep(60)
        await super().close()
