"""Shrinking: a failing sequence is reduced to the steps that it needs."""

from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from scaraspec.suite.engine.expectations import CaseFailed
from scaraspec.suite.engine.shrink import Failure, shrink_sequence


@given(places=st.lists(st.integers(0, 60), min_size=1, max_size=4), length=st.integers(0, 60))
def test_only_needed_steps_remain(places: list[int], length: int) -> None:
    """All other steps are removed, wherever they are."""
    needed = list(range(len(places)))
    steps = [-1] * length
    for number, place in zip(needed, sorted(places), strict=True):
        steps.insert(place + number, number)

    def attempt(tried: Sequence[int]) -> Failure | None:
        come = 0
        for taken, step in enumerate(tried, 1):
            come += step == come
            if come == len(needed):
                return Failure(CaseFailed(f"{tried[:taken]}"), taken)
        return None

    failure = attempt(steps)
    assert failure
    assert f"{shrink_sequence(steps, failure, attempt).error}" == f"{needed}"


def test_number_of_tries_is_limited() -> None:
    """A sequence in which every step matters stays unchanged."""
    tries = 0

    def attempt(_: Sequence[int]) -> Failure | None:
        nonlocal tries
        tries += 1
        return None

    complete = Failure(CaseFailed("whole"), 5000)
    assert shrink_sequence(range(5000), complete, attempt) is complete
    assert tries <= 200


def test_time_for_shrinking_is_limited() -> None:
    """If time is over, the shortest sequence so far is returned."""
    left = [True]

    def attempt(steps: Sequence[int]) -> Failure:
        return Failure(CaseFailed(f"{len(steps)}"), len(steps))

    complete = Failure(CaseFailed("64"), 64)
    shortest = shrink_sequence(range(64), complete, attempt, lambda: bool(left) and left.pop())
    assert f"{shortest.error}" == "32"
