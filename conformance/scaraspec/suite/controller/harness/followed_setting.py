"""Followed setting: what was asked of one setting of a controller, and what its replies gave.

A reply that gives another value than was set or read last is a deviation. It is suspicious if no
request of the suite explains the value, or if the value that was expected had been in force: it had
been read, or it was set a long time before.
"""

from typing import Any, Final

from scaraspec.suite.controller.harness.setting_values import (
    CLOCK_SLACK_S,
    DRIFT,
    FAR_S,
    Clock,
    are_same,
)

_LONG_S: Final = 0.5
"""Long enough for another client to come between two requests of the suite."""


class FollowedSetting:
    """One setting.

    Args:
        time_scale: How many seconds of the controller's clock a second lasts.

    Attributes:
        expected: What was set or read last; None if that is not known.
        last_set: What the suite has set last.
        request: The data of the last request that has set another value than that of the start.
        foreign: The values that it had and that neither the start nor the suite explains.
        read: Whether `expected` was read; may be cleared, to see whether a reply gives a value.
    """

    def __init__(self, time_scale: float) -> None:
        self.expected: Any = None
        self.last_set: Any = None
        self.request = b""
        self.foreign: list[Any] = []
        self.read = False
        self._scale = time_scale
        self._explained: list[Any] = []
        self._known_s = 0.0

    def asked(self, value: Any, data: bytes, at_s: float, *, accepted: bool) -> None:
        """A request to set it was answered.

        Args:
            value: The value; None if it is not known what the request asks for.
            data: The data of the request.
            at_s: When it was sent, in seconds since the Unix epoch.
            accepted: Whether the answer was yes.
        """
        own = value is not None and not self._is_in(self.foreign, value)  # else it is put back
        if own:
            self._explained.append(value)
        if not accepted:
            return
        self.expected = self.last_set = value
        self._known_s, self.read = at_s, False
        if own and not self.same(self._explained[0], value, slack_s=FAR_S):
            self.request = data

    def told(self, value: Any, at_s: float) -> bool | None:
        """A reply has given a value.

        Returns:
            Whether that is suspicious; None if it is no deviation.
        """
        in_force = self.read or at_s - self._known_s > _LONG_S
        expected, self.expected = self.expected, value
        self._known_s, self.read = at_s, True
        if expected is None:
            self._explained.append(value)
            return None
        if not value and isinstance(value, bytes):  # there is no default program once it is deleted
            return None
        if self.same(expected, value):
            return None
        if self.is_explained(value):
            return in_force and not self.same(self.last_set, value)  # else it came late
        self.foreign.append(value)
        inexact = isinstance(value, Clock) and self.same(expected, value, slack_s=FAR_S)
        return in_force or not inexact

    def is_explained(self, value: Any) -> bool:
        """Whether it had this value at the start, or the suite has asked for it."""
        return self._is_in(self._explained, value)

    def same(
        self, first: Any, then: Any, *, loose: float = DRIFT, slack_s: float = CLOCK_SLACK_S
    ) -> bool:
        """Whether two values are the same.

        Args:
            first: The earlier one.
            then: The later one.
            loose: How many seconds in a second a clock may gain or lose.
            slack_s: How many seconds it may be off besides.
        """
        if not isinstance(first, Clock):
            return are_same(first, then)
        slack_s += loose * abs(then.at_s - first.at_s)
        return bool(first.off_s(then, self._scale) <= slack_s * max(self._scale, 1))

    def _is_in(self, values: list[Any], value: Any) -> bool:
        return any(self.same(each, value) for each in values)
