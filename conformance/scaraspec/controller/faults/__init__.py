"""Seeded faults: virtual controllers that are wrong on purpose, one way each; see `seeding`."""

import sys
from collections.abc import Mapping
from functools import cache
from typing import Final

from scaraspec import seeding
from scaraspec.controller.brain import Brain

Fault = seeding.Fault[type[Brain]]

_FAULTS: Final = seeding.Faults[type[Brain]](lambda brain: brain)
fault = _FAULTS.fault


@cache
def faults() -> Mapping[str, Fault]:
    """All seeded faults by name, in the order of the document's clauses."""
    return _FAULTS.all(sys.modules[__name__])
