"""Plan: which cases a run tries, and why it leaves the others out.

Made before anything is sent, so that a tester sees what may move or be lost.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from scaraspec.judge.verdicts import Reason
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.ics import Ics
from scaraspec.user_message import UserMessage


class HazardError(ValueError):
    """A name that is no hazard."""


ALL: Final = frozenset(Hazard)


@dataclass(frozen=True, slots=True)
class Options:
    """What a tester asks for.

    Attributes:
        only: The ids of the requirements in question; None for all.
        allowed: The hazards permitted; read-only is always.
        undefined: Undefined opcodes may be sent.
        seed: Of everything that is drawn at random.
        examples: How many values a drawn case tries.
        exhaustive: Go on with a requirement that has failed.
        attended: Only what is on the checklist of an operator.
        brief: Nothing that takes long and that others judge, too.
        cases: The ids of cases to run besides those of `only`.
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

    @property
    def summary(self) -> dict[str, str]:
        """The options by name, for the results."""
        allowed = sorted(hazard.value for hazard in self.allowed - {Hazard.READ_ONLY})
        selected = [*sorted(self.only or ()), *sorted(self.cases)]
        return {
            "allow": ",".join(allowed),
            "only": ",".join(selected),
            "examples": f"{self.examples}",
            "exhaustive": str(self.exhaustive).lower(),
            "undefined_opcodes": str(self.undefined).lower(),
            "attended": str(self.attended).lower(),
        }


def hazards(text: str) -> frozenset[Hazard]:
    """The hazards that a comma list names, and read-only.

    Raises:
        HazardError: One of them is none.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    known = {hazard.value: hazard for hazard in Hazard}
    for name in names:
        if name not in known:
            raise HazardError(
                UserMessage(
                    "{name!r} is no hazard: they are {known}", name=name, known=", ".join(known)
                )
            )
    return frozenset({Hazard.READ_ONLY, *(known[name] for name in names)})


class Skip(NamedTuple):
    """Why a case cannot run: a code for programs, and a sentence."""

    reason: Reason
    message: str


def skip_reason(case: Case, options: Options, ics: Ics) -> Skip | None:
    """Return why a case cannot run; None if it can."""
    if missing := case.hazards - options.allowed - {Hazard.READ_ONLY}:
        names = ",".join(sorted(hazard.value for hazard in missing))
        return Skip(Reason.HAZARD, f"it may do what was not allowed: --allow {names}")
    if case.undefined and not options.undefined:
        message = "it sends undefined opcodes: --undefined-opcodes, never on a real robot"
        return Skip(Reason.UNDEFINED_OPCODES, message)
    if options.brief and case.slow:
        message = "it takes long, and others judge its requirements, too: --exhaustive tries it"
        return Skip(Reason.SLOW, message)
    if missing_hooks := [name for name in case.needs if name not in ics.hooks]:
        hooks = ", ".join(missing_hooks)
        return Skip(Reason.HOOK, f"it needs {hooks} in [hooks] of the statement of conformance")
    return None


def is_selected(case: Case, options: Options) -> bool:
    """Whether a case judges anything that was asked for."""
    if options.attended and not case.attended:
        return False
    if options.only is None or case.id in options.cases:
        return True
    return any(requirement in options.only for requirement in case.requirements)
