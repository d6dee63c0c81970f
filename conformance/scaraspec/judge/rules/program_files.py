"""Clause 6: lint of each completely uploaded program file, requirement by requirement.

Any file may be uploaded. A file with neither the first nor the last bytes of a program file is not
checked.
"""

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS, Method, Strength
from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, rule, tolerated
from scaraspec.protocol.fields import show
from scaraspec.protocol.program_files import LintFinding, ProgramDefect, Severity, lint
from scaraspec.protocol.program_files.layout import FOOTER, MAGIC
from scaraspec.protocol.program_files.lint import MAX_FINDINGS
from scaraspec.protocol.transfer import TransferState
from scaraspec.traffic.events import Transfer
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_UNREADABLE: Final = {defect.code for defect in ProgramDefect} - {
    ProgramDefect.SURPLUS.code,
    ProgramDefect.SECOND.code,
}
"""Defects that prevent judging the rest of the file."""


@lru_cache(maxsize=1)
def _worst(transfer: Transfer) -> tuple[Mapping[str, LintFinding], bool]:
    """Return the worst finding by requirement, and whether requirements without one are met."""
    findings = lint(bytes(transfer.content))
    worst: dict[str, LintFinding] = {}
    for severity in reversed(Severity):
        for finding in findings:
            if finding.severity is severity:
                worst.update(dict.fromkeys(finding.requirements, finding))
    readable = not any(finding.code in _UNREADABLE for finding in findings)
    return worst, readable and len(findings) <= MAX_FINDINGS


def _check(transfer: Transfer, _: RobotState, *, requirement: str) -> RuleResult | None:
    """The linter's result for one requirement: an error fails it, a warning is tolerated.

    A finding of severity INFO is tolerated if the requirement leaves a choice, and else passes.
    """
    uploaded = transfer.upload and transfer.state is TransferState.DONE and transfer.whole_content
    claims = transfer.content.startswith(MAGIC) or transfer.content.endswith(FOOTER)
    if not uploaded or not claims:
        return None
    worst, others_met = _worst(transfer)
    finding = worst.get(requirement)
    if finding is None:
        return PASSED if others_met else None
    message = UserMessage("{file_name}: {finding}", file_name=show(transfer.name), finding=finding)
    if finding.severity is Severity.ERROR:
        return failed(
            message, expected=REQUIREMENTS[requirement].sentence, observed=finding.message
        )
    firm = REQUIREMENTS[requirement].strength is Strength.FIRM
    if finding.severity is Severity.INFO and firm:
        return PASSED
    return tolerated(REQUIREMENTS[requirement].register[0], finding.code, message)


for _requirement in REQUIREMENTS.values():
    if Method.STATIC in _requirement.testable and Method.PASSIVE in _requirement.testable:
        rule(_requirement.id, on=Transfer)(partial(_check, requirement=_requirement.id))
