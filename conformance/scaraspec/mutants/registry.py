"""Registry of mutants: deliberately faulty controllers or clients, entered by a decorator.

A case of a requirement that the mutant violates must fail because of it. A mutant changes one
behaviour and leaves the rest as it is. The mutants are in `mutants.controller` and
`mutants.client`, one file per clause.
"""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType, ModuleType
from typing import Any, Final, Generic, TypeVar

T = TypeVar("T")
C = TypeVar("C", bound=type[Any])

_HUMP: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


@dataclass(frozen=True)
class Mutant(Generic[T]):
    """One wrong implementation.

    Attributes:
        name: Of its class, in lower case with hyphens.
        requirements: What it violates; each of them may be the one that finds it.
        sentence: What it does wrong.
        wrong: The implementation.
        reading: Readings under which the fault shows, as ``key=option``; none for the default.
        subtle: It shows late, now and then, at an edge, in one state, or to one of several peers.
    """

    name: str
    requirements: tuple[str, ...]
    sentence: str
    wrong: T
    reading: tuple[str, ...] = ()
    subtle: bool = False


class MutantRegistry(Generic[T]):
    """The faults of one kind of implementation.

    Args:
        finish: Makes the implementation out of the class that the decorator finds.
    """

    def __init__(self, finish: Callable[[Any], T]) -> None:
        self._finish = finish
        self._entered: dict[str, Mutant[T]] = {}

    def mutant(
        self, *requirements: str, reading: tuple[str, ...] = (), subtle: bool = False
    ) -> Callable[[C], C]:
        """Enter a class as a seeded fault that violates these requirements.

        Raises:
            ValueError: Another fault bears its name.
            TypeError: The class lacks something without which nothing can be made of it.
        """

        def enter(wrong: C) -> C:
            name = _HUMP.sub("-", wrong.__name__).lower()
            if name in self._entered:
                raise ValueError(f"there is a fault {name} already")
            if inspect.isabstract(wrong):
                missing = ", ".join(sorted(wrong.__abstractmethods__))
                raise TypeError(f"the fault {name} lacks {missing}")
            sentence = (wrong.__doc__ or "").strip().partition("\n")[0]
            made = self._finish(wrong)
            self._entered[name] = Mutant(name, requirements, sentence, made, reading, subtle)
            return wrong

        return enter

    def all(self, package: ModuleType) -> Mapping[str, Mutant[T]]:
        """All of them by name, out of the modules of a package, in the order of their names."""
        for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda found: found.name):
            importlib.import_module(f"{package.__name__}.{module.name}")
        return MappingProxyType(self._entered)
