"""Registry of mutants: deliberately faulty controllers or clients, registered by a decorator.

A case of a requirement that the mutant violates must fail because of it. A mutant changes one
behaviour and leaves the rest as it is. The mutants are in `mutants.controller` and
`mutants.client`, one file per clause.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType, ModuleType
from typing import Any, Generic, TypeVar

T = TypeVar("T")
C = TypeVar("C", bound=type[Any])


@dataclass(frozen=True)
class Mutant(Generic[T]):
    """A faulty implementation.

    Attributes:
        name: The mutant id, as in ``prove --mutant ID``; in lower case with hyphens.
        requirements: The requirements that it violates; a failed case of any of them kills it.
        sentence: What the faulty device does.
        wrong: The faulty implementation.
        reading: Readings under which the fault is observable, as ``key=option``; empty for the
            default readings.
        subtle: Whether the fault shows only late, sometimes, at a limit, in one state, or to one
            of several connections.
    """

    name: str
    requirements: tuple[str, ...]
    sentence: str
    wrong: T
    reading: tuple[str, ...] = ()
    subtle: bool = False


class MutantRegistry(Generic[T]):
    """The mutants of one kind of implementation.

    Args:
        finish: Makes the faulty implementation from the decorated class.
    """

    def __init__(self, finish: Callable[[Any], T]) -> None:
        self._finish = finish
        self._mutants: dict[str, Mutant[T]] = {}

    def mutant(
        self,
        mutant_id: str,
        *requirements: str,
        reading: tuple[str, ...] = (),
        subtle: bool = False,
    ) -> Callable[[C], C]:
        """Register the decorated class as a mutant that violates these requirements.

        The first line of the docstring of the class is the sentence that ``prove --list`` prints.

        Args:
            mutant_id: The id, in lower case with hyphens; it is public and never changes.
            requirements: The requirements that the mutant violates.
            reading: Readings under which the fault is observable, as ``key=option``.
            subtle: Whether the fault shows only in few situations; see `Mutant`.

        Raises:
            ValueError: Another mutant has this id.
            TypeError: The class is abstract.
        """

        def register(wrong: C) -> C:
            if mutant_id in self._mutants:
                raise ValueError(f"the mutant id {mutant_id} is already registered")
            if inspect.isabstract(wrong):
                missing = ", ".join(sorted(wrong.__abstractmethods__))
                raise TypeError(f"the mutant {mutant_id} does not implement {missing}")
            sentence = (wrong.__doc__ or "").strip().partition("\n")[0]
            made = self._finish(wrong)
            self._mutants[mutant_id] = Mutant(
                mutant_id, requirements, sentence, made, reading, subtle
            )
            return wrong

        return register

    def all(self, package: ModuleType) -> Mapping[str, Mutant[T]]:
        """Import all modules of a package in the order of their names and return their mutants."""
        for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda found: found.name):
            importlib.import_module(f"{package.__name__}.{module.name}")
        return MappingProxyType(self._mutants)
