"""Examples: the values that a case tries, listed or drawn, and their number.

A case tests one statement. If it holds for many values, each value is sent and judged on its own:
this is an example. Repetitions and steps of a sequence are not examples.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from typing import Any, Final, TypeVar

import hypothesis
from hypothesis.strategies import SearchStrategy

T = TypeVar("T")
Test = Callable[..., None]


@dataclass(slots=True)
class Tally:
    """The number of examples tried."""

    examples: int = 0


_TALLY: Final[ContextVar[Tally]] = ContextVar("tally")


@contextmanager
def count_examples() -> Iterator[Tally]:
    """Count the examples that are tried while the context is active."""
    tally = Tally()
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
    """Wrap `hypothesis.given` and count each draw as an example."""

    def mark(test: Test) -> Test:
        @wraps(test)
        def counting(*arguments: Any, **more: Any) -> None:
            _count()
            test(*arguments, **more)

        return hypothesis.given(*strategies, **named)(counting)

    return mark


def _count() -> None:
    """Count one example. In a test outside of a run of the suite, nothing is counted."""
    tally = _TALLY.get(None)
    if tally is not None:
        tally.examples += 1
