"""Mutants of the virtual controller; see `mutants.registry`."""

import sys
from collections.abc import Mapping
from functools import cache
from typing import Final

from scaraspec.mutants import registry
from scaraspec.virtual_controller.core import ControllerCore

Core = type[ControllerCore]
ControllerMutant = registry.Mutant[Core]

_MUTANTS: Final = registry.MutantRegistry[Core](lambda core: core)
mutant = _MUTANTS.mutant
row = _MUTANTS.row


@cache
def mutants() -> Mapping[str, ControllerMutant]:
    """Return all mutants by id, in the order of the clauses of the document."""
    return _MUTANTS.all(sys.modules[__name__])
