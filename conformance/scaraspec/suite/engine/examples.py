"""Examples: the values for which a case is tried, listed or drawn, and how many they are.

A case is one sentence. Where that holds for many values, each of them is sent by itself and what
comes of it is judged by itself: that is an example. What is repeated, or one step of many, is none.
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
    """How many examples have been tried."""

    examples: int = 0


_TALLY: Final[ContextVar[Tally]] = ContextVar("tally")


@contextmanager
def count_examples() -> Iterator[Tally]:
    """Count the examples tried inside."""
    tally = Tally()
    token = _TALLY.set(tally)
    try:
        yield tally
    finally:
        _TALLY.reset(token)


def examples(values: Iterable[T]) -> Iterator[T]:
    """Try these values, one after the other."""
    for value in values:
        _count()
        yield value


def given(*strategies: SearchStrategy[Any], **named: SearchStrategy[Any]) -> Callable[[Test], Test]:
    """Try what hypothesis draws from these strategies: its `given`, and each draw is counted."""

    def mark(test: Test) -> Test:
        @wraps(test)
        def counting(*arguments: Any, **more: Any) -> None:
            _count()
            test(*arguments, **more)

        return hypothesis.given(*strategies, **named)(counting)

    return mark


def _count() -> None:
    """Count one; a case that a team's own test calls is not counted."""
    tally = _TALLY.get(None)
    if tally is not None:
        tally.examples += 1
