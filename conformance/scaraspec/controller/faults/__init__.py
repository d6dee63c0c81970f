"""Seeded faults: virtual controllers that are wrong on purpose, one way each.

What the suite is worth is shown by what it finds: every fault here has to be found by a case of the
requirement that it violates. A fault changes one behaviour and leaves the rest as it is.
"""

import importlib
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Final, TypeVar

from scaraspec.controller.brain import Brain

B = TypeVar("B", bound=type[Brain])

_HUMP: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


@dataclass(frozen=True, slots=True)
class Fault:
    """One wrong controller.

    Attributes:
        name: Of its class, in lower case with hyphens.
        requirements: What it violates; each of them may be the one that finds it.
        sentence: What it does wrong.
        brain: The controller.
        reading: Readings under which the fault shows, as ``key=option``; none for the default.
    """

    name: str
    requirements: tuple[str, ...]
    sentence: str
    brain: type[Brain]
    reading: tuple[str, ...] = ()


_FAULTS: dict[str, Fault] = {}


def fault(*requirements: str, reading: tuple[str, ...] = ()) -> Callable[[B], B]:
    """Enter a brain as a seeded fault that violates these requirements.

    Raises:
        ValueError: Another fault bears its name.
    """

    def enter(brain: B) -> B:
        name = _HUMP.sub("-", brain.__name__).lower()
        if name in _FAULTS:
            raise ValueError(f"there is a fault {name} already")
        sentence = (brain.__doc__ or "").strip().partition("\n")[0]
        _FAULTS[name] = Fault(name, requirements, sentence, brain, reading)
        return brain

    return enter


@cache
def faults() -> Mapping[str, Fault]:
    """All seeded faults by name, in the order of the document's clauses."""
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda found: found.name):
        importlib.import_module(f"{__name__}.{module.name}")
    return MappingProxyType(_FAULTS)
