"""Operator request: what an operator was asked to do during a case, and the answer.

This is evidence of the case, and part of the results.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum


class OperatorAnswer(Enum):
    """What an operator answered."""

    DONE = "done"
    """It has been done."""
    SKIPPED = "skipped"
    """The case is skipped."""


@dataclass(frozen=True, slots=True)
class OperatorRequest:
    """A request to an operator.

    Attributes:
        request: What to do, in plain words.
        begun_ns: When it was shown, in nanoseconds since the Unix epoch.
        ended_ns: When it was answered.
        answer: The answer.
        notes: The remarks of the operator, in order.
    """

    request: str
    begun_ns: int
    ended_ns: int
    answer: OperatorAnswer
    notes: tuple[str, ...] = ()

    @property
    def duration_s(self) -> float:
        """The time until the answer, in seconds."""
        return (self.ended_ns - self.begun_ns) / 1e9


def operator_s(requests: Iterable[OperatorRequest]) -> float:
    """Return the time that the operator took for these requests, in seconds."""
    return sum(each.duration_s for each in requests)
