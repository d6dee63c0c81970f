"""Rules: a fault, the frames that match, and the selection among them.

Random values depend only on the seed, the rule and the connection: the same traffic gets the same
faults, independent of other connections.
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
"""Selection among matching frames, by the frame's count."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of a file.

    Attributes:
        label: Name in the capture.
        fault: The fault.
        condition: Condition on the frames.
        connection: Number of the connection, counted from 1; None for all.
        pick: A key of `PICKS`; empty for all frames.
        number: Value of that key.
    """

    label: str
    fault: Fault
    condition: Condition
    connection: int | None = None
    pick: str = ""
    number: float = 0


@dataclass(frozen=True, slots=True)
class Injection:
    """The rules of a file, in order, and the random seed."""

    rules: tuple[Rule, ...]
    seed: int = 0


class ActiveRule:
    """A rule on one connection, with its frame count.

    Args:
        rule: The rule.
        dice: Its random generator.
    """

    def __init__(self, rule: Rule, dice: Random) -> None:
        self.rule = rule
        self._dice = dice
        self._count = 0

    def hits(self, passing: ObservedFrame) -> bool:
        """Count a frame. Return whether the fault applies to it."""
        if not self.rule.condition.matches(passing):
            return False
        self._count += 1
        pick = self.rule.pick
        return not pick or PICKS[pick](self._count, self.rule.number, self._dice)

    def apply(self, parcel: QueuedFrame) -> str:
        """Apply the fault. Return a description; empty if nothing changed."""
        done = self.rule.fault.apply(parcel, self._dice)
        return f"{self.rule.label}: {done}" if done else ""


def active_rules(injection: Injection, connection: int) -> list[ActiveRule]:
    """Return the rules of a connection, with their counts at 0."""
    return [
        ActiveRule(rule, Random(f"{injection.seed}/{connection}/{number}"))  # noqa: S311 - reproducible, not secret
        for number, rule in enumerate(injection.rules)
        if rule.connection in (None, connection)
    ]
