"""Mutants of the virtual controller; see `mutants.registry`."""

import sys
from collections.abc import Mapping
from functools import cache
from typing import Final

from scaraspec.mutants import registry
from scaraspec.virtual_controller.brain import Brain

Fault = registry.Fault[type[Brain]]

_FAULTS: Final = registry.Faults[type[Brain]](lambda brain: brain)
fault = _FAULTS.fault


@cache
def faults() -> Mapping[str, Fault]:
    """All seeded faults by name, in the order of the document's clauses."""
    return _FAULTS.all(sys.modules[__name__])
