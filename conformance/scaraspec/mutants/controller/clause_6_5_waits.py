"""Mutants of clause 6.5: nodes that wait for a time or an input."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.programs import with_interpreter
from scaraspec.protocol.program_files import Condition, Node, WaitInput, WaitSeconds, WaitTimer
from scaraspec.virtual_controller.interpreter import Run

Wait = WaitInput | WaitTimer

_ANALOG = (7, 8)  # the ports that the programs of the suite configure as analog inputs

# ---------------------------------------------------------------------- waits


def _duration(change: Callable[[float], float]) -> Core:
    """The seconds of waits are changed."""

    class ChangedDuration(Run):
        def _begin(self, node: Node, now_s: float) -> float:
            if isinstance(node.data, WaitSeconds):
                return now_s + change(node.data.duration_s)
            return super()._begin(node, now_s)

    return with_interpreter(ChangedDuration)


def _wait(kind: type[Wait], change: Callable[[Any], Wait | None]) -> Core:
    """Waits of one kind are changed; for None the program does not wait."""

    class ChangedWait(Run):
        def _wait_ends_s(self, wait: Wait, now_s: float) -> float:
            changed = change(wait) if isinstance(wait, kind) else wait
            return now_s if changed is None else super()._wait_ends_s(changed, now_s)

    return with_interpreter(ChangedWait)


row(
    "waits-milliseconds",
    "6.5/20",
    "The seconds of a wait are read as milliseconds.",
    _duration(lambda duration_s: duration_s / 1000),
)
row(
    "waits-one-fifth-longer",
    "6.5/20",
    "A wait takes a fifth longer than its seconds.",
    _duration(lambda duration_s: duration_s * 1.2),
)
row(
    "waits-one-second-more",
    "6.5/20",
    "A wait takes one second more than its seconds.",
    _duration(lambda duration_s: duration_s + 1),
)
row(
    "waits-slightly-less",
    "6.5/20",
    "A wait ends 0.05 s early.",
    _duration(lambda duration_s: max(duration_s - 0.05, 0)),
    subtle=True,
)
row(
    "waits-signed-bytes",
    "6.5/20",
    "A wait of 128 seconds or more ends at once, because its byte is read as negative.",
    _duration(lambda duration_s: duration_s if duration_s < 0x80 else 0),
    subtle=True,
)


@mutant("waits-the-second-time-for-nothing", "6.5/20", subtle=True)
class WaitsTwice(Run):
    """Only the first two waits of a program take time."""

    _waits = 0

    def _begin(self, node: Node, now_s: float) -> float:
        ends_s = super()._begin(node, now_s)
        self._waits += isinstance(node.data, WaitSeconds)
        return now_s if isinstance(node.data, WaitSeconds) and self._waits > 2 else ends_s


row(
    "waits-at-least-one-second",
    "6.5/20",
    "A wait takes at least one second.",
    _duration(lambda duration_s: max(duration_s, 1)),
)
row(
    "timers-are-passed",
    "6.5/22",
    "A program does not wait at a timer.",
    _wait(WaitTimer, lambda _timer: None),
)
row(
    "timers-of-whole-seconds",
    "6.5/22",
    "The microseconds of a timer are ignored.",
    _wait(WaitTimer, lambda timer: replace(timer, microseconds=0)),
)
row(
    "timers-one-second-late",
    "6.5/22",
    "A timer ends one second after its instant.",
    _wait(WaitTimer, lambda timer: replace(timer, seconds=timer.seconds + 1)),
)
row(
    "timers-of-another-zone",
    "6.5/22",
    "The instant of a timer is read as Chinese time, eight hours ahead.",
    _wait(WaitTimer, lambda timer: replace(timer, seconds=timer.seconds - 8 * 3600)),
)
row(
    "timers-are-durations",
    "6.5/22",
    "The seconds of a timer are counted from now.",
    _wait(WaitTimer, lambda timer: replace(timer, seconds=2 * timer.seconds)),
)

# ---------------------------------------------------------------------- inputs


def _conditions(others: Mapping[int, Condition]) -> Core:
    """Conditions are replaced by others."""
    return _wait(
        WaitInput,
        lambda wait: replace(wait, condition=others.get(wait.condition, wait.condition)),
    )


def _whole_value(wait: WaitInput) -> WaitInput:
    whole = wait.value_hundredths // 100 * 100
    return replace(wait, value_hundredths=whole or wait.value_hundredths % 2)  # 1: a digital 1


row(
    "conditions-as-operators",
    "6.5/9",
    "Conditions 4 and 5 are exchanged, in the order of the operators 8 and 9.",
    _conditions(
        {Condition.NOT_GREATER: Condition.NOT_LESS, Condition.NOT_LESS: Condition.NOT_GREATER}
    ),
)
row(
    "greater-on-the-edge",
    "6.5/9",
    "Condition 1 also holds for equal values.",
    _conditions({Condition.GREATER: Condition.NOT_LESS}),
    subtle=True,
)
row(
    "less-on-the-edge",
    "6.5/9",
    "Condition 2 also holds for equal values.",
    _conditions({Condition.LESS: Condition.NOT_GREATER}),
    subtle=True,
)
row(
    "equal-below-the-edge",
    "6.5/9",
    "Condition 3 also holds for smaller inputs.",
    _conditions({Condition.EQUAL: Condition.NOT_GREATER}),
    subtle=True,
)
row(
    "not-greater-off-the-edge",
    "6.5/9",
    "Condition 4 does not hold for equal values.",
    _conditions({Condition.NOT_GREATER: Condition.LESS}),
    subtle=True,
)
row(
    "not-less-off-the-edge",
    "6.5/9",
    "Condition 5 does not hold for equal values.",
    _conditions({Condition.NOT_LESS: Condition.GREATER}),
    subtle=True,
)
row(
    "compares-the-value-with-the-input",
    "6.5/9",
    "The value is the left operand of a condition and the input the right one.",
    _conditions(
        {
            Condition.GREATER: Condition.LESS,
            Condition.LESS: Condition.GREATER,
            Condition.NOT_GREATER: Condition.NOT_LESS,
            Condition.NOT_LESS: Condition.NOT_GREATER,
        }
    ),
)
row(
    "compares-wholes",
    "6.5/9",
    "The decimals of the value that an input is compared with are ignored.",
    _wait(WaitInput, _whole_value),
    subtle=True,
)


@mutant("analog-inputs-unscaled", "6.5/9")
class ReadsAnalogUnits(Run):
    """Analog inputs are compared in whole units, not in hundredths."""

    def _input(self, port: int) -> int:
        value = super()._input(port)
        return value // 100 if self._is_analog(port) else value


@mutant("digital-inputs-of-all-ones", "6.5/9")
class ReadsDigitalAs255(Run):
    """A digital input that is on has the value 255."""

    def _wait_ends_s(self, wait: Wait, now_s: float) -> float:
        if isinstance(wait, WaitInput) and not self._is_analog(wait.port):
            state = 0xFF * self._input(wait.port)
            holds = Condition(wait.condition).holds(state, wait.value_hundredths)
            return now_s if holds else math.inf
        return super()._wait_ends_s(wait, now_s)


row(
    "inputs-are-passed",
    "6.5/21 6.5/9",
    "A program does not wait for inputs.",
    _wait(WaitInput, lambda _input: None),
)


row(
    "analog-inputs-are-passed",
    "6.5/21 6.5/9",
    "A program does not wait for analog inputs.",
    _wait(WaitInput, lambda wait: None if wait.port in _ANALOG else wait),
)
row(
    "analog-inputs-are-waited-for-forever",
    "6.5/21 6.5/9",
    "A wait for an analog input never ends.",
    _wait(
        WaitInput,
        lambda wait: (
            replace(wait, condition=Condition.GREATER, value_hundredths=2**32 - 1)
            if wait.port in _ANALOG
            else wait
        ),
    ),
)


@mutant("inputs-are-looked-at-once", "6.5/21")
class ReadsInputOnce(Run):
    """An input that does not fulfil its condition at first is never read again."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self._failed: set[int] = set()

    def _wait_ends_s(self, wait: Wait, now_s: float) -> float:
        ends_s = super()._wait_ends_s(wait, now_s)
        if ends_s == math.inf:
            self._failed.add(id(wait))
        return math.inf if id(wait) in self._failed else ends_s


