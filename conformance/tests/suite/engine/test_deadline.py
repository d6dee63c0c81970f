"""The deadline depends on the clock alone, not on the number of pauses."""

from dataclasses import dataclass

from scaraspec.suite.engine.deadline import Deadline


@dataclass
class _Clock:
    """A clock that the test sets."""

    now_ns: int = 10**18


def test_deadline_follows_the_clock() -> None:
    """A deadline expires when the clock reaches it, and stays expired."""
    clock = _Clock()
    deadline = Deadline(clock, 1.5)
    assert deadline.remaining_s == 1.5
    clock.now_ns += 1_499_999_999
    assert not deadline.expired
    clock.now_ns += 1
    assert deadline.expired
    clock.now_ns += 10**9
    assert deadline.expired
    assert deadline.remaining_s == 0.0


def test_deadline_without_duration_has_expired() -> None:
    """A deadline after 0 s has expired from the start."""
    assert Deadline(_Clock(), 0.0).expired


def test_queries_become_rare_in_a_long_wait() -> None:
    """The pause is 50 ms in the first seconds, then 2 % of the time waited."""
    clock = _Clock()
    deadline = Deadline(clock, 100.0)
    assert deadline.poll_s == 0.05
    clock.now_ns += 2_000_000_000
    assert deadline.poll_s == 0.05
    clock.now_ns += 48_000_000_000
    assert deadline.poll_s == 1.0
