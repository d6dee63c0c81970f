"""Plan: which cases a run tries, and why it skips the others.

The plan is made before anything is sent. It shows what the robot may move and what may be lost.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Reason
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.hooks import missing_hooks_message
from scaraspec.suite.engine.ics import Ics
from scaraspec.user_message import UserMessage


class HazardError(ValueError):
    """The name of a hazard does not exist."""


ALL: Final = frozenset(Hazard)


@dataclass(frozen=True, slots=True)
class Options:
    """The options of the user.

    Attributes:
        only: The ids of the requirements to test; None for all.
        allowed: The permitted hazards; read-only is always permitted.
        undefined: Undefined opcodes may be sent.
        seed: The seed of all random values.
        examples: How many values a case tries that draws its values.
        exhaustive: Run all cases of a requirement, even after one has failed.
        attended: An operator is present. For a client, run only the cases on the checklist of an
            operator; for a controller, the operator replaces hooks that the ICS does not define.
        brief: Skip slow cases whose requirements other cases judge, too.
        cases: The ids of cases to run besides those of `only`.
        required: The requirements that must be judged; otherwise the run is inconclusive.
        required_percent: The share of the requirements in scope that must be judged.
        fail_fast: Run no further case after one has failed.
        certification: The list of mandatory cases, with its checksum; empty for any other run.
    """

    only: frozenset[str] | None = None
    allowed: frozenset[Hazard] = frozenset({Hazard.READ_ONLY})
    undefined: bool = False
    seed: int = 0
    examples: int = 20
    exhaustive: bool = False
    attended: bool = False
    brief: bool = False
    cases: frozenset[str] = frozenset()
    required: frozenset[str] = frozenset()
    required_percent: float = 0.0
    fail_fast: bool = False
    certification: str = ""

    @property
    def summary(self) -> dict[str, str]:
        """The options by name, for the results."""
        allowed = sorted(hazard.value for hazard in self.allowed - {Hazard.READ_ONLY})
        selected = [*sorted(self.only or ()), *sorted(map(item_of, self.cases))]
        return {
            "allow": ",".join(allowed),
            "only": ",".join(selected),
            "examples": f"{self.examples}",
            "exhaustive": str(self.exhaustive).lower(),
            "undefined_opcodes": str(self.undefined).lower(),
            "attended": str(self.attended).lower(),
            "fail_fast": str(self.fail_fast).lower(),
            **({"certification": self.certification} if self.certification else {}),
        }


ONE_CASE: Final = "case:"
"""Begins an item of a selection that names a case, and not the requirement with the same id."""


def item_of(case_id: str) -> str:
    """Return the item of a selection that names this case alone."""
    return f"{ONE_CASE}{case_id}" if case_id in REQUIREMENTS else case_id


def hazards(text: str) -> frozenset[Hazard]:
    """Return the hazards of a comma-separated list, and read-only.

    Raises:
        HazardError: A name is not a hazard.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    known = {hazard.value: hazard for hazard in Hazard}
    for name in names:
        if name not in known:
            raise HazardError(
                UserMessage(
                    "{name!r} is not a hazard: choose from {known}",
                    name=name,
                    known=", ".join(known),
                )
            )
    return frozenset({Hazard.READ_ONLY, *(known[name] for name in names)})


class Skip(NamedTuple):
    """Why a case cannot run: a code for programs, a sentence, and the hooks that it needs."""

    reason: Reason
    message: str
    missing_hooks: tuple[str, ...] = ()


def skip_reason(case: Case, options: Options, ics: Ics) -> Skip | None:
    """Return why a case cannot run; None if it can."""
    if missing := case.hazards - options.allowed - {Hazard.READ_ONLY}:
        names = ",".join(sorted(hazard.value for hazard in missing))
        text = "it has a hazard that is not allowed: --allow {hazards}"
        return Skip(Reason.HAZARD, UserMessage(text, hazards=names))
    if case.undefined and not options.undefined:
        message = "it sends undefined opcodes: --undefined-opcodes, never on a real robot"
        return Skip(Reason.UNDEFINED_OPCODES, message)
    if options.brief and case.slow:
        message = "it is slow, and other cases judge its requirements, too: --exhaustive runs it"
        return Skip(Reason.SLOW, message)
    missing_hooks = tuple(name for name in case.needs if name not in ics.hooks)
    if missing_hooks and not asks_operator(case, options, ics):
        return Skip(Reason.HOOK, missing_hooks_message(missing_hooks), missing_hooks)
    return None


def asks_operator(case: Case, options: Options, ics: Ics) -> bool:
    """Return whether a case may ask an operator: for a controller, in place of a missing hook."""
    replaces = not case.needs or not ics.hooks.keys() >= {*case.needs}
    return options.attended and case.attended and replaces


def is_selected(case: Case, options: Options) -> bool:
    """Whether the options select a case."""
    if options.attended and case.role is Role.CLIENT and not case.attended:
        return False
    if options.only is None or case.id in options.cases:
        return True
    return any(requirement in options.only for requirement in case.requirements)
