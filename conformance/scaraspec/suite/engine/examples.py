"""Examples: the values that a case tries, listed or drawn, and their number.

A case tests one statement. If it holds for many values, each value is sent and judged on its own:
this is an example. Repetitions and steps of a sequence are not examples.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, Final, TypeVar

import hypothesis
from hypothesis.errors import HypothesisException
from hypothesis.strategies import SearchStrategy

from scaraspec.suite.engine.deadline import Clock, Deadline

T = TypeVar("T")
Test = Callable[..., None]


SHRINK_S: Final = 15.0
"""How long a simpler failure is searched for. A reproduction searches again, within a minute."""


@dataclass(slots=True)
class Tally:
    """The examples of one attempt.

    Attributes:
        clock: The clock of the subject.
        examples: How many were tried.
        failures: The failure of each drawn example that failed.
        shrinking: When the search for a simpler example ends; None if none has failed.
    """

    clock: Clock
    examples: int = 0
    failures: dict[str, Exception] = field(default_factory=dict)
    shrinking: Deadline | None = None

    def attempt(self, example: str, test: Callable[[], None]) -> None:
        """Try a drawn example.

        `SHRINK_S` after the beginning of the first one that fails, no other is tried, and those
        that have failed fail again: if the subject has stopped answering, each of hundreds costs a
        timeout.

        Raises:
            Exception: The example fails.
        """
        if self.shrinking and self.shrinking.expired:
            if example in self.failures:
                raise self.failures[example]
            return
        self.examples += 1
        limit = Deadline(self.clock, SHRINK_S)
        try:
            test()
        except HypothesisException:
            raise
        except Exception as error:
            self.shrinking = self.shrinking or limit
            self.failures[example] = error
            raise


_TALLY: Final[ContextVar[Tally]] = ContextVar("tally")


@contextmanager
def count_examples(clock: Clock) -> Iterator[Tally]:
    """Count the examples that are tried while the context is active.

    Args:
        clock: The clock of the subject.
    """
    tally = Tally(clock)
    token = _TALLY.set(tally)
    try:
        yield tally
    finally:
        _TALLY.reset(token)


def examples(values: Iterable[T]) -> Iterator[T]:
    """Yield these values and count each as an example."""
    for value in values:
        if tally := _TALLY.get(None):  # else, in a test outside of a run of the suite
            tally.examples += 1
        yield value


def given(*strategies: SearchStrategy[Any], **named: SearchStrategy[Any]) -> Callable[[Test], Test]:
    """Wrap `hypothesis.given`: count each draw, and limit the search for simpler failures."""

    def mark(test: Test) -> Test:
        @wraps(test)
        def counting(*arguments: Any, **more: Any) -> None:
            if tally := _TALLY.get(None):
                tally.attempt(f"{arguments} {more}", lambda: test(*arguments, **more))
            else:
                test(*arguments, **more)

        return hypothesis.given(*strategies, **named)(counting)

    return mark
