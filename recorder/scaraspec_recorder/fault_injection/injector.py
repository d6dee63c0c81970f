"""Injector: the bytes of one connection in, what is to be done with them out.

Law: pure. Time comes in, nothing is waited for. The bytes of a direction keep their order, so what
comes behind a frame that waits, waits too. Where no fault hits, every byte goes on unchanged, at
the latest when its frame is complete or `PATIENCE_S` after the last byte of an unfinished one.
"""

import math
from collections import deque
from collections.abc import Iterable
from itertools import takewhile
from typing import Final, NamedTuple

from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import Frame, Framer, Skipped, StreamItem
from scaraspec_recorder.fault_injection.conditions import Condition, Passing
from scaraspec_recorder.fault_injection.faults import Coalesce, HoldBack, Parcel
from scaraspec_recorder.fault_injection.rules import Injection, at_work

PATIENCE_S: Final = 0.2
"""How long the rest of a frame is waited for; then what there is goes on as bytes that are none."""


class Told(NamedTuple):
    """Something was done to what came in this direction: to be recorded."""

    direction: Direction
    note: str


class Forward(NamedTuple):
    """These bytes are to be passed on, as one piece."""

    direction: Direction
    data: bytes


class Ended(NamedTuple):
    """All of this direction has been passed on: now its end is to be."""

    direction: Direction


class Cut(NamedTuple):
    """The connection is to be reset, both ways, in the place of a frame of this direction."""

    direction: Direction


Action = Told | Forward | Ended | Cut


class _Lane:
    """One direction: what waits, the oldest first, and what goes."""

    def __init__(self, direction: Direction) -> None:
        self.direction = direction
        self.framer = Framer(direction)
        self.frames = 0
        self.waiting: deque[Parcel] = deque()
        self.waiting_bytes = 0
        self.going = bytearray()
        self.gathering: Parcel | None = None  # waits for those behind it
        self.not_before_s = -math.inf  # pieces of a frame are apart
        self.patient_until_s = math.inf  # with an unfinished frame

    def add(self, parcel: Parcel) -> None:
        """Put it behind all others."""
        self.waiting.append(parcel)
        self.waiting_bytes += len(parcel.data)
        if parcel.followers:
            self.gathering = parcel

    def send(self, parcel: Parcel, now_s: float) -> None:
        """Send the oldest parcel, or its next piece."""
        size_bytes = parcel.piece_bytes or len(parcel.data)
        piece, parcel.data = parcel.data[:size_bytes], parcel.data[size_bytes:]
        self.going += piece
        self.waiting_bytes -= len(piece)
        if parcel.data:
            self.not_before_s = now_s + parcel.gap_s
            return
        self.waiting.popleft()
        parcel.gone = True
        if parcel is self.gathering:
            self.gathering = None


