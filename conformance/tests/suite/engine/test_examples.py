"""Examples: values of a case, listed or drawn, are counted and reported."""

from collections.abc import Callable

from hypothesis import settings
from hypothesis import strategies as st

from scaraspec.suite.engine.examples import count_examples, examples, given
from scaraspec.virtual_controller.core import ControllerCore
from tests.suite.conftest import CaseResults


def test_examples_are_counted() -> None:
    """Each value counts once, when it is used; unused values of a list do not count."""
    drawn = []

    @settings(max_examples=7, database=None)
    @given(st.integers())
    def draw(number: int) -> None:
        drawn.append(number)

    with count_examples() as tally:
        assert list(examples("abc")) == ["a", "b", "c"]
        assert next(examples("abc")) == "a"
        draw()
    assert tally.examples == 3 + 1 + len(drawn)


def test_examples_without_a_counter() -> None:
    """Without a counter, a case still runs all its values."""
    assert list(examples(range(3))) == [0, 1, 2]


def test_results_have_the_number_of_examples(run_cases: Callable[..., CaseResults]) -> None:
    """A case about many values reports their number; a case about one reports 0."""
    cases = run_cases(ControllerCore, "3/20", "4.7/2", examples=4)
    assert cases["3/20.length"].examples == 12  # three sizes, and four lengths for each
    assert cases["4.7/2"].examples == 0
