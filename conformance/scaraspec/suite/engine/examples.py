"""Examples: the values that a case tries, listed or drawn, and their number.

A case tests one statement. If it holds for many values, each value is sent and judged on its own:
this is an example. Repetitions and steps of a sequence are not examples.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, Final, TypeVar

import hypothesis
from hypothesis.errors import HypothesisException
from hypothesis.strategies import SearchStrategy

T = TypeVar("T")
Test = Callable[..., None]


SHRINK_S: Final = 60.0
"""How long hypothesis looks for a simpler example after one has failed."""


@dataclass(slots=True)
class Tally:
    """The examples of one attempt.

    Attributes:
        now_s: Returns the time in seconds.
        examples: How many were tried.
        failures: The failure of each drawn example that failed.
        failed_s: When the first one failed.
    """

    now_s: Callable[[], float] = time.monotonic
    examples: int = 0
    failures: dict[str, Exception] = field(default_factory=dict)
    failed_s: float = 0.0

    def attempt(self, example: str, test: Callable[[], None]) -> None:
        """Try a drawn example. After `SHRINK_S`, those that have failed fail again untried.

        A subject that does not answer any more costs a timeout for each of hundreds of examples.

        Raises:
            Exception: The example fails.
        """
        if self.failures and self.now_s() - self.failed_s > SHRINK_S:
            if example in self.failures:
                raise self.failures[example]
            return
        try:
            test()
        except HypothesisException:
            raise
        except Exception as error:
            if not self.failures:
                self.failed_s = self.now_s()
            self.failures[example] = error
            raise


_TALLY: Final[ContextVar[Tally]] = ContextVar("tally")


@contextmanager
def count_examples(now_s: Callable[[], float] = time.monotonic) -> Iterator[Tally]:
    """Count the examples that are tried while the context is active.

    Args:
        now_s: Returns the time in seconds.
    """
    tally = Tally(now_s)
    token = _TALLY.set(tally)
    try:
        yield tally
    finally:
        _TALLY.reset(token)


def examples(values: Iterable[T]) -> Iterator[T]:
    """Yield these values and count each as an example."""
    for value in values:
        _count()
        yield value


def given(*strategies: SearchStrategy[Any], **named: SearchStrategy[Any]) -> Callable[[Test], Test]:
    """Wrap `hypothesis.given`: count each draw, and limit the search for simpler failures."""

    def mark(test: Test) -> Test:
        @wraps(test)
        def counting(*arguments: Any, **more: Any) -> None:
            _count()
            if tally := _TALLY.get(None):
                tally.attempt(f"{arguments} {more}", lambda: test(*arguments, **more))
            else:
                test(*arguments, **more)

        return hypothesis.given(*strategies, **named)(counting)

    return mark


def _count() -> None:
    """Count one example. In a test outside of a run of the suite, nothing is counted."""
    tally = _TALLY.get(None)
    if tally is not None:
        tally.examples += 1
