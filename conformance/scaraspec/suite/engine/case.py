"""Case: the properties of a test of the suite, so that a plan can be made before anything runs.

A case names the requirements that it judges, the worst that it can do to a real robot, and what it
needs beyond a link. Nothing is run here.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar

import pytest

from scaraspec.judge.requirements import Method, Requirement, requirement
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role

MARK: Final = "scaraspec_case"

_GRAVITY: Final = (Hazard.READ_ONLY, Hazard.STATE, Hazard.MOTION, Hazard.DESTRUCTIVE)

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Case:
    """One thing that the suite tries.

    Attributes:
        id: Its first requirement, with a short suffix where that has several cases.
        requirements: What it judges, the ids of the catalogue.
        hazards: What it may do to a real robot; each of them has to be allowed.
        needs: Hooks of the statement of conformance without which it cannot run.
        sentence: What it tries, in one line.
        undefined: It sends undefined opcodes.
        last: The subject may be gone afterwards.
        slow: It takes long, and other cases judge all of its requirements, too.
        attended: It is on the checklist of an operator, too.
        role: Whom it tries.
    """

    id: str
    requirements: tuple[str, ...]
    hazards: frozenset[Hazard]
    needs: tuple[str, ...] = ()
    sentence: str = ""
    undefined: bool = False
    last: bool = False
    slow: bool = False
    attended: bool = False
    role: Role = Role.CONTROLLER

    @property
    def turn(self) -> int:
        """The order of execution: cases about connections and frames come last.

        They may crash the device; its normal behaviour must be tested before.
        """
        return 2 if self.last else int(self.requirements[0].startswith(("2/", "3/")))

    @property
    def hazard(self) -> Hazard:
        """The worst of its hazards."""
        return max(self.hazards, key=_GRAVITY.index)


def client_case(*requirements: str, name: str = "", attended: bool = False) -> Callable[[F], F]:
    """Make a test function a case that plays the controller.

    Args:
        requirements: What it judges; its id is the first of them.
        name: The suffix of its id where the first requirement has several cases.
        attended: It is on the checklist of an operator, too.

    Raises:
        UnknownRequirementError: A requirement does not exist.
        ValueError: A requirement cannot be tested on a client.
    """
    _check(requirements, Method.ACTIVE_CLIENT, "controller")
    nothing = frozenset({Hazard.READ_ONLY})
    identity = _identity(requirements, name)
    made = Case(identity, requirements, nothing, attended=attended, role=Role.CLIENT)
    return _marked(made)


def case(  # noqa: PLR0913 - one for each property of a case
    *requirements: str,
    name: str = "",
    hazards: tuple[Hazard, ...] = (),
    needs: tuple[str, ...] = (),
    undefined: bool = False,
    last: bool = False,
    slow: bool = False,
) -> Callable[[F], F]:
    """Make a test function a case that plays the client.

    Args:
        requirements: What it judges; its id is the first of them.
        name: The suffix of its id where the first requirement has several cases.
        hazards: What it may do to a real robot; by default the catalogue's hazards.
        needs: Hooks without which it cannot run.
        undefined: It sends undefined opcodes.
        last: It ends the subject.
        slow: It takes long, and other cases judge all of its requirements, too.

    Raises:
        UnknownRequirementError: A requirement does not exist.
        ValueError: A requirement cannot be tested on a controller.
    """
    entries = _check(requirements, Method.ACTIVE_CONTROLLER, "client")
    worst = frozenset(hazards or (entry.hazard for entry in entries)) | {Hazard.READ_ONLY}
    identity = _identity(requirements, name)
    made = Case(identity, requirements, worst, needs, undefined=undefined, last=last, slow=slow)
    return _marked(made)


def _check(requirements: tuple[str, ...], method: Method, part: str) -> list[Requirement]:
    entries = [requirement(r) for r in requirements]
    for entry in entries:
        if method not in entry.testable:
            raise ValueError(f"{entry.id} cannot be tested by playing the {part}")
    return entries


def _identity(requirements: tuple[str, ...], name: str) -> str:
    return f"{requirements[0]}.{name}" if name else requirements[0]


def _marked(made: Case) -> Callable[[F], F]:
    """A decorator that marks a test function with its case."""

    def mark(function: F) -> F:
        told = replace(made, sentence=(function.__doc__ or "").strip().partition("\n")[0])
        return getattr(pytest.mark, MARK)(told)(function)  # type: ignore[no-any-return] # pytest returns what it marks

    return mark


def declare_mark(config: pytest.Config) -> None:
    """Tell pytest of the mark that cases bear."""
    config.addinivalue_line("markers", f"{MARK}(case): a case of the suite")


def is_case(item: pytest.Item) -> bool:
    """Whether a collected test is a case of the suite."""
    return item.get_closest_marker(MARK) is not None


def case_of(item: pytest.Item) -> Case:
    """The case of a collected test, named apart where it has parameters.

    Raises:
        TypeError: The test is no case.
    """
    mark = item.get_closest_marker(MARK)
    if mark is None:
        raise TypeError(f"{item.nodeid} is no case: give it @case")
    made: Case = mark.args[0]
    parameters = getattr(item, "callspec", None)
    if parameters is None or not parameters.id:
        return made
    dot = "." if "." not in made.id.partition("/")[2] else "-"
    return replace(made, id=f"{made.id}{dot}{parameters.id}")
