"""Time estimate: how long the rest of a certification takes.

It begins with typical durations, measured with the virtual controller and the reference client.
The measured durations of each kind of case replace them during the run.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Final

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.case import Case
from scaraspec.translation import localized

_TYPICAL_S: Final = {
    Hazard.READ_ONLY.value: 0.15,
    Hazard.STATE.value: 0.2,
    Hazard.MOTION.value: 0.35,
    Hazard.DESTRUCTIVE.value: 0.5,
    "operator": 30.0,
}
_ROUND_TRIPS: Final = 55
"""How many requests a case sends and waits for, on average."""
_TYPICAL_ROUND_TRIP_S: Final = 0.0005
_SILENCE: Final = "silence"
_ABOUT_SILENCE: Final = ("5.2/9", "5.3/7", "5.4/5")
"""Requirements whose cases wait until a transfer times out."""
_SILENCES: Final = 1.5
"""How many transfer timeouts such a case takes."""
_WEIGHT: Final = 3
"""How many measured cases the typical duration counts for."""
_MINUTE_S: Final = 60
_HOUR_MIN: Final = 60
_ROUGH_S: Final = 10


class TimeEstimate:
    """How long the cases of a run still take.

    Args:
        cases: The cases that will run.
        transfer_s: The silence after which the subject abandons a transfer, in seconds.
        asks: Whether a case asks an operator.
        clock: Returns the current time in seconds.
    """

    def __init__(
        self,
        cases: Iterable[Case],
        transfer_s: float,
        *,
        asks: Callable[[Case], bool] = lambda _: False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._typical_s = {**_TYPICAL_S, _SILENCE: _SILENCES * transfer_s}
        self._asks, self._clock = asks, clock
        self._kinds = {case.id: self._kind(case) for case in cases}
        self._measured = Counter[str]()
        self._measured_s = dict.fromkeys(self._typical_s, 0.0)
        self._begun_s: float | None = None

    def set_round_trip(self, round_trip_s: float) -> None:
        """Add the time for which slow replies delay each case, before the first case begins.

        Args:
            round_trip_s: The time from a request to its first reply, in seconds.
        """
        extra_s = _ROUND_TRIPS * max(0.0, round_trip_s - _TYPICAL_ROUND_TRIP_S)
        self._typical_s = {kind: s + extra_s for kind, s in self._typical_s.items()}

    def begin(self) -> None:
        """Begin a case."""
        self._begun_s = self._clock()

    def end(self, case: Case) -> None:
        """End a case, which may not have begun: its duration does not count then."""
        kind, begun_s = self._kinds.pop(case.id, None), self._begun_s
        if kind and begun_s is not None:
            self._measured[kind] += 1
            self._measured_s[kind] += self._clock() - begun_s
            self._begun_s = None

    @property
    def remaining_s(self) -> float:
        """The estimated time of the remaining cases, in seconds."""
        counts = Counter(self._kinds.values())
        return sum(count * self._mean_s(kind) for kind, count in counts.items())

    def __str__(self) -> str:
        """The remaining time in words, such as ``about 3 min``."""
        if self.remaining_s < _MINUTE_S:
            rough_s = max(1, round(self.remaining_s / _ROUGH_S)) * _ROUGH_S
            return localized("about {rough_s} s", rough_s=rough_s)
        minutes = round(self.remaining_s / _MINUTE_S)
        if minutes < _HOUR_MIN:
            return localized("about {minutes} min", minutes=minutes)
        hours, minutes = divmod(minutes, _HOUR_MIN)
        return localized("about {hours} h {minutes} min", hours=hours, minutes=minutes)

    def _kind(self, case: Case) -> str:
        if self._asks(case):
            return "operator"
        return _SILENCE if case.requirements[0] in _ABOUT_SILENCE else case.hazard.value

    def _mean_s(self, kind: str) -> float:
        total_s = _WEIGHT * self._typical_s[kind] + self._measured_s[kind]
        return total_s / (_WEIGHT + self._measured[kind])
