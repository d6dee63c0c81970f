"""Registry of mutants: deliberately faulty controllers or clients, one row or class for each.

A case of a requirement that the mutant violates must fail because of it. A mutant changes one
behaviour and leaves the rest as it is. The mutants are in `mutants.controller` and
`mutants.client`, one file per clause.
"""

import importlib
import inspect
import pkgutil
import sys
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
        location: File and line of its registration.
    """

    name: str
    requirements: tuple[str, ...]
    sentence: str
    wrong: T
    reading: tuple[str, ...] = ()
    subtle: bool = False
    location: tuple[str, int] = ("", 0)


class MutantRegistry(Generic[T]):
    """The mutants of one kind of implementation.

    Args:
        finish: Makes the faulty implementation from the decorated class.
    """

    def __init__(self, finish: Callable[[Any], T]) -> None:
        self._finish = finish
        self._mutants: dict[str, Mutant[T]] = {}

    def row(
        self,
        mutant_id: str,
        requirements: str,
        sentence: str,
        *changes: type[Any],
        reading: tuple[str, ...] = (),
        subtle: bool = False,
    ) -> None:
        """Register a mutant that consists of operators; a mutant that keeps state is a class.

        Args:
            mutant_id: The id, in lower case with hyphens; it is public and never changes.
            requirements: The ids of the requirements that the mutant violates, with blanks between.
            sentence: What the faulty device does.
            changes: The classes that `mutants.operators` returns; the first one acts first.
            reading: Readings under which the fault is observable, as ``key=option``.
            subtle: Whether the fault shows only in few situations; see `Mutant`.

        Raises:
            ValueError: Another mutant has this id.
        """
        wrong = changes[0] if len(changes) == 1 else type("Mutant", changes, {})
        violated = tuple(requirements.split())
        self._add(
            Mutant(mutant_id, violated, sentence, self._finish(wrong), reading, subtle, _caller())
        )

    def mutant(
        self,
        mutant_id: str,
        *requirements: str,
        reading: tuple[str, ...] = (),
        subtle: bool = False,
    ) -> Callable[[C], C]:
        """Register the decorated class; the first line of its docstring is the sentence.

        Args and exceptions are those of `row`. An abstract class raises TypeError.
        """

        def register(wrong: C) -> C:
            if inspect.isabstract(wrong):
                missing = ", ".join(sorted(wrong.__abstractmethods__))
                raise TypeError(f"the mutant {mutant_id} does not implement {missing}")
            sentence = (wrong.__doc__ or "").strip().partition("\n")[0]
            made = self._finish(wrong)
            self._add(Mutant(mutant_id, requirements, sentence, made, reading, subtle, _caller()))
            return wrong

        return register

    def _add(self, mutant: Mutant[T]) -> None:
        if mutant.name in self._mutants:
            raise ValueError(f"the mutant id {mutant.name} is already registered")
        self._mutants[mutant.name] = mutant

    def all(self, package: ModuleType) -> Mapping[str, Mutant[T]]:
        """Import all modules of a package in the order of their names and return their mutants."""
        for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda found: found.name):
            importlib.import_module(f"{package.__name__}.{module.name}")
        return MappingProxyType(self._mutants)


def _caller() -> tuple[str, int]:
    """Return file and line of the row or decorator that registers a mutant."""
    frame = sys._getframe(2)  # noqa: SLF001 - inspect.stack() takes 1 s for all mutants
    return frame.f_code.co_filename, frame.f_lineno
