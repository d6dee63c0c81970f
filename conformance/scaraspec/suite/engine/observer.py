"""Observer: judges all traffic between the suite and its subject, and keeps it as evidence.

The judge that reads captures from the field also watches every case. The suite often sends invalid
data on purpose, so only findings about the subject count.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.report.model import Role
from scaraspec.report.operator_request import OperatorRequest
from scaraspec.suite.engine.expectations import Moment
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.stall_detector import Stall
from scaraspec.suite.engine.wait_budget import WaitBudget
from scaraspec.traffic.events import (
    Ending,
    Exchange,
    FrameSeen,
    InvalidBytes,
    TrafficEvent,
    UnsolicitedReply,
)
from scaraspec.traffic.wire import WireEvent

_RECENT_FRAMES: Final = 40
"""How many frames of a case are kept."""
_EVIDENCE_FRAMES: Final = 12
"""How many of them become the evidence of a case."""


@dataclass(eq=False, slots=True)
class ObservedAttempt:
    """What the observer knows about one attempt of a case.

    Attributes:
        case: The id of the case; empty between cases.
        late: The connections on which a message was missing or late.
        repeatable: The case may be repeated after this attempt.
        attended: The case may ask an operator in place of a hook.
        requests: What the operator was asked to do.
        delayed: A message that was due came after its timeout. Noted only if the attempt is not
            repeatable: such a failure proves nothing, and no further attempt can confirm it.
    """

    case: str
    late: set[str] = field(default_factory=set)
    repeatable: bool = True
    delayed: bool = False
    attended: bool = False
    requests: list[OperatorRequest] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class CaseFinding:
    """A finding of the judge during a run.

    Attributes:
        attempt: The attempt during which it was found.
        finding: The finding.
        begin_ns: When its evidence began, in nanoseconds since the Unix epoch.
        end_ns: When it was found.
        late: A message was missing or late on its connection before.
    """

    attempt: ObservedAttempt
    finding: Finding
    begin_ns: int
    end_ns: int
    late: bool

    @property
    def case(self) -> str:
        """The id of the case; empty between cases."""
        return self.attempt.case

    def spans(self, stall: Stall) -> bool:
        """Return whether this machine stalled between the evidence and the finding."""
        return self.begin_ns <= stall.end_ns and stall.begin_ns <= self.end_ns


Take = Callable[[WireEvent], None]
Handle = Callable[[TrafficEvent | Finding], None]


class Observer:
    """Watches all connections of a run.

    Args:
        role: The role of the subject.
        ics: The claims of the subject.
        needs_login: False for a serial link (L83).
        take: Called with every wire event, for a recording.
        handle: Called with every traffic event and finding, for statistics.
        interruption: Ends the run; None for a new one.

    Attributes:
        interruption: Ends the run between two steps, so that all traffic is judged exactly once.
        findings: The findings about the subject so far.
        case: The id of the running case; empty between cases.
        recent: The last frames of the running case.
        unsolicited: The last first replies that answer no request, not even a late one (A-3-16).
        budget: Limits the waits for replies that never come.
    """

    def __init__(  # noqa: PLR0913 - the collaborators of a run
        self,
        role: Role,
        ics: Ics,
        *,
        needs_login: bool = True,
        take: Take = lambda _: None,
        handle: Handle = lambda _: None,
        interruption: Interruption | None = None,
    ) -> None:
        self.interruption = interruption or Interruption()
        self.judge = Judge(
            ics.dialect,
            needs_login=needs_login,
            scope=ics.scope(sending_direction(role)),
            time_scale=ics.time_scale,
        )
        self.findings: list[CaseFinding] = []
        self.attempt = ObservedAttempt("")
        self._time_ns = 0
        self.recent: deque[FrameSeen | InvalidBytes] = deque(maxlen=_RECENT_FRAMES)
        self.unsolicited: deque[FrameSeen] = deque(maxlen=_RECENT_FRAMES)
        self._take, self._handle = take, handle
        self._ignored: tuple[str, ...] = ()
        self.budget = WaitBudget()

    @property
    def case(self) -> str:
        """The id of the running case; empty between cases."""
        return self.attempt.case

    def begin(self, case: str, *, repeatable: bool = True, attended: bool = False) -> None:
        """Begin an attempt of a case; an empty id ends it."""
        self.attempt = ObservedAttempt(case, repeatable=repeatable, attended=attended)
        self.recent.clear()

    def report_late(self, connection: str) -> None:
        """A message that was due on this connection did not arrive in time."""
        self.attempt.late.add(connection)

    def drop_stalled(self, since: int, stalls: Sequence[Stall]) -> None:
        """Drop the findings from number `since` on that span a stall of this machine."""
        kept = [s for s in self.findings[since:] if not any(map(s.spans, stalls))]
        self.findings[since:] = kept

    def event(self, event: WireEvent, *, judged: bool) -> None:
        """Record a wire event, and judge it unless its connection carries invalid bytes."""
        self._take(event)
        self._time_ns = event.time_ns
        if judged:
            self._listen(self.judge.feed(event))

    def frame(self, seen: FrameSeen | InvalidBytes) -> None:
        """Keep a frame, or invalid bytes, as evidence of the running case."""
        self.recent.append(seen)

    @property
    def unsolicited_opcodes(self) -> frozenset[int]:
        """The opcodes of the recent unsolicited replies (A-3-16)."""
        return frozenset(seen.frame.opcode for seen in self.unsolicited)

    @property
    def evidence(self) -> tuple[FrameSeen | InvalidBytes, ...]:
        """The last frames of the running case."""
        return tuple(self.recent)[-_EVIDENCE_FRAMES:]

    @property
    def moment(self) -> Moment:
        """The time of the last byte, and the last frames of the running case."""
        return Moment(self._time_ns, self.evidence)

    @contextmanager
    def ignoring(self, *requirements: str) -> Iterator[None]:
        """Ignore findings of the judge about these requirements while the context is active.

        An example: a program file is valid for the judge, but invalid for a subject whose readings
        are not detected yet.
        """
        self._ignored = requirements
        try:
            yield
        finally:
            self._ignored = ()

    def close(self) -> None:
        """End the run, and judge what is still pending."""
        self._listen(self.judge.close())

    def _listen(self, items: Iterator[TrafficEvent | Finding]) -> None:
        event: TrafficEvent | None = None
        for item in items:
            self._handle(item)
            if not isinstance(item, Finding):
                event = item
                if isinstance(item, FrameSeen):  # most items; what follows is about others
                    continue
                if (connection := _late_connection(item)) is not None:
                    self.attempt.late.add(connection)
                if isinstance(item, UnsolicitedReply) and not (item.late or item.seen.frame.tagged):
                    self.unsolicited.append(item.seen)
            elif item.requirement in self._ignored or event is None:
                continue
            elif self.judge.scope.includes(item.requirement, event):
                connections = {place.connection for place in item.evidence}
                # Invalid bytes were received: they do not rest on a missing or late message.
                late = bool(connections & self.attempt.late) and not isinstance(event, InvalidBytes)
                begin_ns = self._begin_ns(item)
                self.findings.append(CaseFinding(self.attempt, item, begin_ns, self._time_ns, late))

    def _begin_ns(self, finding: Finding) -> int:
        """When the first byte of the evidence passed."""
        begun_ns = {s.place: s.begun_ns for s in self.recent if isinstance(s, FrameSeen)}
        times_ns = [begun_ns.get(place, place.time_ns) for place in finding.evidence]
        return min(times_ns, default=self._time_ns)


def _late_connection(event: TrafficEvent) -> str | None:
    """Return the connection of this event if a message was missing or late; else None."""
    if isinstance(event, Exchange) and (event.overdue or event.ending in _MISSING):
        return event.request.place.connection
    if isinstance(event, UnsolicitedReply) and event.late:
        return event.seen.place.connection
    return None


_MISSING: Final = (Ending.UNANSWERED, Ending.UNFINISHED)


def sending_direction(role: Role) -> Direction:
    """Return the direction in which a subject of this role sends."""
    return C2A if role is Role.CONTROLLER else A2C
