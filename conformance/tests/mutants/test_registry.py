"""What is entered as a seeded fault, and what is refused."""

from abc import ABC, abstractmethod

import pytest

from scaraspec.mutants.registry import MutantRegistry


class _Client(ABC):
    @abstractmethod
    def data(self) -> bytes:
        """What it sends."""


def test_a_template_is_no_fault() -> None:
    """What nothing can be made of would never run, and so would never be found either."""
    registry = MutantRegistry[type[_Client]](lambda wrong: wrong)
    with pytest.raises(TypeError, match="the fault sends-nothing lacks data"):

        @registry.mutant("4.1/1")
        class SendsNothing(_Client):
            """It sends nothing."""


def test_names_are_unique() -> None:
    """A second fault of a name would hide the first."""
    registry = MutantRegistry[type](lambda wrong: wrong)

    class Silent:
        """It says nothing."""

    registry.mutant("4.1/1")(Silent)
    with pytest.raises(ValueError, match="there is a fault silent already"):
        registry.mutant("4.1/1")(Silent)
