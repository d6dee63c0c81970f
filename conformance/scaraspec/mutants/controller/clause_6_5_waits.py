"""Faults of clause 6.5: nodes that hold a program, for a time or until an input is so."""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar

from scaraspec.mutants.operators.controller.programs import misrun
from scaraspec.protocol.program_files import (
    Condition,
    Node,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)
from scaraspec.virtual_controller.interpreter import Run

_PATIENCE_S = 0.4

# ---------------------------------------------------------------------- waits


class _Waits(Run):
    """Waits for another time than the seconds of the node."""

    def lasts_s(self, duration_s: float) -> float:
        """For how long it waits."""
        return duration_s

    def _begin(self, node: Node, now_s: float) -> float:
        if isinstance(node.data, WaitSeconds):
            return now_s + self.lasts_s(node.data.duration_s)
        return super()._begin(node, now_s)


@misrun("waits-milliseconds", "6.5/20")
class WaitsMilliseconds(_Waits):
    """A wait takes thousandths of its seconds."""

    def lasts_s(self, duration_s: float) -> float:
        """Divide them."""
        return duration_s / 1000


@misrun("waits-one-fifth-longer", "6.5/20")
class WaitsOneFifthLonger(_Waits):
    """A wait takes a fifth longer than its seconds."""

    def lasts_s(self, duration_s: float) -> float:
        """Stretch them."""
        return duration_s * 1.2


@misrun("waits-one-second-more", "6.5/20")
class WaitsOneSecondMore(_Waits):
    """A wait takes a second more than it should, as when ticks are counted from 0."""

    def lasts_s(self, duration_s: float) -> float:
        """Add it."""
        return duration_s + 1


@misrun("waits-slightly-less", "6.5/20", subtle=True)
class WaitsSlightlyLess(_Waits):
    """A wait is over a twentieth of a second early."""

    def lasts_s(self, duration_s: float) -> float:
        """Take it away."""
        return max(duration_s - 0.05, 0)


@misrun("waits-signed-bytes", "6.5/20", subtle=True)
class WaitsSignedBytes(_Waits):
    """A wait of 128 seconds or more is over at once, as its byte is taken for a negative one."""

    def lasts_s(self, duration_s: float) -> float:
        """Take the highest bit for a sign."""
        return duration_s if duration_s < 0x80 else 0


@misrun("waits-the-second-time-for-nothing", "6.5/20", subtle=True)
class WaitsTheSecondTimeForNothing(_Waits):
    """Only the first two waits of a program take time."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._waits = 0

    def lasts_s(self, duration_s: float) -> float:
        """Count them."""
        self._waits += 1
        return duration_s if self._waits <= 2 else 0


@misrun("waits-at-least-one-second", "6.5/20")
class WaitsAtLeastOneSecond(_Waits):
    """A wait of 0 seconds takes one."""

    def lasts_s(self, duration_s: float) -> float:
        """Lengthen it."""
        return max(duration_s, 1)


@misrun("timers-are-passed", "6.5/22")
class TimersArePassed(Run):
    """A timer does not hold the program."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return now_s if isinstance(wait, WaitTimer) else super()._wait_ends_s(wait, now_s)


class _Timers(Run):
    """Takes the instant of a timer for another one."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """The instant that it waits for."""
        return timer

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return super()._wait_ends_s(self.due(wait) if isinstance(wait, WaitTimer) else wait, now_s)


@misrun("timers-of-whole-seconds", "6.5/22")
class TimersOfWholeSeconds(_Timers):
    """The microseconds of a timer are left out."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Leave them out."""
        return replace(timer, microseconds=0)


@misrun("timers-one-second-late", "6.5/22")
class TimersOneSecondLate(_Timers):
    """A timer is over a second after its instant."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Add it."""
        return replace(timer, seconds=timer.seconds + 1)


@misrun("timers-of-another-zone", "6.5/22")
class TimersOfAnotherZone(_Timers):
    """A timer goes by Chinese time, eight hours ahead."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Come earlier."""
        return replace(timer, seconds=timer.seconds - 8 * 3600)


@misrun("timers-are-durations", "6.5/22")
class TimersAreDurations(_Timers):
    """A timer waits for its seconds from now on."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Double them."""
        return replace(timer, seconds=2 * timer.seconds)


# ---------------------------------------------------------------------- inputs


class _Conditions(Run):
    """Waits for something else of an input."""

    def meant(self, wait: WaitInput) -> WaitInput:
        """What it waits for."""
        return wait

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return super()._wait_ends_s(
            self.meant(wait) if isinstance(wait, WaitInput) else wait, now_s
        )


class _OtherConditions(_Conditions):
    """Takes conditions for others."""

    others: ClassVar[Mapping[int, Condition]]

    def meant(self, wait: WaitInput) -> WaitInput:
        """With the other condition."""
        return replace(wait, condition=self.others.get(wait.condition, wait.condition))


@misrun("conditions-as-operators", "6.5/9")
class ConditionsAsOperators(_OtherConditions):
    """Conditions 4 and 5 have each other's meaning, in the order of the operators 8 and 9."""

    others = MappingProxyType(
        {Condition.NOT_GREATER: Condition.NOT_LESS, Condition.NOT_LESS: Condition.NOT_GREATER}
    )


