"""Injector: receives the bytes of one connection and returns actions.

No I/O; the caller passes the time. The bytes of a direction keep their order, so bytes after a
delayed frame are delayed, too. Without a fault, bytes are forwarded unchanged when their frame is
complete, or `PARTIAL_FRAME_S` after the last byte of an incomplete one.
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
"""Timeout of an incomplete frame; its bytes are then forwarded as other bytes."""


class InjectionNote(NamedTuple):
    """Record this note: a fault was applied in this direction."""

    direction: Direction
    note: str


class Forward(NamedTuple):
    """Forward these bytes with one write."""

    direction: Direction
    data: bytes


class HalfClose(NamedTuple):
    """Forward the half-close of this direction."""

    direction: Direction


class ResetBoth(NamedTuple):
    """Reset the connection in both directions instead of sending a frame of this direction."""

    direction: Direction


Action = InjectionNote | Forward | HalfClose | ResetBoth


class _Lane:
    """One direction: queued frames, oldest first, and outgoing bytes."""

    def __init__(self, direction: Direction) -> None:
        self.direction = direction
        self.framer = Framer(direction)
        self.frames = 0
        self.queue: deque[QueuedFrame] = deque()
        self.queued_bytes = 0
        self.outgoing = bytearray()
        self.coalescing: QueuedFrame | None = None  # waits for following frames
        self.not_before_s = -math.inf  # delay between pieces
        self.partial_deadline_s = math.inf  # of an incomplete frame

    def add(self, parcel: QueuedFrame) -> None:
        """Append a frame to the queue."""
        self.queue.append(parcel)
        self.queued_bytes += len(parcel.data)
        if parcel.followers:
            self.coalescing = parcel

    def send(self, parcel: QueuedFrame, now_s: float) -> None:
        """Send the oldest frame, or its next piece."""
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
    """Applies the rules to one connection. Actions are ordered: notes, forwards, then ends.

    Args:
        injection: The rules.
        connection: Number of the connection, counted from 1.
    """

    def __init__(self, injection: Injection, connection: int) -> None:
        self._rules = active_rules(injection, connection)
        self._lanes = {direction: _Lane(direction) for direction in Direction}
        self._frames = 0
        self._last_match: dict[Condition, int] = {  # number of the last frame that matched
            rule.fault.until: 0 for rule in injection.rules if isinstance(rule.fault, HoldBack)
        }
        self._notes: list[Action] = []
        self._ends: list[Action] = []
        self._ended = False

    @property
    def next_s(self) -> float:
        """Time of the next `tick`; infinite if none is needed."""
        if self._ended:
            return math.inf
        return min(min(self._due_s(lane), lane.partial_deadline_s) for lane in self._lanes.values())

    def queued_bytes(self, direction: Direction) -> int:
        """Return the queued bytes of a direction."""
        return self._lanes[direction].queued_bytes

    def receive(self, direction: Direction, data: bytes, now_s: float) -> list[Action]:
        """Process received bytes."""
        lane = self._lanes[direction]
        at = lane.framer.offset_bytes
        self._take(lane, lane.framer.feed(data), at, now_s)
        lane.partial_deadline_s = (
            now_s + PARTIAL_FRAME_S if lane.framer.buffered_bytes else math.inf
        )
        return self._actions()

    def finish(self, direction: Direction, now_s: float) -> list[Action]:
        """Process a half-close; it is forwarded after the queued frames."""
        lane = self._lanes[direction]
        self._give_up(lane, now_s)
        lane.add(QueuedFrame("the end", b"", now_s, now_s, is_end=True))
        self._release(now_s)
        return self._actions()

    def tick(self, now_s: float) -> list[Action]:
        """Process expired delays and timeouts."""
        for lane in self._lanes.values():
            if lane.partial_deadline_s <= now_s:
                self._give_up(lane, now_s)
        self._release(now_s)
        return self._actions()

    def flush(self) -> list[Action]:
        """Forward the queued bytes now and apply no more faults, because the connection ends."""
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
        """Stop waiting for the rest of a frame."""
        lane.partial_deadline_s = math.inf
        at = lane.framer.offset_bytes
        self._take(lane, lane.framer.finish(), at, now_s)

    def _take(self, lane: _Lane, found: Iterable[StreamItem], at: int, now_s: float) -> None:
        """Queue the items found from offset `at`, and apply the rules."""
        for item in found:
            if self._ended:
                return
            data = _bytes_of(item)
            where = f"at bytes {at}-{at + len(data) - 1}"
            at += len(data)
            if isinstance(item, Skipped):
                parcel, done = QueuedFrame(f"invalid bytes {where}", data, now_s, now_s), []
            else:
                passing = ObservedFrame.of(item)
                parcel = QueuedFrame(f"{passing} {where}", data, now_s, now_s)
                done = self._apply_rules(lane, parcel, passing)
            lane.add(parcel)
            self._release(now_s)
            if not done and not parcel.sent:
                done = ["waits for delayed frames"]
            self._notes += [
                InjectionNote(lane.direction, f"{parcel.description}: {note}") for note in done
            ]

    def _apply_rules(self, lane: _Lane, parcel: QueuedFrame, passing: ObservedFrame) -> list[str]:
        """Count a frame and apply its rules. Return the descriptions."""
        self._frames += 1
        lane.frames += 1
        parcel.number, parcel.direction_number = self._frames, lane.frames
        for condition in self._last_match:
            if condition.matches(passing):
                self._last_match[condition] = self._frames
        hits = [rule for rule in self._rules if rule.hits(passing)]  # every rule counts the frame
        gathered = lane.coalescing is not None
        return [
            done
            for hit in hits
            if not (gathered and isinstance(hit.rule.fault, Coalesce))
            if (done := hit.apply(parcel))
        ]

    def _release(self, now_s: float) -> None:
        """Send frames that are due."""
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
        """Return when a lane has a frame to send; infinite if it is empty."""
        if not lane.queue:
            return math.inf
        parcel = lane.queue[0]
        gathered = 0 < parcel.followers <= lane.frames - parcel.direction_number
        met = parcel.until is not None and self._last_match[parcel.until] > parcel.number
        return lane.not_before_s if gathered or met else max(parcel.due_s, lane.not_before_s)

    def _actions(self) -> list[Action]:
        """Return and clear the collected actions."""
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
