"""Checks of the results of a certification: cases, options, verdicts, and the capture.

Pure functions. Each yields one sentence for each contradiction; none if everything is right.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from scaraspec.certificate.mandatory import MandatoryList
from scaraspec.certificate.package import Manifest
from scaraspec.judge.verdicts import Reason, Verdict, conclude, worst
from scaraspec.protocol.commands import BY_NAME
from scaraspec.report.model import SEEN, Case, Results, Role, Tool
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.user_message import UserMessage

SEEDS: Final = range(10)
"""The seeds of a certification; each draws other values."""

PATIENCE_S: Final = "10"
"""The longest wait of one case against a controller, in seconds, as the settings state it."""

_FREE: Final = ("undefined_opcodes", "reply_timeout_s", "transfer_timeout_s", "time_scale")
"""The options that the ICS or the laboratory choose; a client also has ``answer_timeout_s``."""

_UNLISTED: Final = ("claim.", "run.")
"""The beginnings of the ids of cases that are no cases of the suite."""
_ALTERS_REQUIREMENTS: Final = (Verdict.FAIL, Verdict.INCONCLUSIVE)
"""Verdicts of which a case may name the one requirement that it is about."""


def certification_options(
    role: Role, mandatory: MandatoryList, *, seed: int = 0, undefined: bool = False
) -> Options:
    """Return the options of a certification; only the arguments are free.

    Args:
        role: The role of the SUT.
        mandatory: The list of mandatory cases.
        seed: One of `SEEDS`.
        undefined: Send undefined opcodes, too; never to a robot that can move.
    """
    return Options(
        allowed=ALL if role is Role.CONTROLLER else Options().allowed,
        undefined=undefined,
        seed=seed,
        exhaustive=True,
        certification=mandatory.title,
    )


def version_problems(
    manifest: Manifest, results: Results, mandatory: MandatoryList
) -> Iterator[str]:
    """Yield each contradiction between the manifest, the results and the list."""
    if manifest.mandatory_sha256 != mandatory.sha256:
        yield UserMessage("the list {id} has another checksum", id=mandatory.id)
    if (manifest.tool, manifest.role) != (results.tool, results.role):
        yield "the manifest names another tool or role than the results"
    listed = (replace(Tool.own(), version=mandatory.version), mandatory.role)
    if (results.tool, results.role) != listed:
        yield UserMessage(
            "{id} is no list of {tool} {version} for a {role}",
            id=mandatory.id,
            tool=results.tool.name,
            version=results.tool.version,
            role=UserMessage(results.role.value),
        )


def option_problems(results: Results, mandatory: MandatoryList) -> Iterator[str]:
    """Yield each option of the run that is not that of a certification."""
    if results.run is None or results.run.seed not in SEEDS:
        yield UserMessage(
            "the seed is not one of {first} to {last}", first=SEEDS[0], last=SEEDS[-1]
        )
    settings = results.run.settings if results.run else {}
    fixed = certification_options(results.role, mandatory).summary
    free = {*_FREE}
    if results.role is Role.CONTROLLER:
        fixed["patience_s"] = PATIENCE_S
    else:
        free.add("answer_timeout_s")
    for name, value in fixed.items():
        if name not in free and (own := settings.get(name, "")) != value:
            yield UserMessage(
                'option {name} is "{own}", not "{value}"', name=name, own=own, value=value
            )
    for name in sorted(free - settings.keys()):
        yield UserMessage("option {name} is missing", name=name)
    for name in sorted(settings.keys() - fixed.keys() - free):
        yield UserMessage("option {name!r} is not known", name=name)


def case_problems(
    results: Results, mandatory: MandatoryList, needs: Mapping[str, Sequence[str]] | None = None
) -> Iterator[str]:
    """Yield each case that is missing, doubled, unknown, altered or skipped without a reason.

    Args:
        results: The results of the run.
        mandatory: The list of mandatory cases.
        needs: The hooks that each case needs, by its id; None if this version does not know the
            cases. The messages of the results name them then.
    """
    found: defaultdict[str, list[Case]] = defaultdict(list)
    for case in results.cases:
        if SEEN not in case.id and not case.id.startswith(_UNLISTED):
            found[case.id].append(case)
    listed = {**mandatory.cases, **mandatory.optional_cases}
    for case_id in sorted(mandatory.cases.keys() - found.keys()):
        yield UserMessage("case {case} is missing", case=case_id)
    for case_id, (case, *others) in found.items():
        if others:
            yield UserMessage(
                "case {case} occurs {count} times", case=case_id, count=1 + len(others)
            )
        if case_id not in listed:
            yield UserMessage("case {case} is not in the list", case=case_id)
        elif case.requirements != listed[case_id] and case.verdict not in _ALTERS_REQUIREMENTS:
            yield UserMessage("case {case} judges other requirements", case=case_id)
        elif case_id in mandatory.cases and _is_skipped(case, results, mandatory, needs):
            yield UserMessage(
                "case {case} was skipped without a reason that the list allows: {message}",
                case=case_id,
                message=case.message,
            )


def _is_skipped(
    case: Case,
    results: Results,
    mandatory: MandatoryList,
    needs: Mapping[str, Sequence[str]] | None,
) -> bool:
    """Whether a case was skipped without a reason that the list allows.

    A case that does not apply is allowed if it needs a command that is verified to be unsupported,
    or if each of its requirements was judged by other cases, is about such a command, or does not
    apply under a claim of the ICS.
    """
    if case.verdict is not Verdict.NONE:
        return False
    named = getattr(case.message, "values", {})
    if case.reason is Reason.HOOK:
        hooks = named.get("hooks", "").split(", ") if needs is None else needs.get(case.id, ())
        missing = {hook for hook in hooks if f"hooks.{hook}" not in results.subject.claims}
        return not missing or not missing <= {*mandatory.optional_hooks}
    claims = {f"{key}={value}" for key, value in results.subject.claims.items()}
    settled = {each.id for each in results.requirements if each.decided}
    return case.reason is not Reason.NOT_APPLICABLE or not (
        named.get("name") in _verified_lacks(results)
        or all(
            each in settled
            or _is_excluded(each, results)
            or not claims.isdisjoint(mandatory.unless_claimed.get(each, ()))
            for each in case.requirements
        )
    )


def _is_excluded(requirement: str, results: Results) -> bool:
    """Whether a requirement is about a command that is verified to be unsupported."""
    clause = requirement.partition("/")[0]
    return any(BY_NAME[name].clause == clause for name in _verified_lacks(results))


def _verified_lacks(results: Results) -> set[str]:
    """Return the commands that the ICS calls unsupported, and that the run has tried.

    An answer to one of them is a failure of the run.
    """
    tried = {each.name for each in results.session.exchanges} if results.session else set()
    return BY_NAME.keys() & tried & {*results.subject.claims.get("lacks", "").split(", ")}


def verdict_problems(results: Results, mandatory: MandatoryList) -> Iterator[str]:
    """Yield each verdict that does not follow from the cases."""
    yield from _requirement_problems(results)
    stated = {each.id for each in results.requirements}
    for requirement in sorted({each for ids in mandatory.cases.values() for each in ids}):
        if requirement not in stated and not _is_excluded(requirement, results):
            yield UserMessage("requirement {id} is missing", id=requirement)
    counts = dict.fromkeys(Verdict, 0) | Counter(case.verdict for case in results.cases)
    if counts != results.counts:
        yield "the numbers of verdicts are not those of the cases"
    concluded = conclude(counts, complete=all(each.decided for each in results.requirements))
    if results.verdict is not concluded:
        yield UserMessage(
            "the verdict is {verdict}, but the cases are {right}",
            verdict=UserMessage.word(results.verdict.value),
            right=UserMessage.word(concluded.value),
        )


def _requirement_problems(results: Results) -> Iterator[str]:
    judging: defaultdict[str, list[Case]] = defaultdict(list)
    for case in results.cases:
        for requirement in case.requirements:
            judging[requirement].append(case)
    for each in results.requirements:
        cases = judging[each.id]
        if each.verdict is not (right := worst(case.verdict for case in cases)):
            yield UserMessage(
                "requirement {id} is {verdict}, but its cases are {right}",
                id=each.id,
                verdict=UserMessage(each.verdict.value),
                right=UserMessage(right.value),
            )
        if {*each.cases} != {case.id for case in cases}:
            yield UserMessage("requirement {id} names other cases", id=each.id)


def capture_problems(results: Results, derived: Results) -> Iterator[str]:
    """Yield each contradiction between the results and the audit of the capture.

    The traffic must be the same, and the same requirements must be violated or tolerated. A run
    may have more evidence: a finding is inconclusive if another client may have caused it, and the
    suite ignores some tolerated findings about files that it has damaged.

    Args:
        results: The results of the run.
        derived: The results of the audit.
    """
    if _traffic(results) != _traffic(derived):
        yield "the traffic in the results is not that of the capture"
    run, session = results.run, derived.session
    if run and session and not run.begun_ns <= session.begun_ns <= session.ended_ns <= run.ended_ns:
        yield "the capture is of another time than the run"
    undecidable = {
        case.requirements[0] for case in derived.cases if case.reason is Reason.UNDECIDED
    }
    seen, found = _findings(results, SEEN), _findings(derived)
    unsure = seen[Verdict.INCONCLUSIVE]
    for requirement in sorted(found[Verdict.FAIL] - seen[Verdict.FAIL] - unsure):
        yield UserMessage(
            "the capture violates {id}, but the results do not say so", id=requirement
        )
    known = {case.id for case in results.cases}
    for case in derived.cases:
        if not case.requirements and case.id not in known:  # a claim that is refuted
            text = "the capture has a failure {case}, but the results have not"
            yield UserMessage(text, case=case.id)
    for verdict in (Verdict.FAIL, Verdict.TOLERATED):
        for requirement in sorted(seen[verdict] - found[verdict] - undecidable):
            yield UserMessage(
                "the results have a finding on the wire about {id}, but the capture has none",
                id=requirement,
            )


def _traffic(results: Results) -> tuple[object, ...]:
    """Return what identifies the traffic.

    Names of files may be masked in the capture. How an exchange ended may depend on the time at
    which the run gave it up.
    """
    if (session := results.session) is None:
        return ()
    return (
        (session.begun_ns, session.ended_ns, session.frames, session.undecodable_bytes),
        (session.bytes, session.connections),
        [(each.name, each.count, each.refused) for each in session.exchanges],
    )


def _findings(results: Results, part: str = "") -> defaultdict[Verdict, set[str]]:
    """Return the requirements of the cases by verdict, of cases whose id contains a text."""
    found: defaultdict[Verdict, set[str]] = defaultdict(set)
    for case in results.cases:
        if part in case.id and case.requirements:
            found[case.verdict].add(case.requirements[0])
    return found
