"""The ring: the last seconds of everything in memory, and an incident file for each trigger.

Law: what an output is given is kept as it is, events and what they brought about, so an incident
that begins in the middle of a session says what was judged with all that came before in mind. The
ring is bounded in time and in bytes, incidents in number; what gets no file is counted.

The ring is in memory alone. A writing process that dies takes it along, and the next one is told
again what was in it; an incident that was being written then gets a second file, which is whole.
"""

import logging
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from scaraspec.judgement.happenings import Transfer
from scaraspec.judgement.wire import WireEvent
from scaraspec_recorder.deriving.deriver import Item, Output
from scaraspec_recorder.deriving.wording import Line
from scaraspec_recorder.keeping.contents import TRIGGER
from scaraspec_recorder.keeping.file_sets import FileSet, Shelf
from scaraspec_recorder.keeping.seams import Links, moment
from scaraspec_recorder.keeping.triggers import Watcher
from scaraspec_recorder.quantities import SECOND_NS

MOST_A_MINUTE: Final = 6
MOST_AT_ONCE: Final = 4
"""Incidents that get a file; triggers beyond that are counted."""

_MINUTE_NS: Final = 60 * SECOND_NS
_EVENT_BYTES: Final = 300  # what an event and an item take in memory, as measured, roughly
_ITEM_BYTES: Final = 600
_COPIES: Final = 3  # of the bytes: raw, in frames, decoded

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Moment:
    """An event, and what it brought about as outputs are told."""

    event: WireEvent
    items: list[tuple[Item, int, Line | None]] = field(default_factory=list)
    size_bytes: int = 0


class Ring:
    """The last moments.

    Args:
        limit_ns: For how long they are kept.
        limit_bytes: How much memory they may take, roughly; the latest is kept in any case.
    """

    def __init__(self, limit_ns: int, limit_bytes: int) -> None:
        self._limit_ns = limit_ns
        self._limit_bytes = limit_bytes
        self._moments: deque[_Moment] = deque()
        self._before = Links()  # as they were before the first moment
        self.size_bytes = 0
        """What the moments take in memory, roughly."""

    @property
    def count(self) -> int:
        """How many moments it holds."""
        return len(self._moments)

    @property
    def since_ns(self) -> int | None:
        """When the first of them was; None where it holds none."""
        return self._moments[0].event.time_ns if self._moments else None

    def write(self, event: WireEvent) -> None:
        """Keep an event."""
        self._moments.append(_Moment(event))
        self._charge(_EVENT_BYTES + _COPIES * len(event.data))
        self.forget(event.time_ns)

    def take(self, item: Item, number: int, line: Line | None) -> None:
        """Keep what the last event brought about."""
        if self._moments:
            self._moments[-1].items.append((item, number, line))
            content_bytes = len(item.content) if isinstance(item, Transfer) else 0
            self._charge(_ITEM_BYTES + content_bytes)

    def forget(self, now_ns: int) -> None:
        """Let go what is too old or too much."""
        moments = self._moments
        while moments and (
            now_ns - moments[0].event.time_ns > self._limit_ns
            or (self.size_bytes > self._limit_bytes and len(moments) > 1)
        ):
            oldest = moments.popleft()
            self.size_bytes -= oldest.size_bytes
            self._before.follow(oldest.event)

    def replay(self, output: Output, now_ns: int) -> None:
        """Give another output all that is kept, from the connections that were open on."""
        begin_ns = now_ns if self.since_ns is None else self.since_ns
        for opened in self._before.reopened(begin_ns):
            output.write(opened)
        for kept in self._moments:
            output.write(kept.event)
            for item in kept.items:
                output.take(*item)

    def _charge(self, size_bytes: int) -> None:
        self._moments[-1].size_bytes += size_bytes
        self.size_bytes += size_bytes


@dataclass(slots=True)
class _Incident:
    """An incident whose file is being written."""

    trigger: str
    files: FileSet
    begun_ns: int
    since_ns: int  # when the first moment in it was
    fired: Counter[str] = field(default_factory=Counter)

    def close(self) -> None:
        self.files.close({"triggers": _counts(self.fired)})