class Injector:
    """Follows one connection. What it gives is in the order: told, forward, ended or cut.

    Args:
        injection: What may happen.
        connection: Its number, counted from 1.
    """

    def __init__(self, injection: Injection, connection: int) -> None:
        self._rules = at_work(injection, connection)
        self._lanes = {direction: _Lane(direction) for direction in Direction}
        self._frames = 0
        self._met: dict[Condition, int] = {  # by what is waited for: the last frame that met it
            rule.fault.until: 0 for rule in injection.rules if isinstance(rule.fault, HoldBack)
        }
        self._told: list[Action] = []
        self._ends: list[Action] = []
        self._over = False

    @property
    def next_s(self) -> float:
        """When `tick` is to be called; infinite where nothing waits for a time."""
        if self._over:
            return math.inf
        return min(min(self._due_s(lane), lane.patient_until_s) for lane in self._lanes.values())

    def waiting_bytes(self, direction: Direction) -> int:
        """How much of a direction waits."""
        return self._lanes[direction].waiting_bytes

    def receive(self, direction: Direction, data: bytes, now_s: float) -> list[Action]:
        """Bytes have come."""
        lane = self._lanes[direction]
        at = lane.framer.offset_bytes
        self._take(lane, lane.framer.feed(data), at, now_s)
        lane.patient_until_s = now_s + PATIENCE_S if lane.framer.held_bytes else math.inf
        return self._actions()

    def finish(self, direction: Direction, now_s: float) -> list[Action]:
        """A sender sends no more; its end is passed on behind what waits."""
        lane = self._lanes[direction]
        self._give_up(lane, now_s)
        lane.add(Parcel("the end", b"", now_s, now_s, ends=True))
        self._release(now_s)
        return self._actions()

    def tick(self, now_s: float) -> list[Action]:
        """Time has passed."""
        for lane in self._lanes.values():
            if lane.patient_until_s <= now_s:
                self._give_up(lane, now_s)
        self._release(now_s)
        return self._actions()

    def flush(self) -> list[Action]:
        """The connection ends: what waits goes at once, and nothing is done after that."""
        for lane in () if self._over else self._lanes.values():
            waiting = takewhile(lambda parcel: not parcel.cut, lane.waiting)
            data = b"".join(parcel.data for parcel in waiting)
            if data:
                note = f"the connection ends: {len(data)} bytes that waited are passed on at once"
                self._told.append(Told(lane.direction, note))
            lane.going += data + b"".join(map(_bytes_of, lane.framer.finish()))
        self._over = True
        return self._actions()

    def _give_up(self, lane: _Lane, now_s: float) -> None:
        """Wait no longer for the rest of a frame."""
        lane.patient_until_s = math.inf
        at = lane.framer.offset_bytes
        self._take(lane, lane.framer.finish(), at, now_s)

    def _take(self, lane: _Lane, found: Iterable[StreamItem], at: int, now_s: float) -> None:
        """Put what was found from offset `at` on its way, and do to it what is due."""
        for item in found:
            if self._over:
                return
            data = _bytes_of(item)
            where = f"at bytes {at}-{at + len(data) - 1}"
            at += len(data)
            if isinstance(item, Skipped):
                parcel, done = Parcel(f"no frame {where}", data, now_s, now_s), []
            else:
                passing = Passing.of(item)
                parcel = Parcel(f"{passing} {where}", data, now_s, now_s)
                done = self._hit(lane, parcel, passing)
            lane.add(parcel)
            self._release(now_s)
            if not done and not parcel.gone:
                done = ["waits behind what is held up"]
            self._told += [Told(lane.direction, f"{parcel.what}: {note}") for note in done]

    def _hit(self, lane: _Lane, parcel: Parcel, passing: Passing) -> list[str]:
        """Count a frame and do to it the faults that hit it; return what was done."""
        self._frames += 1
        lane.frames += 1
        parcel.number, parcel.place = self._frames, lane.frames
        for condition in self._met:
            if condition.holds(passing):
                self._met[condition] = self._frames
        hits = [rule for rule in self._rules if rule.hits(passing)]  # all of them count
        gathered = lane.gathering is not None
        return [
            done
            for hit in hits
            if not (gathered and isinstance(hit.rule.fault, Coalesce))
            if (done := hit.apply(parcel))
        ]

    def _release(self, now_s: float) -> None:
        """Send what is due."""
        for lane in self._lanes.values():
            while not self._over and self._due_s(lane) <= now_s:
                parcel = lane.waiting[0]
                if parcel.cut:
                    self._ends.append(Cut(lane.direction))
                    self._over = True
                    return
                if parcel.ends:
                    self._ends.append(Ended(lane.direction))
                lane.send(parcel, now_s)
                if parcel.gone and (parcel.followers or parcel.until):
                    waited_ms = (now_s - parcel.begun_s) * 1000
                    note = f"{parcel.what}: passed on after {waited_ms:.0f} ms"
                    self._told.append(Told(lane.direction, note))

    def _due_s(self, lane: _Lane) -> float:
        """When a lane has something to send; infinite where nothing is in it."""
        if not lane.waiting:
            return math.inf
        parcel = lane.waiting[0]
        gathered = 0 < parcel.followers <= lane.frames - parcel.place
        met = parcel.until is not None and self._met[parcel.until] > parcel.number
        return lane.not_before_s if gathered or met else max(parcel.due_s, lane.not_before_s)

    def _actions(self) -> list[Action]:
        """Give what has come together, once."""
        actions = self._told
        for lane in self._lanes.values():
            if lane.going:
                actions.append(Forward(lane.direction, bytes(lane.going)))
                lane.going.clear()
        actions += self._ends
        self._told, self._ends = [], []
        return actions


def _bytes_of(item: StreamItem) -> bytes:
    return item.encode() if isinstance(item, Frame) else item.data
