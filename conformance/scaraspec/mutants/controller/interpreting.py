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
    *requirements: str, reading: tuple[str, ...] = (), subtle: bool = False
) -> Callable[[R], R]:
    """Enter a controller with this interpreter as a fault that violates these requirements."""

    def enter(run: R) -> R:
        says = {"interpreter": run, "__doc__": run.__doc__, "__module__": run.__module__}
        mutant(*requirements, reading=reading, subtle=subtle)(
            type(run.__name__, (ControllerCore,), says)
        )
        return run

    return enter
