"""Deadline: a point in time at which a wait ends, on the clock of the subject.

A loop that queries the subject uses it, so that the duration of the queries counts, too.
"""

from typing import Final, Protocol

_NS: Final = 1e9
_POLL_S: Final = 0.05
_POLL_SHARE: Final = 0.02


class Clock(Protocol):
    """A clock, such as that of the subject."""

    @property
    def now_ns(self) -> int:
        """The current time in nanoseconds."""


class Deadline:
    """A point in time.

    Args:
        clock: The clock, real or simulated.
        after_s: The time from now to the deadline, in seconds.
    """

    def __init__(self, clock: Clock, after_s: float) -> None:
        self._clock, self._begun_ns = clock, clock.now_ns
        self._at_ns = self._begun_ns + round(after_s * _NS)

    @property
    def remaining_s(self) -> float:
        """The time until the deadline, in seconds; 0 after it."""
        return max(self._at_ns - self._clock.now_ns, 0) / _NS

    @property
    def poll_s(self) -> float:
        """The pause before the next query, in seconds: at least 2 % of the time waited."""
        return max(_POLL_S, _POLL_SHARE * (self._clock.now_ns - self._begun_ns) / _NS)

    @property
    def expired(self) -> bool:
        """Whether the deadline has passed."""
        return not self.remaining_s
