"""The registry registers mutants and refuses abstract classes and duplicate ids."""

from abc import ABC, abstractmethod

import pytest

from scaraspec.mutants.registry import MutantRegistry


class _Client(ABC):
    @abstractmethod
    def data(self) -> bytes:
        """Return the data to send."""


def test_an_abstract_class_is_refused() -> None:
    """An abstract class could not be instantiated, so no case could kill it."""
    registry = MutantRegistry[type[_Client]](lambda wrong: wrong)
    with pytest.raises(TypeError, match="the mutant sends-nothing does not implement data"):

        @registry.mutant("sends-nothing", "4.1/1")
        class SendsNothing(_Client):
            """The client sends nothing."""


def test_ids_are_unique() -> None:
    """A second mutant with the same id would replace the first."""
    registry = MutantRegistry[type](lambda wrong: wrong)

    class Silent:
        """The client sends nothing."""

    registry.mutant("silent", "4.1/1")(Silent)
    with pytest.raises(ValueError, match="the mutant id silent is already registered"):
        registry.mutant("silent", "4.1/1")(Silent)
