"""Plan: which cases a run tries, and why it leaves the others out.

Made before anything is sent, so that a tester sees what may move or be lost.
"""

from dataclasses import dataclass
from typing import Final

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
    """

    only: frozenset[str] | None = None
    allowed: frozenset[Hazard] = frozenset({Hazard.READ_ONLY})
    undefined: bool = False
    seed: int = 0
    examples: int = 20
    exhaustive: bool = False
    attended: bool = False
    brief: bool = False


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


def skip_reason(case: Case, options: Options, ics: Ics) -> str:
    """Why a case cannot run; empty where it can."""
    if missing := case.hazards - options.allowed - {Hazard.READ_ONLY}:
        names = ",".join(sorted(hazard.value for hazard in missing))
        return f"it may do what was not allowed: --allow {names}"
    if case.undefined and not options.undefined:
        return "it sends undefined opcodes: --undefined-opcodes, never on a real robot"
    if options.brief and case.slow:
        return "it takes long, and others judge its requirements, too: --exhaustive tries it"
    if wanting := [name for name in case.needs if name not in ics.hooks]:
        hooks = ", ".join(wanting)
        return f"it needs {hooks} in [hooks] of the statement of conformance"
    return ""


def is_selected(case: Case, options: Options) -> bool:
    """Whether a case judges anything that was asked for."""
    if options.attended and not case.attended:
        return False
    return options.only is None or any(r in options.only for r in case.requirements)
