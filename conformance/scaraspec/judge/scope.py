"""Scope: which findings count. It names the subject and what cannot be decided for it.

Belongs here: which side a requirement concerns in a traffic event. The rules decide what conforms;
they know no subject. The suite, which violates requirements on purpose, and the audit of a capture
use the same scope.
"""

from dataclasses import dataclass
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS, Binds
from scaraspec.judge.rules.rule import sender_of
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.events import Exchange, TrafficEvent
from scaraspec.traffic.selection import EVERYTHING as ALL_TRAFFIC
from scaraspec.traffic.selection import Selection

_SIDES: Final = {Binds.CLIENT: A2C, Binds.CONTROLLER: C2A}


@dataclass(frozen=True, slots=True)
class Scope:
    """What of the traffic is judged.

    Attributes:
        side: The direction in which the subject sends; None if both sides are subjects.
        undecidable: The requirements that the judge cannot decide for this subject.
        unsupported: The commands that the controller does not support. Their exchanges say nothing
            about the controller, except that a reply refutes the claim.
        only: The requirements that are judged; None for all.
        selection: The traffic that is judged. The judge omits findings about other traffic.
    """

    side: Direction | None = None
    undecidable: frozenset[str] = frozenset()
    unsupported: frozenset[str] = frozenset()
    only: frozenset[str] | None = None
    selection: Selection = ALL_TRAFFIC

    def binds(self, requirement: str) -> bool:
        """Return whether a requirement is judged and binds the subject."""
        if self.only is not None and requirement not in self.only:
            return False
        return self.side in (None, _SIDES.get(REQUIREMENTS[requirement].binds, self.side))

    def concerns(self, requirement: str, event: TrafficEvent) -> bool:
        """Return whether a finding about this event is about the subject."""
        return self.side is None or responsible_side(requirement, event) in (None, self.side)

    def includes(self, requirement: str, event: TrafficEvent) -> bool:
        """Return whether a finding about this event counts, if the event is selected."""
        if self.only is not None and requirement not in self.only:
            return False
        if requirement in self.undecidable or not self.concerns(requirement, event):
            return False
        unsupported = isinstance(event, Exchange) and event.name in self.unsupported
        return not (unsupported and responsible_side(requirement, event) is C2A)


EVERYTHING: Final = Scope()
"""Both sides are judged, without claims."""


def responsible_side(requirement: str, event: TrafficEvent) -> Direction | None:
    """Return the side that a finding about this event is about; None for both sides, as in 2/1."""
    binds = REQUIREMENTS[requirement].binds
    if binds is not Binds.BOTH:
        return _SIDES[binds]
    if isinstance(event, Exchange):
        return A2C if event.name == "upload_chunk" else C2A
    return sender_of(event)
