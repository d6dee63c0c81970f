"""What a sequence fails without is left out of it."""

from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from scaraspec.suite.engine.expectations import CaseFailed
from scaraspec.suite.engine.shrink import Failure, shrink_sequence


@given(places=st.lists(st.integers(0, 60), min_size=1, max_size=4), length=st.integers(0, 60))
def test_only_what_matters_is_left(places: list[int], length: int) -> None:
    """Whatever lies before, between and behind the few steps that it takes."""
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


def test_tries_are_bounded() -> None:
    """A sequence of which everything matters is given back as it was."""
    tries = 0

    def attempt(_: Sequence[int]) -> Failure | None:
        nonlocal tries
        tries += 1
        return None

    whole = Failure(CaseFailed("whole"), 5000)
    assert shrink_sequence(range(5000), whole, attempt) is whole
    assert tries <= 200


def test_there_may_be_no_time_for_another_try() -> None:
    """Then the shortest sequence is given back that was found until then."""
    left = [True]

    def attempt(steps: Sequence[int]) -> Failure:
        return Failure(CaseFailed(f"{len(steps)}"), len(steps))

    whole = Failure(CaseFailed("64"), 64)
    shortest = shrink_sequence(range(64), whole, attempt, lambda: bool(left) and left.pop())
    assert f"{shortest.error}" == "32"
