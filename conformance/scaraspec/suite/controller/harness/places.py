"""Places: when a controller may refuse a client because another one has just left (A-2-11).

A controller may serve a limited number of clients, and notice only later that one has left.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.expectations import NoReply
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest

RECONNECT_S: Final = 0.1
"""How long to wait, in seconds, before the next try to connect."""

_RELEASE_S: Final = 2.5  # after a client has left, another one may be refused for this time
_FEW_CLIENTS: Final = 2  # a controller may serve no more at the same time
_NS: Final = 1e9


class Places:
    """The places for clients of a controller."""

    def __init__(self, subject: "ControllerUnderTest") -> None:
        self._subject = subject

    def may_refuse_until_ns(self, lines: Sequence[OutgoingConnection], *, login: bool) -> int:
        """Return until when a new client may be refused, in nanoseconds; 0 if it must be served.

        A controller that serves several clients refuses another one only if open and recently
        closed connections reach its limit.

        Args:
            lines: The last connections.
            login: Whether the new client will log in.
        """
        subject = self._subject
        if not subject.access.detects_close:
            return 0
        open_count = sum(not line.ended for line in lines)
        release_ns = round(_RELEASE_S * _NS)
        if self._may_serve_one and not open_count:
            return subject.now_ns + release_ns
        recent = [each for each in _closings_ns(lines) if each > subject.now_ns - release_ns]
        if not recent or open_count + len(recent) < _FEW_CLIENTS:
            return 0
        closes_late = subject.traits.closes_late
        if closes_late and max(recent) > subject.now_ns - round(RECONNECT_S * _NS):
            subject.pause(RECONNECT_S)
        incomplete = any(line.mid_frame for line in lines if not line.ended)
        waits = login or (closes_late and not incomplete)
        waits = waits and subject.dialect["max_clients"] == "many"
        return max(recent) + release_ns if waits or not open_count else 0

    @property
    def _may_serve_one(self) -> bool:
        """Whether it serves one client at a time, or this is not known yet (A-2-2)."""
        subject = self._subject
        known = {*subject.detected_readings, *subject.ics.claimed}
        return subject.dialect["max_clients"] == "one" or "max_clients" not in known

    def note_refusals(
        self, lines: Sequence[OutgoingConnection], refusals: Sequence[NoReply]
    ) -> None:
        """Note that a client was served after refusals; report once if it took long.

        Args:
            lines: The last connections.
            refusals: The refusals, at least one.

        Raises:
            NoReply: The refusals do not depend on how long ago another client has left.
        """
        subject, traits = self._subject, self._subject.traits
        lasting = len(refusals) > 1
        if lasting and not traits.releases_late:
            closed_ns = max(_closings_ns(lines), default=subject.now_ns)
            text = "a client is refused for {release_s:.1f} s after another one has left (A-2-11)"
            subject.notify(UserMessage(text, release_s=(subject.now_ns - closed_ns) / _NS))
        elif traits.closes_late and not (lasting or traits.releases_late or self._may_serve_one):
            subject.close_lines()
            raise refusals[0]
        traits.closes_late, traits.releases_late = True, lasting or traits.releases_late


def _closings_ns(lines: Sequence[OutgoingConnection]) -> list[int]:
    """Return when connections were closed."""
    return [line.closed_ns for line in lines if line.closed]
