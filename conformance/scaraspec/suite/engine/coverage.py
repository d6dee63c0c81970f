"""Coverage: what a run did not judge, as sentences for the user."""

from collections.abc import Iterator, Mapping, Sequence

from scaraspec.report.model import RequirementResult
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.plan import Options
from scaraspec.user_message import UserMessage


def shortfall(requirements: Sequence[RequirementResult], options: Options) -> str:
    """Return how the coverage falls short of what the user requires; empty if it does not."""
    judged = {each.id for each in requirements if each.decided}
    percent = 100 * len(judged) / max(len(requirements), 1)
    if missing := sorted(options.required - judged):
        return UserMessage("required, but not judged: {missing}", missing=", ".join(missing))
    if percent < options.required_percent:
        return UserMessage(
            "{judged} of {total} requirements were judged, which is less than {required:g} %",
            judged=len(judged),
            total=len(requirements),
            required=options.required_percent,
        )
    return ""


def hook_notices(
    outcomes: Sequence[Outcome], requirements: Sequence[RequirementResult]
) -> Iterator[str]:
    """Yield which hooks the ICS must define so that skipped cases run, and what they judge."""
    skipped = [outcome for outcome in outcomes if outcome.missing_hooks]
    if not skipped:
        return
    hooks = sorted({hook for outcome in skipped for hook in outcome.missing_hooks})
    theirs = {requirement for outcome in skipped for requirement in outcome.case.requirements}
    undecided = [each.id for each in requirements if each.id in theirs and not each.decided]
    message: str = UserMessage(
        "Not run: cases that need a hook which the ICS does not define ({count}: {hooks})",
        count=len(skipped),
        hooks=", ".join(hooks),
    )
    if undecided:
        yield UserMessage.joined(
            message,
            ". Define it in [hooks] of the ICS to judge {requirements}",
            requirements=", ".join(undecided),
        )
    else:
        yield UserMessage.joined(message, ". Other cases have judged their requirements")


def undecided_notices(undecided: Mapping[str, int]) -> Iterator[str]:
    """Yield how many findings of the judge do not count because the traffic does not decide them.

    Args:
        undecided: The number of these findings by requirement.
    """
    if undecided:
        yield UserMessage(
            "Not counted: findings of the judge that the traffic does not decide ({findings})",
            findings=", ".join(f"{key}: {count}" for key, count in undecided.items()),
        )
