"""Observer: all that passes between the suite and its subject, judged and kept as evidence.

Every case is watched by the judge that also reads captures from the field. What the suite itself
sends is often wrong on purpose: only what the subject did counts.
"""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from scaraspec.judge.judge import Judge
from scaraspec.judge.requirements import REQUIREMENTS, Binds
from scaraspec.judge.rules.rule import sender_of
from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.report.model import Role
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.traffic.events import (
    Exchange,
    FrameSeen,
    InvalidBytes,
    TrafficEvent,
    Transfer,
    UnsolicitedReply,
)
from scaraspec.traffic.wire import WireEvent

_RECENT_FRAMES: Final = 40
"""Frames of a case that are remembered, for it to look at."""
_EVIDENCE_FRAMES: Final = 12
"""How many of them are kept as evidence of what it did last."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """What the judge found while a case ran."""

    case: str
    finding: Finding


Take = Callable[[WireEvent], None]
Hear = Callable[[TrafficEvent | Finding], None]


class Observer:
    """Watches all connections of a run.

    Args:
        role: What the subject is.
        ics: What it claims.
        needs_login: False for a serial link (L83).
        take: Is given every wire event: a recording.
        hear: Is given what happened and what is wrong with it: statistics.

    Attributes:
        interruption: Ends the run; not within it, so that what passes is kept and judged, once.
    """

    def __init__(  # noqa: PLR0913 - the collaborators of a run
        self,
        role: Role,
        ics: Ics,
        *,
        needs_login: bool = True,
        take: Take = lambda _: None,
        hear: Hear = lambda _: None,
        interruption: Interruption | None = None,
    ) -> None:
        self.interruption = interruption or Interruption()
        self.judge = Judge(ics.dialect, needs_login=needs_login)
        self.sightings: list[Sighting] = []
        self.case = ""
        self.recent: deque[FrameSeen | InvalidBytes] = deque(maxlen=_RECENT_FRAMES)
        self.unsolicited: deque[FrameSeen] = deque(maxlen=_RECENT_FRAMES)
        """The last first replies that answer nothing, not even late (A-3-16)."""
        self._role, self._beyond = role, ics.undecidable_requirements
        self._take, self._hear = take, hear
        self._overlooked = ""

    def begin(self, case: str) -> None:
        """A case begins."""
        self.case = case
        self.recent.clear()

    def event(self, event: WireEvent, *, judged: bool) -> None:
        """Something passed; a connection that is not judged carries what is no protocol."""
        self._take(event)
        if judged:
            self._listen(self.judge.feed(event))

    def frame(self, seen: FrameSeen | InvalidBytes) -> None:
        """A frame, or bytes that are none, passed: evidence of the running case."""
        self.recent.append(seen)

    @property
    def unsolicited_opcodes(self) -> frozenset[int]:
        """The opcodes of what the subject has told of itself lately (A-3-16)."""
        return frozenset(seen.frame.opcode for seen in self.unsolicited)

    @property
    def evidence(self) -> tuple[FrameSeen | InvalidBytes, ...]:
        """What passed last in the running case."""
        return tuple(self.recent)[-_EVIDENCE_FRAMES:]

    @contextmanager
    def ignoring(self, requirement: str) -> Iterator[None]:
        """Ignore findings of the judge about this requirement in the body.

        For what the judge cannot know: that a file which it takes for right need not be right for
        a subject whose readings are not found out yet.
        """
        self._overlooked = requirement
        try:
            yield
        finally:
            self._overlooked = ""

    def close(self) -> None:
        """The run has ended."""
        self._listen(self.judge.close())

    def _listen(self, items: Iterator[TrafficEvent | Finding]) -> None:
        happening: TrafficEvent | None = None
        for item in items:
            self._hear(item)
            if not isinstance(item, Finding):
                happening = item
                if isinstance(item, UnsolicitedReply) and not (item.late or item.seen.frame.tagged):
                    self.unsolicited.append(item.seen)
            elif item.requirement in (self._overlooked, *self._beyond) or happening is None:
                continue
            elif blamed(item, happening) is self._role:
                self.sightings.append(Sighting(self.case, item))


def speaks(role: Role) -> Direction:
    """The direction in which a subject of this role sends."""
    return C2A if role is Role.CONTROLLER else A2C


def blamed(finding: Finding, happening: TrafficEvent) -> Role | None:
    """Whose finding it is, which may be the suite as the other end; None if unknown."""
    binds = REQUIREMENTS[finding.requirement].binds
    if binds is not Binds.BOTH:
        return Role.CONTROLLER if binds is Binds.CONTROLLER else Role.CLIENT
    if isinstance(happening, Transfer):
        return Role.CLIENT if happening.upload else Role.CONTROLLER
    if isinstance(happening, Exchange):
        return Role.CLIENT if happening.name == "upload_chunk" else Role.CONTROLLER
    sender = sender_of(happening)
    return None if sender is None else Role.CONTROLLER if sender is C2A else Role.CLIENT
