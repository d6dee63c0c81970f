"""Mutants of clause 6.4: the initial values of variables."""

from collections.abc import Callable
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.programs import with_interpreter
from scaraspec.virtual_controller.interpreter import Run

Values = dict[int, int]


def _initial(change: Callable[[Values], Values]) -> Core:
    """The initial values of variables are changed."""

    class InitialValues(Run):
        def __init__(self, *args: Any, **named: Any) -> None:
            super().__init__(*args, **named)
            self._variables = change(self._variables)

    return with_interpreter(InitialValues)


row(
    "variables-begin-at-zero",
    "6.4/5",
    "Every variable is initially 0.",
    _initial(lambda values: dict.fromkeys(values, 0)),
)
row(
    "variables-of-two-bytes",
    "6.4/5",
    "Only the lower two bytes of an initial value are read.",
    _initial(lambda values: {k: (v + 2**15) % 2**16 - 2**15 for k, v in values.items()}),
)
row(
    "unsigned-variables",
    "6.4/5",
    "Negative initial values are read as 0.",
    _initial(lambda values: {key: max(value, 0) for key, value in values.items()}),
)
row(
    "last-variable-forgotten",
    "6.4/5",
    "The last variable of a file is initially 0.",
    _initial(lambda values: values | dict.fromkeys(list(values)[-1:], 0)),
    subtle=True,
)
row(
    "thirty-two-variables",
    "6.4/5",
    "Variables after the 32nd are initially 0.",
    _initial(lambda values: values | dict.fromkeys(list(values)[32:], 0)),
    subtle=True,
)
row(
    "variables-sorted-by-key",
    "6.4/5",
    "Keys are sorted but values are not, so that variables have values of others.",
    _initial(lambda values: dict(zip(sorted(values), values.values(), strict=True))),
)


@mutant("values-of-the-program-before", "6.4/5", subtle=True)
class KeepsValuesOfEarlierPrograms(Run):
    """The initial value of a variable is the last value of its key in earlier programs."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        kept: Values = self._plant.__dict__.setdefault("kept_values", {})
        for key, value in self._variables.items():
            kept.setdefault(key, value)
        self._variables = kept


@mutant("values-of-its-simulation", "6.4/5", subtle=True)
class KeepsValuesOfSimulation(Run):
    """The initial values of a run are the last values of the last simulation."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        kept: Values = self._plant.__dict__.setdefault("simulated", {})
        if self._simulated:
            self._plant.__dict__["simulated"] = self._variables
        else:
            self._variables |= {key: kept[key] for key in self._variables if key in kept}
