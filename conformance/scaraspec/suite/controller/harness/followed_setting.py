"""Followed setting: the requests and the reported values of one setting of a controller.

A reported value that differs from the value set or read last is a deviation. It is suspicious if no
request of the suite explains it, or if the expected value was in force: it was read before, or it
was set a long time ago.
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
"""Within this time, another client may change a setting between two requests of the suite."""


class FollowedSetting:
    """One setting.

    Args:
        time_scale: How many seconds of the controller's clock pass in one second.

    Attributes:
        expected: The value that was set or read last; None if it is unknown.
        last_set: The value that the suite has set last.
        request: The data of the last request with a value other than that of the start.
        foreign: Reported values that neither the start nor a request of the suite explains.
        read: Whether `expected` was read. A caller may clear it to detect the next reported value.
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

    def note_request(self, value: Any, data: bytes, at_s: float, *, accepted: bool) -> None:
        """Note an answered request to set it.

        Args:
            value: The value; None if the resulting value is unknown.
            data: The data of the request.
            at_s: When it was sent, in seconds since the Unix epoch.
            accepted: Whether it was accepted.
        """
        own = value is not None and not self._is_in(self.foreign, value)  # not a restoration
        if own:
            self._explained.append(value)
        if not accepted:
            return
        self.expected = self.last_set = value
        self._known_s, self.read = at_s, False
        if own and not self.same(self._explained[0], value, slack_s=FAR_S):
            self.request = data

    def note_report(self, value: Any, at_s: float) -> bool | None:
        """Note a reported value.

        Returns:
            Whether it is suspicious; None if it is no deviation.
        """
        in_force = self.read or at_s - self._known_s > _LONG_S
        expected, self.expected = self.expected, value
        self._known_s, self.read = at_s, True
        if expected is None:
            self._explained.append(value)
            return None
        if not value and isinstance(value, bytes):  # the default program was deleted
            return None
        if self.same(expected, value):
            return None
        if self.is_explained(value):
            return in_force and not self.same(self.last_set, value)  # or it came late
        self.foreign.append(value)
        inexact = isinstance(value, Clock) and self.same(expected, value, slack_s=FAR_S)
        return in_force or not inexact

    def is_explained(self, value: Any) -> bool:
        """Whether it had this value at the start, or the suite has set it."""
        return self._is_in(self._explained, value)

    def same(
        self, first: Any, then: Any, *, loose: float = DRIFT, slack_s: float = CLOCK_SLACK_S
    ) -> bool:
        """Whether two values are the same.

        Args:
            first: The earlier value.
            then: The later value.
            loose: How many seconds per second a clock may gain or lose.
            slack_s: The additional tolerance of a clock, in seconds.
        """
        if not isinstance(first, Clock):
            return are_same(first, then)
        slack_s += loose * abs(then.at_s - first.at_s)
        return bool(first.off_s(then, self._scale) <= slack_s * max(self._scale, 1))

    def _is_in(self, values: list[Any], value: Any) -> bool:
        return any(self.same(each, value) for each in values)
