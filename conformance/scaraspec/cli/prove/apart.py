"""Apart: work that is done on several processes at once, each of which is young."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def apart(work: Callable[[T], R], about: Sequence[T], *, jobs: int, runs: int) -> Iterator[R]:
    """Work on several processes, and give the results in order.

    All of them are replaced together: an executor that replaces each by itself may wait for ever
    for the next one (CPython gh-115634).

    Args:
        work: What is done, a function of a module.
        about: What it is done about.
        jobs: How many processes.
        runs: How often each of them may work.
    """
    for first in range(0, len(about), jobs * runs):
        with ProcessPoolExecutor(jobs, get_context("forkserver")) as pool:
            yield from pool.map(work, about[first : first + jobs * runs])
