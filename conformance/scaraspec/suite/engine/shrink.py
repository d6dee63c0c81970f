"""Shortening: which steps of a sequence that fails matter.

hypothesis shortens what it has drawn without knowing what it is; of steps each of which may be left
out, a tenth of the tries finds the few that are needed, and a try may last seconds on a robot: as
long as an answer is awaited, where it fails by one that does not come.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar

from scaraspec.suite.engine.expectations import CaseFailed

T = TypeVar("T")

_TRIES: Final = 200


class Failure(NamedTuple):
    """How a sequence fails.

    Attributes:
        error: What was not met.
        steps: How many of its steps were taken, the one that failed among them.
    """

    error: CaseFailed
    steps: int


def _always() -> bool:
    return True


def shrink_sequence(
    steps: Sequence[T],
    failure: Failure,
    attempt: Callable[[Sequence[T]], Failure | None],
    goes_on: Callable[[], bool] = _always,
) -> Failure:
    """Leave out of a sequence whatever it fails without, in a bounded number of tries.

    Args:
        steps: The sequence.
        failure: How it fails.
        attempt: Takes the steps of another sequence; None where it does not fail in the same way.
        goes_on: Whether there is time for another try.

    Returns:
        How the shortest sequence fails that was found.
    """
    steps, tries = steps[: failure.steps], 0
    size = len(steps) // 2
    while size:
        before = end = len(steps)
        while end > 0 and tries < _TRIES and goes_on():
            fewer = [*steps[: max(end - size, 0)], *steps[end:]]
            tries += 1
            if again := attempt(fewer):
                steps, failure = fewer[: again.steps], again
            end = min(end - size, len(steps))
        size = size // 2 or len(steps) < before  # single steps until each of them is needed
    return failure