@misrun("greater-on-the-edge", "6.5/9", subtle=True)
class GreaterOnTheEdge(_OtherConditions):
    """Condition 1 holds on its edge too."""

    others = MappingProxyType({Condition.GREATER: Condition.NOT_LESS})


@misrun("less-on-the-edge", "6.5/9", subtle=True)
class LessOnTheEdge(_OtherConditions):
    """Condition 2 holds on its edge too."""

    others = MappingProxyType({Condition.LESS: Condition.NOT_GREATER})


@misrun("equal-below-the-edge", "6.5/9", subtle=True)
class EqualBelowTheEdge(_OtherConditions):
    """Condition 3 holds below its edge too."""

    others = MappingProxyType({Condition.EQUAL: Condition.NOT_GREATER})


@misrun("not-greater-off-the-edge", "6.5/9", subtle=True)
class NotGreaterOffTheEdge(_OtherConditions):
    """Condition 4 does not hold on its edge."""

    others = MappingProxyType({Condition.NOT_GREATER: Condition.LESS})


@misrun("not-less-off-the-edge", "6.5/9", subtle=True)
class NotLessOffTheEdge(_OtherConditions):
    """Condition 5 does not hold on its edge."""

    others = MappingProxyType({Condition.NOT_LESS: Condition.GREATER})


@misrun("compares-the-value-with-the-input", "6.5/9")
class ComparesTheValueWithTheInput(_OtherConditions):
    """The value stands on the left of the condition and the input on the right."""

    others = MappingProxyType(
        {
            Condition.GREATER: Condition.LESS,
            Condition.LESS: Condition.GREATER,
            Condition.NOT_GREATER: Condition.NOT_LESS,
            Condition.NOT_LESS: Condition.NOT_GREATER,
        }
    )


@misrun("compares-wholes", "6.5/9", subtle=True)
class ComparesWholes(_Conditions):
    """What is less than one is left out of the value that an input is compared with."""

    def meant(self, wait: WaitInput) -> WaitInput:
        """With a whole value; a digital 1 may be stored as 1."""
        whole = wait.value_hundredths // 100 * 100 or wait.value_hundredths % 2
        return replace(wait, value_hundredths=whole)


@misrun("analog-inputs-unscaled", "6.5/9")
class AnalogInputsUnscaled(Run):
    """Analog inputs are compared as they are and not in hundredths."""

    def _input(self, port: int) -> int:
        value = super()._input(port)
        return value // 100 if self._is_analog(port) else value


@misrun("digital-inputs-of-all-ones", "6.5/9")
class DigitalInputsOfAllOnes(Run):
    """A digital input that is on counts 255."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        if isinstance(wait, WaitInput) and not self._is_analog(wait.port):
            state = 0xFF * self._input(wait.port)
            holds = Condition(wait.condition).holds(state, wait.value_hundredths)
            return now_s if holds else math.inf
        return super()._wait_ends_s(wait, now_s)


@misrun("inputs-are-passed", "6.5/21", "6.5/9")
class InputsArePassed(_Conditions):
    """A program does not wait for inputs."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return now_s if isinstance(wait, WaitInput) else super()._wait_ends_s(wait, now_s)


@misrun("inputs-are-looked-at-once", "6.5/21")
class InputsAreLookedAtOnce(_Conditions):
    """An input that does not meet its condition at first is never looked at again."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._failed_at: set[int] = set()

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        ends_s = super()._wait_ends_s(wait, now_s)
        if ends_s == math.inf:
            self._failed_at.add(id(wait))
        return math.inf if id(wait) in self._failed_at else ends_s


@misrun("inputs-time-out", "6.5/21", subtle=True)
class InputsTimeOut(_Conditions):
    """A wait for an input is given up after less than half a second."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._begun_s: dict[int, float] = {}

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        ends_s = super()._wait_ends_s(wait, now_s)
        if isinstance(wait, WaitTimer):
            return ends_s
        return min(ends_s, self._begun_s.setdefault(id(wait), now_s) + _PATIENCE_S)


@misrun("waits-for-the-port-above", "6.5/21")
class WaitsForThePortAbove(_Conditions):
    """A program waits for the input above the one that its node names."""

    def meant(self, wait: WaitInput) -> WaitInput:
        """Go one on, but for analog inputs."""
        return wait if self._is_analog(wait.port) else replace(wait, port=wait.port % 7 + 1)


@misrun("waits-for-any-input", "6.5/21")
class WaitsForAnyInput(_Conditions):
    """A wait for an input ends as soon as any input meets the condition."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        if isinstance(wait, WaitTimer) or self._is_analog(wait.port):
            return super()._wait_ends_s(wait, now_s)
        ports = range(1, 7)
        return min(
            super(type(self), self)._wait_ends_s(replace(wait, port=p), now_s) for p in ports
        )


@misrun("ends-after-an-input", "6.5/21")
class EndsAfterAnInput(_Conditions):
    """A program that has waited for an input ends when it comes, with what follows undone."""

    def _step(self, now_s: float) -> None:
        if isinstance(self._wait, WaitInput):
            self._index = len(self._program.nodes)
        super()._step(now_s)