class Incidents:
    """An output that keeps a ring, and writes a file for each trigger.

    A trigger whose file is still being written is in that file, and begins no other.

    Args:
        shelf: Where the files are put.
        ring: What came before.
        watchers: The triggers, by their texts.
        after_ns: For how long an incident goes on.

    Attributes:
        recalled_until_ns: Where what comes is told again after a death, until when it is; else
            None. Of the incidents in it, those that were over by then are not written again.
    """

    def __init__(
        self, shelf: Shelf, ring: Ring, watchers: Mapping[str, Watcher], after_ns: int
    ) -> None:
        self._shelf = shelf
        self._ring = ring
        self._watchers = watchers
        self._after_ns = after_ns
        self.recalled_until_ns: int | None = None
        self._over_ns: dict[str, int] = {}  # when incidents began that are not written again
        self._now_ns = 0  # on the clock of the events, which may lag behind that of the ticks
        self._heard = False
        self._incidents: list[_Incident] = []
        self._begun_ns: deque[int] = deque(maxlen=MOST_A_MINUTE)
        self._missed: Counter[str] = Counter()

    @property
    def since_ns(self) -> int | None:
        """Since when what passed is needed to begin an incident, or those under way, again."""
        begun = [incident.since_ns for incident in self._incidents]
        kept = [] if self._ring.since_ns is None else [self._ring.since_ns]
        return min((*begun, *kept), default=None)

    def write(self, event: WireEvent) -> None:
        """Take a raw event."""
        self._heard = True
        self._go_on(event.time_ns)
        self._ring.write(event)
        for incident in self._incidents:
            incident.files.write(event)
        for trigger, watcher in self._watchers.items():
            if why := watcher.event(event):
                self._fire(trigger, why)

    def take(self, item: Item, number: int, line: Line | None) -> None:
        """Take what it brought about."""
        self._ring.take(item, number, line)
        for incident in self._incidents:
            incident.files.take(item, number, line)
        for trigger, watcher in self._watchers.items():
            if why := watcher.item(item):
                self._fire(trigger, why)

    def tick(self, now_ns: int) -> None:
        """Make incidents durable; where nothing came since the last tick, time has passed."""
        if not self._heard:
            self._go_on(now_ns)
            self._ring.forget(now_ns)
        self._heard = False
        for trigger, watcher in self._watchers.items():
            if why := watcher.clock(self._now_ns):
                self._fire(trigger, why)
        for incident in self._incidents:
            incident.files.tick(now_ns)

    def close(self, summary: Mapping[str, str]) -> None:  # noqa: ARG002 - an incident is a part of it
        """End all incidents."""
        for incident in self._incidents:
            incident.close()
        if self._missed:
            _log.warning("triggers without a file of their own: %s", _counts(self._missed))

    def _go_on(self, now_ns: int) -> None:
        """It is so late: end the incidents that are over, also those that a clock set back left."""
        self._now_ns = now_ns
        for incident in self._incidents.copy():
            if not incident.begun_ns - _MINUTE_NS <= now_ns <= incident.begun_ns + self._after_ns:
                self._incidents.remove(incident)
                incident.close()

    def _fire(self, trigger: str, why: str) -> None:
        """A trigger fired: begin an incident, or count it."""
        if self._is_over(trigger):
            return
        same = [incident for incident in self._incidents if incident.trigger == trigger]
        if not same and self._has_room():
            self._incidents.append(self._begin(trigger, why))
        elif not same:
            self._missed[trigger] += 1
        for incident in self._incidents:
            incident.fired[trigger] += 1

    def _is_over(self, trigger: str) -> bool:
        """Whether this is of an incident whose file was complete before a death."""
        until_ns, now_ns = self.recalled_until_ns, self._now_ns
        if until_ns is None:
            return False
        begun_ns = self._over_ns.get(trigger)
        if begun_ns is not None and now_ns <= begun_ns + self._after_ns:
            return True
        if now_ns + self._after_ns >= until_ns:
            return False
        self._over_ns[trigger] = now_ns
        return True

    def _has_room(self) -> bool:
        begun_ns = self._begun_ns
        full = len(begun_ns) == MOST_A_MINUTE and 0 <= self._now_ns - begun_ns[0] < _MINUTE_NS
        return not full and len(self._incidents) < MOST_AT_ONCE

    def _begin(self, trigger: str, why: str) -> _Incident:
        now_ns = self._now_ns
        facts = {
            TRIGGER: trigger,
            "triggered at": f"{moment(now_ns):%Y-%m-%d %H:%M:%S} UTC",
            "triggered at time_ns": str(now_ns),
            "triggered by": why,
            **({"earlier triggers without a file": _counts(self._missed)} if self._missed else {}),
        }
        files = self._shelf.begin(now_ns, trigger, facts)
        _log.warning("%s (%s): recorded in %s", trigger, why, files.path.name)
        since_ns = now_ns if self._ring.since_ns is None else self._ring.since_ns
        self._ring.replay(files, now_ns)
        self._begun_ns.append(now_ns)
        self._missed.clear()
        return _Incident(trigger, files, now_ns, since_ns)


def _counts(triggers: Counter[str]) -> str:
    return ", ".join(f"{count} x {trigger}" for trigger, count in triggers.items())
