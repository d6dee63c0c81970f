"""Injector: the bytes of one connection in, what is to be done with them out.

Law: pure. Time comes in, nothing is waited for. The bytes of a direction keep their order, so what
comes behind a frame that waits, waits too. Where no fault hits, every byte goes on unchanged, at
the latest when its frame is complete or `PARTIAL_FRAME_S` after the last byte of an unfinished one.
"""

import math
from collections import deque
from collections.abc import Iterable
from itertools import takewhile
from typing import Final, NamedTuple

from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import Frame, Framer, Skipped, StreamItem
from scaraspec_recorder.fault_injection.conditions import Condition, ObservedFrame
from scaraspec_recorder.fault_injection.faults import Coalesce, HoldBack, QueuedFrame
from scaraspec_recorder.fault_injection.rules import Injection, active_rules

PARTIAL_FRAME_S: Final = 0.2
"""How long the rest of a frame is waited for; then what there is goes on as bytes that are none."""


class InjectionNote(NamedTuple):
    """Something was done to what came in this direction: to be recorded."""

    direction: Direction
    note: str


class Forward(NamedTuple):
    """These bytes are to be passed on, as one piece."""

    direction: Direction
    data: bytes


class HalfClose(NamedTuple):
    """All of this direction has been passed on: now its end is to be."""

    direction: Direction


class ResetBoth(NamedTuple):
    """The connection is to be reset, both ways, in the place of a frame of this direction."""

    direction: Direction


Action = InjectionNote | Forward | HalfClose | ResetBoth


class _Lane:
    """One direction: what waits, the oldest first, and what goes."""

    def __init__(self, direction: Direction) -> None:
        self.direction = direction
        self.framer = Framer(direction)
        self.frames = 0
        self.queue: deque[QueuedFrame] = deque()
        self.queued_bytes = 0
        self.outgoing = bytearray()
        self.coalescing: QueuedFrame | None = None  # waits for those behind it
        self.not_before_s = -math.inf  # pieces of a frame are apart
        self.partial_deadline_s = math.inf  # with an unfinished frame

    def add(self, parcel: QueuedFrame) -> None:
        """Put it behind all others."""
        self.queue.append(parcel)
        self.queued_bytes += len(parcel.data)
        if parcel.followers:
            self.coalescing = parcel

    def send(self, parcel: QueuedFrame, now_s: float) -> None:
        """Send the oldest parcel, or its next piece."""
        size_bytes = parcel.piece_bytes or len(parcel.data)
        piece, parcel.data = parcel.data[:size_bytes], parcel.data[size_bytes:]
        self.outgoing += piece
        self.queued_bytes -= len(piece)
        if parcel.data:
            self.not_before_s = now_s + parcel.gap_s
            return
        self.queue.popleft()
        parcel.sent = True
        if parcel is self.coalescing:
            self.coalescing = None


