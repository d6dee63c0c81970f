"""Mutants of the virtual controller; see `mutants.registry`."""

import sys
from collections.abc import Mapping
from functools import cache
from typing import Final

from scaraspec.mutants import registry
from scaraspec.mutants.operators.controller.programs import with_interpreter
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run

Core = type[ControllerCore]
ControllerMutant = registry.Mutant[Core]


def _controller(wrong: type[ControllerCore] | type[Run]) -> Core:
    """Return a controller for a faulty interpreter, and a faulty controller unchanged."""
    return with_interpreter(wrong) if issubclass(wrong, Run) else wrong


_MUTANTS: Final = registry.MutantRegistry[Core](_controller)
mutant = _MUTANTS.mutant
row = _MUTANTS.row


@cache
def mutants() -> Mapping[str, ControllerMutant]:
    """Return all mutants by id, in the order of the clauses of the document."""
    return _MUTANTS.all(sys.modules[__name__])
