"""Shrink: finds the steps that a failing sequence needs.

Each step of a sequence may be omitted. A search that knows this needs a tenth of the attempts that
hypothesis needs. An attempt on a robot may take seconds, for example until a reply times out.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar

from scaraspec.suite.engine.expectations import CaseFailed

T = TypeVar("T")

_MAX_ATTEMPTS: Final = 200


class Failure(NamedTuple):
    """How a sequence fails.

    Attributes:
        error: The failed expectation.
        steps: How many steps were performed, including the one that failed.
    """

    error: CaseFailed
    steps: int


def _always() -> bool:
    return True


def shrink_sequence(
    steps: Sequence[T],
    failure: Failure,
    attempt: Callable[[Sequence[T]], Failure | None],
    has_time: Callable[[], bool] = _always,
) -> Failure:
    """Omit steps without which a sequence still fails, in a bounded number of attempts.

    Args:
        steps: The sequence.
        failure: How it fails.
        attempt: Performs another sequence; returns None if it does not fail in the same way.
        has_time: Whether there is time for another attempt.

    Returns:
        The failure of the shortest sequence found.
    """
    steps, attempts = steps[: failure.steps], 0
    size = len(steps) // 2
    while size:
        before = end = len(steps)
        while end > 0 and attempts < _MAX_ATTEMPTS and has_time():
            fewer = [*steps[: max(end - size, 0)], *steps[end:]]
            attempts += 1
            if again := attempt(fewer):
                steps, failure = fewer[: again.steps], again
            end = min(end - size, len(steps))
        size = size // 2 or len(steps) < before  # repeat with single steps until each is needed
    return failure
