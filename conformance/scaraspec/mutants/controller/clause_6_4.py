"""Faults of clause 6.4: the values with which variables begin."""

from typing import Any

from scaraspec.mutants.operators.controller.programs import misrun
from scaraspec.virtual_controller.interpreter import Run


class _Initial(Run):
    """An interpreter that changes the first values."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._variables = self.begin(self._variables)

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """The values with which it begins in place of those of the file."""
        return values


@misrun("variables-begin-at-zero", "6.4/5")
class VariablesBeginAtZero(_Initial):
    """Every variable begins at 0, whatever the file says."""

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """Forget them."""
        return dict.fromkeys(values, 0)


@misrun("variables-of-two-bytes", "6.4/5")
class VariablesOfTwoBytes(_Initial):
    """Only the lower two bytes of a variable's first value are read."""

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """Cut them."""
        return {key: (value + 2**15) % 2**16 - 2**15 for key, value in values.items()}


@misrun("unsigned-variables", "6.4/5")
class UnsignedVariables(_Initial):
    """First values below zero are taken for 0."""

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """Raise them."""
        return {key: max(value, 0) for key, value in values.items()}


@misrun("last-variable-forgotten", "6.4/5", subtle=True)
class LastVariableForgotten(_Initial):
    """The last variable of a file begins at 0."""

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """Forget it."""
        return {**values, list(values)[-1]: 0} if values else values


@misrun("thirty-two-variables", "6.4/5", subtle=True)
class ThirtyTwoVariables(_Initial):
    """Variables behind the 32nd begin at 0."""

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """Forget them."""
        return {key: value if at < 32 else 0 for at, (key, value) in enumerate(values.items())}


@misrun("variables-sorted-by-key", "6.4/5")
class VariablesSortedByKey(_Initial):
    """Keys are sorted and values are not, so that values go to other variables."""

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """Mix them up."""
        return dict(zip(sorted(values), values.values(), strict=True))


@misrun("values-of-the-program-before", "6.4/5", subtle=True)
class ValuesOfTheProgramBefore(_Initial):
    """A variable begins with what the program before has left under its key."""

    def begin(self, values: dict[int, int]) -> dict[int, int]:
        """Take what was left."""
        left: dict[int, int] = self._plant.__dict__.setdefault("left", {})
        for key, value in values.items():
            left.setdefault(key, value)
        return left


@misrun("values-of-its-simulation", "6.4/5", subtle=True)
class ValuesOfItsSimulation(Run):
    """A run begins with the values that a simulation has left, whatever the file says."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        left: dict[int, int] = self._plant.__dict__.setdefault("simulated", {})
        if self._simulated:
            self._plant.__dict__["simulated"] = self._variables
        else:
            self._variables |= {key: left[key] for key in self._variables if key in left}