class Injector:
    """Follows one connection. What it gives is in the order: told, forward, ended or cut.

    Args:
        injection: What may happen.
        connection: Its number, counted from 1.
    """

    def __init__(self, injection: Injection, connection: int) -> None:
        self._rules = active_rules(injection, connection)
        self._lanes = {direction: _Lane(direction) for direction in Direction}
        self._frames = 0
        self._last_match: dict[
            Condition, int
        ] = {  # by what is waited for: the last frame that met it
            rule.fault.until: 0 for rule in injection.rules if isinstance(rule.fault, HoldBack)
        }
        self._notes: list[Action] = []
        self._ends: list[Action] = []
        self._ended = False

    @property
    def next_s(self) -> float:
        """When `tick` is to be called; infinite where nothing waits for a time."""
        if self._ended:
            return math.inf
        return min(min(self._due_s(lane), lane.partial_deadline_s) for lane in self._lanes.values())

    def queued_bytes(self, direction: Direction) -> int:
        """How much of a direction waits."""
        return self._lanes[direction].queued_bytes

    def receive(self, direction: Direction, data: bytes, now_s: float) -> list[Action]:
        """Bytes have come."""
        lane = self._lanes[direction]
        at = lane.framer.offset_bytes
        self._take(lane, lane.framer.feed(data), at, now_s)
        lane.partial_deadline_s = now_s + PARTIAL_FRAME_S if lane.framer.held_bytes else math.inf
        return self._actions()

    def finish(self, direction: Direction, now_s: float) -> list[Action]:
        """A sender sends no more; its end is passed on behind what waits."""
        lane = self._lanes[direction]
        self._give_up(lane, now_s)
        lane.add(QueuedFrame("the end", b"", now_s, now_s, is_end=True))
        self._release(now_s)
        return self._actions()

    def tick(self, now_s: float) -> list[Action]:
        """Time has passed."""
        for lane in self._lanes.values():
            if lane.partial_deadline_s <= now_s:
                self._give_up(lane, now_s)
        self._release(now_s)
        return self._actions()

    def flush(self) -> list[Action]:
        """The connection ends: what waits goes at once, and nothing is done after that."""
        for lane in () if self._ended else self._lanes.values():
            waiting = takewhile(lambda parcel: not parcel.cut, lane.queue)
            data = b"".join(parcel.data for parcel in waiting)
            if data:
                note = f"the connection ends: {len(data)} bytes that waited are passed on at once"
                self._notes.append(InjectionNote(lane.direction, note))
            lane.outgoing += data + b"".join(map(_bytes_of, lane.framer.finish()))
        self._ended = True
        return self._actions()

    def _give_up(self, lane: _Lane, now_s: float) -> None:
        """Wait no longer for the rest of a frame."""
        lane.partial_deadline_s = math.inf
        at = lane.framer.offset_bytes
        self._take(lane, lane.framer.finish(), at, now_s)

    def _take(self, lane: _Lane, found: Iterable[StreamItem], at: int, now_s: float) -> None:
        """Put what was found from offset `at` on its way, and do to it what is due."""
        for item in found:
            if self._ended:
                return
            data = _bytes_of(item)
            where = f"at bytes {at}-{at + len(data) - 1}"
            at += len(data)
            if isinstance(item, Skipped):
                parcel, done = QueuedFrame(f"no frame {where}", data, now_s, now_s), []
            else:
                passing = ObservedFrame.of(item)
                parcel = QueuedFrame(f"{passing} {where}", data, now_s, now_s)
                done = self._apply_rules(lane, parcel, passing)
            lane.add(parcel)
            self._release(now_s)
            if not done and not parcel.sent:
                done = ["waits behind what is held up"]
            self._notes += [
                InjectionNote(lane.direction, f"{parcel.description}: {note}") for note in done
            ]

    def _apply_rules(self, lane: _Lane, parcel: QueuedFrame, passing: ObservedFrame) -> list[str]:
        """Count a frame and do to it the faults that hit it; return what was done."""
        self._frames += 1
        lane.frames += 1
        parcel.number, parcel.direction_number = self._frames, lane.frames
        for condition in self._last_match:
            if condition.matches(passing):
                self._last_match[condition] = self._frames
        hits = [rule for rule in self._rules if rule.hits(passing)]  # all of them count
        gathered = lane.coalescing is not None
        return [
            done
            for hit in hits
            if not (gathered and isinstance(hit.rule.fault, Coalesce))
            if (done := hit.apply(parcel))
        ]

    def _release(self, now_s: float) -> None:
        """Send what is due."""
        for lane in self._lanes.values():
            while not self._ended and self._due_s(lane) <= now_s:
                parcel = lane.queue[0]
                if parcel.cut:
                    self._ends.append(ResetBoth(lane.direction))
                    self._ended = True
                    return
                if parcel.is_end:
                    self._ends.append(HalfClose(lane.direction))
                lane.send(parcel, now_s)
                if parcel.sent and (parcel.followers or parcel.until):
                    waited_ms = (now_s - parcel.received_s) * 1000
                    note = f"{parcel.description}: passed on after {waited_ms:.0f} ms"
                    self._notes.append(InjectionNote(lane.direction, note))

    def _due_s(self, lane: _Lane) -> float:
        """When a lane has something to send; infinite where nothing is in it."""
        if not lane.queue:
            return math.inf
        parcel = lane.queue[0]
        gathered = 0 < parcel.followers <= lane.frames - parcel.direction_number
        met = parcel.until is not None and self._last_match[parcel.until] > parcel.number
        return lane.not_before_s if gathered or met else max(parcel.due_s, lane.not_before_s)

    def _actions(self) -> list[Action]:
        """Give what has come together, once."""
        actions = self._notes
        for lane in self._lanes.values():
            if lane.outgoing:
                actions.append(Forward(lane.direction, bytes(lane.outgoing)))
                lane.outgoing.clear()
        actions += self._ends
        self._notes, self._ends = [], []
        return actions


def _bytes_of(item: StreamItem) -> bytes:
    return item.encode() if isinstance(item, Frame) else item.data
