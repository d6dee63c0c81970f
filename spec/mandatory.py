"""Write the lists of mandatory cases into spec/mandatory (`make spec`).

A list is written only if the cases, or the version of scaraspec, differ from the newest list. The
ids of corrected cases are arguments: ``python spec/mandatory.py 4.15/2.missing``.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from typing import Final

from scaraspec.certificate.mandatory import Change, MandatoryList, list_folder, mandatory_lists
from scaraspec.report.model import Role, Tool
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import Options

OPTIONAL_HOOKS: Final = (
    "angle_fault",
    "clear_faults",
    "motor_fault",
    "position_fault",
    "set_analog",
)
"""A fault cannot be produced safely on every arm, and not every robot has an analog source."""

UNLESS_CLAIMED: Final = {"3/24": ("readings.pipelining=one",)}
"""A controller that serves one request at a time has no order of replies."""


def renewed(role: Role, today: date, repaired: Sequence[str] = ()) -> MandatoryList | None:
    """Return a new list of a role; None if the newest one is right.

    Args:
        role: The role.
        today: The date of the new list. A list of the same day is replaced.
        repaired: The ids of corrected cases.
    """
    earlier = mandatory_lists(role)
    made = MandatoryList(
        id=f"{role.value}-{today}",
        role=role,
        version=Tool.own().version,
        cases=_requirements(role, undefined=False),
        optional_cases=_requirements(role, undefined=True),
        optional_hooks=OPTIONAL_HOOKS if role is Role.CONTROLLER else (),
        unless_claimed=UNLESS_CLAIMED if role is Role.CONTROLLER else {},
    )
    own = [case for case in repaired if case in made.cases]
    if earlier and not own:
        newest = earlier[-1]
        if replace(made, id=newest.id, history=newest.history) == newest:
            return None
    before = [each for each in earlier if each.id != made.id]
    if not before:
        return made
    last = before[-1]
    change = Change(
        f"{today}",
        new=tuple(case for case in made.cases if case not in last.cases),
        repaired=tuple(own),
        withdrawn=tuple(case for case in last.cases if case not in made.cases),
    )
    return replace(made, history=(*last.history, change))


def _requirements(role: Role, *, undefined: bool) -> Mapping[str, tuple[str, ...]]:
    cases = sorted(collect(Options(), role), key=lambda case: case.id)
    return {case.id: case.requirements for case in cases if case.undefined is undefined}


if __name__ == "__main__":
    for each in (Role.CONTROLLER, Role.CLIENT):
        if new := renewed(each, date.today(), sys.argv[1:]):  # noqa: DTZ011 - the author's calendar
            path = list_folder() / f"{new.id}.json"
            path.write_text(new.to_json(), encoding="utf-8")
