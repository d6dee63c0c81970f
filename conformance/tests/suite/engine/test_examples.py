"""Examples: values of a case, listed or drawn, are counted and reported."""

from collections.abc import Callable
from dataclasses import dataclass

import pytest
from hypothesis import settings
from hypothesis import strategies as st

from scaraspec.suite.engine.examples import SHRINK_S, count_examples, examples, given
from scaraspec.suite.engine.hypothesis_profile import HypothesisProfile
from scaraspec.virtual_controller.core import ControllerCore
from tests.suite.conftest import CaseResults


@dataclass
class _Clock:
    """A clock on which each look takes a quarter of the time of a search."""

    looks: int = 0

    @property
    def now_ns(self) -> int:
        self.looks += 1
        return round(self.looks * SHRINK_S / 4 * 1e9)


def test_examples_are_counted() -> None:
    """Each value counts once, when it is used; unused values of a list do not count."""
    drawn = []

    @settings(max_examples=7, database=None)
    @given(st.integers())
    def draw(number: int) -> None:
        drawn.append(number)

    with count_examples(_Clock()) as tally:
        assert list(examples("abc")) == ["a", "b", "c"]
        assert next(examples("abc")) == "a"
        draw()
    assert tally.examples == 3 + 1 + len(drawn)


def test_the_search_for_a_simpler_example_ends() -> None:
    """After `SHRINK_S` no example is tried any more; the simplest one that failed is reported."""
    tried: list[int] = []

    with HypothesisProfile(examples=4, seed=0), count_examples(_Clock()) as tally:

        @given(st.integers(0, 10**9))
        def fail_if_large(number: int) -> None:
            tried.append(number)
            if number > 1000:
                raise ValueError(number)

        with pytest.raises(ValueError, match=r"\d") as failed:
            fail_if_large()
    first = next(index for index, number in enumerate(tried) if number > 1000)
    assert first + 1 < len(tried) <= first + 1 + 4  # there are four looks at the clock in the time
    assert tally.examples == len(tried)
    assert failed.value.args[0] == min(number for number in tried if number > 1000)


def test_examples_without_a_counter() -> None:
    """Without a counter, a case still runs all its values."""
    assert list(examples(range(3))) == [0, 1, 2]


def test_results_have_the_number_of_examples(run_cases: Callable[..., CaseResults]) -> None:
    """A case about many values reports their number; a case about one reports 0."""
    cases = run_cases(ControllerCore, "3/20", "4.7/2", examples=4)
    assert cases["3/20.length"].examples == 12  # three sizes, and four lengths for each
    assert cases["4.7/2"].examples == 0
