"""Rules: a fault, the frames that it is for, and which of them it hits.

Law: what is left to chance comes from the seed alone, apart for each rule and connection, so that
the same traffic meets the same faults whatever other connections do.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Final

from scaraspec_recorder.fault_injection.conditions import Condition, ObservedFrame
from scaraspec_recorder.fault_injection.faults import Fault, QueuedFrame

_Hits = Callable[[int, float, Random], bool]

PICKS: Final[dict[str, _Hits]] = {
    "nth": lambda count, number, _: count == number,
    "every": lambda count, number, _: count % number == 0,
    "first": lambda count, number, _: count <= number,
    "probability": lambda _, number, dice: dice.random() < number,
}
"""Which of the frames that are meant are hit, given the how many-th this is."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of a file.

    Attributes:
        label: What it is called in the capture.
        fault: What is done.
        condition: The frames that it is for.
        connection: On this connection only, counted from 1; None for on each.
        pick: A key of `PICKS`; empty for all frames.
        number: What that key says.
    """

    label: str
    fault: Fault
    condition: Condition
    connection: int | None = None
    pick: str = ""
    number: float = 0


@dataclass(frozen=True, slots=True)
class Injection:
    """What a file says: its rules, in its order, and where chance begins."""

    rules: tuple[Rule, ...]
    seed: int = 0


class ActiveRule:
    """A rule on one connection, counting.

    Args:
        rule: The rule.
        dice: Its own source of chance.
    """

    def __init__(self, rule: Rule, dice: Random) -> None:
        self.rule = rule
        self._dice = dice
        self._count = 0

    def hits(self, passing: ObservedFrame) -> bool:
        """Count a frame, and say whether the fault is for it."""
        if not self.rule.condition.matches(passing):
            return False
        self._count += 1
        pick = self.rule.pick
        return not pick or PICKS[pick](self._count, self.rule.number, self._dice)

    def apply(self, parcel: QueuedFrame) -> str:
        """Do the fault; return what was done, empty where it came to nothing."""
        done = self.rule.fault.apply(parcel, self._dice)
        return f"{self.rule.label}: {done}" if done else ""


def active_rules(injection: Injection, connection: int) -> list[ActiveRule]:
    """Return the rules that are for a connection, ready to count its frames."""
    return [
        ActiveRule(rule, Random(f"{injection.seed}/{connection}/{number}"))  # noqa: S311 - to be the same again, not to be secret
        for number, rule in enumerate(injection.rules)
        if rule.connection in (None, connection)
    ]
