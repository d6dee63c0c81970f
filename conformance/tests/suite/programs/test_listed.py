"""The names that are made to fill a program list."""

from types import SimpleNamespace
from typing import Any

import pytest

from scaraspec.suite.as_client.subject import Subject
from scaraspec.suite.programs.listed import long_name


def _named_so_far(count: int) -> Any:
    """What of a subject makes names, behind so many of them."""
    return SimpleNamespace(
        created=[], dialect={"prog_ext": ".rob"}, _names=iter(range(count, count + 9))
    )


@pytest.mark.parametrize("count", [1, 8, 9, 98, 99, 100, 998, 999])
@pytest.mark.parametrize("size_bytes", [4, 8, 9, 10, 11, 30])
def test_a_long_name_is_taken_away_afterwards(count: int, size_bytes: int) -> None:
    """It is what was made, and as long as was asked for, or little more than the shortest."""
    subject = _named_so_far(count)
    subject.new_name = lambda **more: Subject.new_name(subject, **more)
    name = long_name(subject, size_bytes)
    assert subject.created == [name]
    shortest = len(f"zs{count}.rob")
    assert len(name) == size_bytes or len(name) <= max(size_bytes, shortest + 2)
