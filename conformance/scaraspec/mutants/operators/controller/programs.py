"""Interpreting: how an interpreter that errs becomes a seeded fault.

A controller that runs programs wrongly is right in all else, so that its interpreter is the whole
of the fault, and bears its name and its sentence.
"""

from collections.abc import Callable
from typing import TypeVar

from scaraspec.mutants.controller import mutant
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run

R = TypeVar("R", bound=type[Run])


def misrun(
    mutant_id: str, *requirements: str, reading: tuple[str, ...] = (), subtle: bool = False
) -> Callable[[R], R]:
    """Register a controller with this interpreter as a mutant that violates these requirements."""

    def enter(run: R) -> R:
        says = {"interpreter": run, "__doc__": run.__doc__, "__module__": run.__module__}
        core = type(run.__name__, (ControllerCore,), says)
        mutant(mutant_id, *requirements, reading=reading, subtle=subtle)(core)
        return run

    return enter
