"""Coverage: what a run did not judge, as sentences for the user."""

from collections.abc import Sequence

from scaraspec.report.model import RequirementResult
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
