"""Timeouts of a transfer (5.4, A-5-13), and the measurement of a silence.

A transfer must survive 25 s of silence and must have ended after 60 s. An end before 27 s or after
35 s is reported. A timeout that the subject claims scales all four values.
"""

from typing import Final, NamedTuple

from scaraspec.suite.engine.expectations import CaseInconclusive, SentTooSlowly
from scaraspec.suite.engine.system_under_test import SystemUnderTest
from scaraspec.user_message import UserMessage

_DOCUMENT_S: Final = 30.0  # L763, L787, L795
_NS: Final = 1e9


class TransferTimeouts(NamedTuple):
    """The limits of a silence within a transfer, in seconds.

    Attributes:
        must_survive_s: A transfer survives a silence of this length.
        early_s: A transfer that ends before this is reported.
        late_s: A transfer that ends after this is reported.
        must_end_s: A transfer has ended after a silence of this length.
    """

    must_survive_s: float
    early_s: float
    late_s: float
    must_end_s: float


def transfer_timeouts_of(subject: SystemUnderTest) -> TransferTimeouts:
    """Return the timeouts for this subject."""
    scale = subject.ics.transfer_s / _DOCUMENT_S
    return TransferTimeouts(25 * scale, 27 * scale, 35 * scale, 60 * scale)


def too_slow(silence_s: float, own_s: float) -> CaseInconclusive:
    """Return that a silence during a transfer was too long for a verdict, and why.

    If this machine caused it, the case is tried again.

    Args:
        silence_s: The time between two frames of the suite, in seconds.
        own_s: The part of it after the subject has sent a frame.
    """
    if own_s >= silence_s / 2:
        return SentTooSlowly(
            UserMessage(
                "this machine is too slow: the suite was silent for {silence_s:.3f} s",
                silence_s=silence_s,
            )
        )
    return CaseInconclusive(
        UserMessage(
            "the subject or the network is too slow: the suite was silent for {silence_s:.3f} s, "
            "because it waited for a frame for {waited_s:.3f} s",
            silence_s=silence_s,
            waited_s=silence_s - own_s,
        )
    )


class Silence:
    """Measures for how long nothing has been sent on a connection."""

    def __init__(self, subject: SystemUnderTest) -> None:
        self._subject = subject
        self._since_ns = subject.now_ns
        self._ended_ns: int | None = None

    @property
    def elapsed_s(self) -> float:
        """The duration of the silence until now, or until its end, in seconds."""
        ended_ns = self._subject.now_ns if self._ended_ns is None else self._ended_ns
        return (ended_ns - self._since_ns) / _NS

    def end(self) -> None:
        """End the silence: the suite sends again."""
        self._ended_ns = self._subject.now_ns

    def require_within(self, limit_s: float) -> None:
        """Require that the silence is not too long: a slow machine must not cause a failure.

        Raises:
            SentTooSlowly: The silence is longer than the limit.
        """
        if self.elapsed_s > limit_s:
            raise SentTooSlowly(
                UserMessage(
                    "this machine or the subject is too slow: "
                    "the suite was silent for {passed_s:.3f} s",
                    passed_s=self.elapsed_s,
                )
            )
