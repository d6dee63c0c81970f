"""Faults of clause 2: who dials, what comes first, and what is made of segments."""

from collections.abc import Iterable
from typing import ClassVar

from scaraspec.client.aio import AsyncClient
from scaraspec.client.base import LINK_LOST_REASONS
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import ClientError, LinkLost
from scaraspec.client.pending_operation import Login, PendingOperation
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.process_memory import memory
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer, StreamItem
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.transports.link import Ending

# Who dials


@mutant("stays-connected-when-cut", "2/1")
class StaysConnectedWhenCut(AsyncClient):
    """After its connection was cut off it takes itself for connected, and does not dial."""

    async def connect(self) -> None:
        """Dial, or not."""
        if not memory().pop("cut", False):
            await super().connect()

    def _connection_lost(self, reason: str) -> None:
        if reason == LINK_LOST_REASONS[Ending.RESET]:
            memory()["cut"] = True
        super()._connection_lost(reason)


@mutant("rests-after-vain-logins", "2/1", subtle=True)
class RestsAfterVainLogins(AsyncClient):
    """After a login that came to nothing it does not dial when it is told to the next time."""

    async def connect(self) -> None:
        """Dial, or not."""
        if memory().pop("in vain", False):
            raise LinkLost("the controller does not want us")
        try:
            await super().connect()
        except ClientError:
            memory()["in vain"] = True
            raise


@mutant("dials-the-next-port", "2/3")
class DialsTheNextPort(AsyncClient):
    """It dials 8878 where 8877 is due."""

    def __init__(self, url: str, **values: object) -> None:
        super().__init__(url.replace(f":{DEFAULT_PORT}", f":{DEFAULT_PORT + 1}"), **values)  # type: ignore[arg-type] # handed on


# What comes first


@mutant("asks-for-the-version-first", "2/10")
class AsksForTheVersionFirst(ClientCore):
    """It asks for the version ahead of the login."""

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        """Ask, and begin."""
        if isinstance(operation, Login):
            self._send([Frame(A2C, BY_NAME["get_version"].opcode)])
        super().begin(operation, now_s)


@mutant("asks-for-the-status-when-it-comes-back", "2/10", subtle=True)
class AsksForTheStatusWhenItComesBack(AsyncClient):
    """From its second connection on it asks for the status ahead of the login."""

    async def _login(self) -> None:
        if memory().setdefault("met", False) and self._transport is not None:
            self._transport.write(Frame(A2C, BY_NAME["get_status"].opcode).encode())
        memory()["met"] = True
        await super()._login()


# Cut


@mutant("takes-segments-for-frames", "2/5")
class TakesSegmentsForFrames(ClientCore):
    """What a segment leaves unfinished is dropped."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Take the segment alone."""
        return [*super().feed(data, now_s), *self._process_items(self._framer.finish(), now_s)]


@mutant("needs-the-head-at-once", "2/5", subtle=True)
class NeedsTheHeadAtOnce(ClientCore):
    """A frame of which less than opcode and length have come is dropped."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Take what has come."""
        events = super().feed(data, now_s)
        if self._framer.held_bytes in (1, 2):
            events += self._process_items(self._framer.finish(), now_s)
        return events


@mutant("loses-last-bytes-alone", "2/5", subtle=True)
class LosesLastBytesAlone(ClientCore):
    """A segment of one byte that would end a frame is lost."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Take it, or not."""
        alone = data == b"\xaa" and self._framer.held_bytes > 0
        return [] if alone else super().feed(data, now_s)


@mutant("impatient-within-frames", "2/5", subtle=True)
class ImpatientWithinFrames(ClientCore):
    """A frame that stops for half a second is given up."""

    @property
    def _partial_until_s(self) -> float | None:
        return self._last_received_s + 0.5 if self._framer.held_bytes else None


class _LosesInPieces(ClientCore):
    """Frames of one opcode are lost where they come in pieces."""

    opcode: ClassVar[int]
    """Which."""
    _begun = False

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """See whether a frame has begun."""
        self._begun = self._framer.held_bytes > 0
        return super().feed(data, now_s)

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        lost = self._begun and frame.opcode == self.opcode
        return [] if lost else super()._dispatch(frame, now_s)


@mutant("loses-chunks-in-pieces", "2/5", subtle=True)
class LosesChunksInPieces(_LosesInPieces):
    """A chunk that comes in pieces is lost."""

    opcode = BY_NAME["download_chunk"].opcode


@mutant("loses-logins-in-pieces", "2/5", subtle=True)
class LosesLoginsInPieces(_LosesInPieces):
    """The answer to the login is lost where it comes in pieces."""

    opcode = BY_NAME["login"].opcode


@mutant("forgets-pieces-when-it-asks", "2/5", subtle=True)
class ForgetsPiecesWhenItAsks(ClientCore):
    """What has come of a frame is thrown away when another request is sent."""

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        """Throw it away."""
        self._framer = Framer(C2A)
        super().begin(operation, now_s)


# Joined


@mutant("serves-the-first-of-each-segment", "2/6")
class ServesTheFirstOfEachSegment(ClientCore):
    """Of the frames that one segment brings only the first is served."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        return super()._process_items(list(found)[:1], now_s)


@mutant("serves-four-of-each-segment", "2/6", subtle=True)
class ServesFourOfEachSegment(ClientCore):
    """Of the frames that one segment brings only the first four are served."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        return super()._process_items(list(found)[:4], now_s)


@mutant("serves-the-last-of-each-segment", "2/6", subtle=True)
class ServesTheLastOfEachSegment(ClientCore):
    """Of the frames that one segment brings only the last is served."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        return super()._process_items(list(found)[-1:], now_s)


@mutant("accepts-at-the-beginning", "2/6", subtle=True)
class AcceptsAtTheBeginning(ClientCore):
    """A two-stage command is accepted by the first frame of a segment only."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        items = list(found)
        heard = items[:1] + [item for item in items[1:] if not _accepts(item)]
        return super()._process_items(heard, now_s)


def _accepts(item: StreamItem) -> bool:
    if not isinstance(item, Frame) or item.tagged or item.data != b"1":
        return False
    command = BY_OPCODE.get(item.opcode)
    return command is not None and command.two_stage


class _DropsBehind(ClientCore):
    """What comes in one segment behind a frame of a certain opcode is dropped."""

    opcode: ClassVar[int]
    """Which."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        items = list(found)
        ends = (n for n, item in enumerate(items, 1) if self._is_it(item))
        return super()._process_items(items[: next(ends, len(items))], now_s)

    def _is_it(self, item: StreamItem) -> bool:
        return isinstance(item, Frame) and item.opcode == self.opcode and not item.tagged


@mutant("drops-what-is-behind-chunks", "2/6", subtle=True)
class DropsWhatIsBehindChunks(_DropsBehind):
    """What comes in one segment behind a chunk is dropped."""

    opcode = BY_NAME["download_chunk"].opcode


@mutant("drops-what-is-behind-answers-to-chunks", "2/6", subtle=True)
class DropsWhatIsBehindAnswersToChunks(_DropsBehind):
    """What comes in one segment behind the answer to a chunk is dropped."""

    opcode = BY_NAME["upload_chunk"].opcode


@mutant("drops-what-is-behind-lists", "2/6", subtle=True)
class DropsWhatIsBehindLists(_DropsBehind):
    """What comes in one segment behind a part of the program list is dropped."""

    opcode = BY_NAME["list_programs"].opcode
