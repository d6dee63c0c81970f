"""Names that fill a program list."""

from typing import Any

import pytest

from scaraspec.suite.controller.harness.own_files import OwnFiles
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.program_files.listed import long_name


class Named:
    """The part of a subject that makes names."""

    def __init__(self) -> None:
        self.files = OwnFiles(Journal(), lambda: "aaaa")

    def new_name(self, **more: Any) -> bytes:
        """A name that is not in use."""
        return self.files.new_name(".rob", **more)


@pytest.mark.parametrize("count", [1, 8, 9, 98, 99, 100, 998, 999])
@pytest.mark.parametrize("size_bytes", [4, 12, 13, 14, 15, 30])
def test_a_long_name(count: int, size_bytes: int) -> None:
    """The name has the requested length, or is little longer than the shortest possible one."""
    subject: Any = Named()
    for _ in range(count - 1):
        subject.new_name()
    name = long_name(subject, size_bytes)
    shortest = len(f"zsaaaa{count}.rob")
    assert len(name) == size_bytes or len(name) <= max(size_bytes, shortest + 2)
