"""Root causes: groups of failures that probably have one cause, and which to look at first.

This is a pure function of the cases. Two failures have one cause if they

1. violate the same requirement, or
2. are about the same command, file transfer or connection, or
3. rest on the same bytes: a finding of the judge, and a case during which they passed.

A failure is about the command of its requirement, and about the command whose message was missing
or was found wrong by the judge. The first failure of a group is the earliest of a case that was
made for the requirement that it found violated; other cases fail when they depend on it. Groups
are independent for both sides of a capture.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

from scaraspec.judge.verdicts import Reason, Verdict
from scaraspec.protocol.commands import BY_NAME, COMMANDS
from scaraspec.protocol.direction import Direction
from scaraspec.report.failed_step import RootCause, Stage, topic
from scaraspec.report.model import SEEN, Case, Results, Role
from scaraspec.report.ordering import group_equal_cases, most_important_first
from scaraspec.user_message import UserMessage

_CONNECTION: Final = "connection"
_TOPICS: Final = frozenset({_CONNECTION, *(topic(command.clause) for command in COMMANDS)})
_NEVER_NS: Final = 1 << 63
_STOP: Final = "4.17/"


def root_causes(cases: Sequence[Case], role: Role) -> tuple[RootCause, ...]:
    """Return the groups of failures, the first cause first.

    Args:
        cases: All cases of the results.
        role: The role of the subject.
    """
    groups: list[list[Case]] = []
    for case in cases:
        if case.verdict is Verdict.FAIL:
            related = [group for group in groups if any(_same_cause(case, c, role) for c in group)]
            merged = [case for group in related for case in group]
            groups = [group for group in groups if group not in related] + [[*merged, case]]
    ordered = sorted((sorted(group, key=_order) for group in groups), key=lambda g: _order(g[0]))
    prevented: dict[str, list[str]] = {}
    for case in cases:
        if cause := _prevented_by(case, ordered):
            prevented.setdefault(cause, []).append(case.id)
    return tuple(
        RootCause(
            group[0].id,
            _requirements(group),
            tuple(case.id for case in group),
            tuple(prevented.get(group[0].id, ())),
        )
        for group in ordered
    )


class SummaryLine(NamedTuple):
    """One line of a summary: a cause, or cases that did not fail and have the same message.

    Attributes:
        case: The case to look at first.
        name: What it is about: the violated requirements and the case.
        others: The number of other cases of the group.
        prevented: The number of cases that could not be judged because of it.
        replay: The reproduction command of a failure in a run.
    """

    case: Case
    name: str
    others: int
    prevented: int = 0
    replay: str = ""


def summary(results: Results) -> list[SummaryLine]:
    """Return the lines of a summary: the causes, then the other cases, without passes."""
    cases = {case.id: case for case in results.cases}
    causes = root_causes(results.cases, results.role)
    replays = results.role is not Role.CAPTURE
    lines = [
        SummaryLine(
            cases[cause.case],
            _name(cause),
            len(cause.cases) - 1,
            len(cause.prevented),
            cases[cause.case].replay if replays else "",
        )
        for cause in causes
    ]
    known = {case_id for cause in causes for case_id in (*cause.cases, *cause.prevented)}
    rest = (
        case
        for case in most_important_first(results)
        if case.verdict is not Verdict.PASS and case.id not in known
    )
    return lines + [SummaryLine(case, case.id, n) for case, n in group_equal_cases(rest)]


def _name(cause: RootCause) -> str:
    violated = ", ".join(cause.requirements)
    named = not violated or f"{cause.case}.".startswith(f"{violated}.")
    if named:
        return cause.case
    return UserMessage("{violated} in {case}", violated=violated, case=cause.case)


def _order(case: Case) -> tuple[bool, int]:
    own = bool(case.requirements) and f"{case.id}.".startswith(f"{case.requirements[0]}.")
    return (not own or SEEN in case.id, _time_ns(case))


def _time_ns(case: Case) -> int:
    return case.step.time_ns if case.step else _NEVER_NS


def _is_finding(case: Case) -> bool:
    """Return whether the judge found it; otherwise a case did."""
    return case.step is not None and case.step.attempt == 0


def _same_cause(a: Case, b: Case, role: Role) -> bool:
    if role is Role.CAPTURE and _side(a) is not _side(b):
        return False
    if not set(a.requirements).isdisjoint(b.requirements) or _about(a) & _about(b):
        return True
    return (_is_finding(a) or _is_finding(b)) and not _bytes(a).isdisjoint(_bytes(b))


def _side(case: Case) -> Direction | None:
    """Return the side that sent the last bytes of the evidence."""
    return case.wire[-1].direction if case.wire else None


def _about(case: Case) -> set[str]:
    """Return the commands, as topics, that certainly are wrong; also the connection."""
    clauses = {topic(each.partition("/")[0]) for each in case.requirements}
    step = case.step
    certain = step is not None and (step.missing or _is_finding(case))
    if step and certain and step.command in BY_NAME:
        clauses.add(topic(BY_NAME[step.command].clause))
    if step and step.missing and step.stage is Stage.CONNECTION:
        clauses.add(_CONNECTION)
    return clauses & _TOPICS


def _bytes(case: Case) -> set[tuple[str, Direction, int]]:
    return {(each.connection, each.direction, each.offset_bytes) for each in case.wire}


def _requirements(group: Sequence[Case]) -> tuple[str, ...]:
    """Return the requirements that the first failure violates, and equal ones on the same bytes."""
    first = group[0]
    equal = (
        case
        for case in group
        if case.message == first.message and _time_ns(case) == _time_ns(first)
    )
    return tuple(dict.fromkeys(each for case in equal for each in case.requirements))


def _prevented_by(case: Case, groups: Sequence[Sequence[Case]]) -> str:
    """Return the first failure of the group that prevented a case; empty if none did."""
    if case.verdict is not Verdict.INCONCLUSIVE:
        return ""
    if dependency := case.step.dependency if case.step else "":
        return _first(groups, lambda failed: dependency in failed.requirements)
    if case.reason is Reason.UNREACHABLE and groups:
        last = max((failed for group in groups for failed in group), key=_time_ns)
        return _first(groups, lambda failed: failed is last)
    if case.reason is Reason.WITHHELD:
        return _first(groups, lambda failed: any(r.startswith(_STOP) for r in failed.requirements))
    return ""


def _first(groups: Iterable[Sequence[Case]], is_cause: Callable[[Case], bool]) -> str:
    return next((group[0].id for group in groups if any(map(is_cause, group))), "")