@mutant("inputs-time-out", "6.5/21", subtle=True)
class TimesOut(Run):
    """A wait for an input ends after 0.4 s at the latest."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self._begun_s: dict[int, float] = {}

    def _wait_ends_s(self, wait: Wait, now_s: float) -> float:
        ends_s = super()._wait_ends_s(wait, now_s)
        if isinstance(wait, WaitTimer):
            return ends_s
        return min(ends_s, self._begun_s.setdefault(id(wait), now_s) + 0.4)


@mutant("waits-for-the-port-above", "6.5/21")
class WaitsForNextPort(Run):
    """A program waits for the digital input with the next number."""

    def _wait_ends_s(self, wait: Wait, now_s: float) -> float:
        if isinstance(wait, WaitInput) and not self._is_analog(wait.port):
            wait = replace(wait, port=wait.port % 7 + 1)
        return super()._wait_ends_s(wait, now_s)


@mutant("waits-for-any-input", "6.5/21")
class WaitsForAnyInput(Run):
    """A wait for a digital input ends as soon as any of them fulfils the condition."""

    def _wait_ends_s(self, wait: Wait, now_s: float) -> float:
        ends_s = super()._wait_ends_s
        if isinstance(wait, WaitTimer) or self._is_analog(wait.port):
            return ends_s(wait, now_s)
        return min(ends_s(replace(wait, port=port), now_s) for port in range(1, 7))


@mutant("ends-after-an-input", "6.5/21")
class EndsAfterInput(Run):
    """A program that has waited for an input ends without executing the nodes after it."""

    def _step(self, now_s: float) -> None:
        if isinstance(self._wait, WaitInput):
            self._index = len(self._program.nodes)
        super()._step(now_s)
