"""Mutants of the virtual controller; see `mutants.registry`."""

import sys
from collections.abc import Mapping
from functools import cache
from typing import Final

from scaraspec.mutants import registry
from scaraspec.virtual_controller.core import ControllerCore

ControllerMutant = registry.Mutant[type[ControllerCore]]

_MUTANTS: Final = registry.MutantRegistry[type[ControllerCore]](lambda core: core)
mutant = _MUTANTS.mutant


@cache
def mutants() -> Mapping[str, ControllerMutant]:
    """All seeded faults by name, in the order of the document's clauses."""
    return _MUTANTS.all(sys.modules[__name__])
