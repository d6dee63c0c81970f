"""What a case is tried for is counted, listed and drawn, and reaches the results."""

from collections.abc import Callable

from hypothesis import settings
from hypothesis import strategies as st

from scaraspec.suite.engine.examples import count_examples, examples, given
from scaraspec.virtual_controller.core import ControllerCore
from tests.suite.conftest import CaseResults


def test_what_is_listed_and_drawn_is_counted() -> None:
    """Each value counts once, as it is taken: what is left of a list where a case ends does not."""
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


def test_within_nothing_that_counts() -> None:
    """A case that a team's own test calls goes through its values all the same."""
    assert list(examples(range(3))) == [0, 1, 2]


def test_the_results_tell_of_them(run_cases: Callable[..., CaseResults]) -> None:
    """A case about many values tells how many they were; one about one thing tells 0."""
    cases = run_cases(ControllerCore, "3/20", "4.7/2", examples=4)
    assert cases["3/20.length"].examples == 12  # three sizes, and four lengths for each
    assert cases["4.7/2"].examples == 0
