"""Limits: after what silence a transfer may and must have ended (A-5-13), and how long one was.

A transfer survives 25 s of silence and has ended after 60 s; where it ends before 27 s or lives on
after 35 s, that is reported. A limit that the subject claims scales all four.
"""

from typing import Final, NamedTuple

from scaraspec.suite.engine.expectations import CaseInconclusive
from scaraspec.suite.engine.system_under_test import SystemUnderTest
from scaraspec.user_message import UserMessage

_DOCUMENT_S: Final = 30.0  # L763, L787, L795
_NS: Final = 1e9


class Limits(NamedTuple):
    """How long a silence may and must be for a transfer to end, in seconds."""

    survived_s: float
    early_s: float
    late_s: float
    over_s: float


def limits_of(subject: SystemUnderTest) -> Limits:
    """The limits of a subject."""
    scale = subject.ics.transfer_s / _DOCUMENT_S
    return Limits(25 * scale, 27 * scale, 35 * scale, 60 * scale)


class Silence:
    """How long nothing has been sent on a connection."""

    def __init__(self, subject: SystemUnderTest) -> None:
        self._subject = subject
        self._since_ns = subject.now_ns

    @property
    def passed_s(self) -> float:
        """How many seconds it has lasted until now."""
        return (self._subject.now_ns - self._since_ns) / _NS

    def in_time(self, limit_s: float) -> None:
        """Continue only while it is within the limit: a slow machine must cause no failure.

        Raises:
            CaseInconclusive: It is longer.
        """
        if self.passed_s > limit_s:
            raise CaseInconclusive(
                UserMessage(
                    "this machine is too slow: a silence lasted {passed_s:.3f} s",
                    passed_s=self.passed_s,
                )
            )
