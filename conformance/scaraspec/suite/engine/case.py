"""Case: the properties of a test of the suite. A plan is made from them before anything runs.

A case names the requirements that it judges, its hazards for a real robot, and the hooks that it
needs. This module runs nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from inspect import cleandoc
from typing import TYPE_CHECKING, Any, Final, TypeVar

from scaraspec.judge.requirements import Method, Requirement, requirement
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role

if TYPE_CHECKING:
    import pytest

MARK: Final = "scaraspec_case"

_BY_SEVERITY: Final = (Hazard.READ_ONLY, Hazard.STATE, Hazard.MOTION, Hazard.DESTRUCTIVE)

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Case:
    """One thing that the suite tries.

    Attributes:
        id: The first requirement, with a short suffix if it has several cases.
        requirements: The ids of the requirements that the case judges.
        hazards: What the case may do to a real robot; each hazard must be allowed.
        needs: The hooks of the ICS without which the case cannot run.
        sentence: What the case tries, in one line.
        undefined: The case sends undefined opcodes.
        last: The subject may be switched off afterwards.
        slow: The case is slow, and other cases judge all of its requirements, too.
        attended: The case is also on the checklist of an operator; for a controller, an operator
            may replace its hooks.
        role: The role of the subject.
        purpose: The whole docstring of the case; `sentence` is its first line.
        function: The name of the function in the file of the case.
        parameters: The values of this case if its function has several, such as ``name = jog``.
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
    purpose: str = ""
    function: str = ""
    parameters: str = ""

    @property
    def paragraphs(self) -> tuple[str, ...]:
        """The paragraphs of the purpose, each in one line; the first is `sentence`."""
        return tuple(" ".join(each.split()) for each in self.purpose.split("\n\n"))

    @property
    def turn(self) -> int:
        """The order of execution: cases about connections and frames come last.

        They may crash the device; its normal behaviour must be tested before.
        """
        return 2 if self.last else int(self.requirements[0].startswith(("2/", "3/")))

    @property
    def hazard(self) -> Hazard:
        """The most severe hazard of the case."""
        return max(self.hazards, key=_BY_SEVERITY.index)


def client_case(*requirements: str, name: str = "", attended: bool = False) -> Callable[[F], F]:
    """Make a test function a case in which the suite acts as the controller.

    Args:
        requirements: The requirements that it judges; the first one is its id.
        name: The suffix of the id if the first requirement has several cases.
        attended: The case is also on the checklist of an operator.

    Raises:
        UnknownRequirementError: A requirement does not exist.
        ValueError: A requirement cannot be tested on a client.
    """
    _check(requirements, Method.ACTIVE_CLIENT, "controller")
    hazards = frozenset({Hazard.READ_ONLY})
    case_id = _case_id(requirements, name)
    return _marked(Case(case_id, requirements, hazards, attended=attended, role=Role.CLIENT))


def case(  # noqa: PLR0913 - one for each property of a case
    *requirements: str,
    name: str = "",
    hazards: tuple[Hazard, ...] = (),
    needs: tuple[str, ...] = (),
    undefined: bool = False,
    attended: bool = False,
    last: bool = False,
    slow: bool = False,
) -> Callable[[F], F]:
    """Make a test function a case in which the suite acts as the client.

    Args:
        requirements: The requirements that it judges; the first one is its id.
        name: The suffix of the id if the first requirement has several cases.
        hazards: What it may do to a real robot; by default the hazards of its requirements.
        needs: The hooks without which it cannot run.
        undefined: The case sends undefined opcodes.
        attended: An operator may replace the hooks: the case does not depend on the moment at which
            they act, and asks only a few times.
        last: The case may switch the subject off.
        slow: The case is slow, and other cases judge all of its requirements, too.

    Raises:
        UnknownRequirementError: A requirement does not exist.
        ValueError: A requirement cannot be tested on a controller.
    """
    entries = _check(requirements, Method.ACTIVE_CONTROLLER, "client")
    own = frozenset(hazards or (entry.hazard for entry in entries)) | {Hazard.READ_ONLY}
    case_id = _case_id(requirements, name)
    return _marked(
        Case(
            case_id,
            requirements,
            own,
            needs,
            undefined=undefined,
            attended=attended,
            last=last,
            slow=slow,
        )
    )


def _check(requirements: tuple[str, ...], method: Method, suite_role: str) -> list[Requirement]:
    entries = [requirement(r) for r in requirements]
    for entry in entries:
        if method not in entry.testable:
            raise ValueError(f"{entry.id} cannot be tested if the suite acts as the {suite_role}")
    return entries


def _case_id(requirements: tuple[str, ...], name: str) -> str:
    return f"{requirements[0]}.{name}" if name else requirements[0]


def _marked(case_: Case) -> Callable[[F], F]:
    """Return a decorator that marks a test function with its case."""

    def mark(function: F) -> F:
        purpose = cleandoc(function.__doc__ or "")
        marked = replace(
            case_,
            sentence=purpose.partition("\n")[0],
            purpose=purpose,
            function=function.__name__,
        )
        import pytest  # noqa: PLC0415 - other commands than certify start sooner without it

        return getattr(pytest.mark, MARK)(marked)(function)  # type: ignore[no-any-return] # pytest returns what it marks

    return mark


def declare_mark(config: "pytest.Config") -> None:
    """Register the mark of cases with pytest."""
    config.addinivalue_line("markers", f"{MARK}(case): a case of the suite")


def is_case(item: "pytest.Item") -> bool:
    """Whether a collected test is a case of the suite."""
    return item.get_closest_marker(MARK) is not None


def case_of(item: "pytest.Item") -> Case:
    """Return the case of a collected test. The id of a parametrized case has a suffix.

    Raises:
        TypeError: The test is not a case.
    """
    mark = item.get_closest_marker(MARK)
    if mark is None:
        raise TypeError(f"{item.nodeid} is not a case: add the decorator @case")
    marked: Case = mark.args[0]
    parameters = getattr(item, "callspec", None)
    if parameters is None or not parameters.id:
        return marked
    separator = "." if "." not in marked.id.partition("/")[2] else "-"
    return replace(
        marked,
        id=f"{marked.id}{separator}{parameters.id}",
        parameters=f"{', '.join(parameters.params)} = {parameters.id}",
    )
