"""Results of a small run, for the tests of gates and comparisons."""

from scaraspec.judge.verdicts import Cause, Conclusion, Verdict
from scaraspec.report.fingerprint import fingerprint
from scaraspec.report.model import Case, RequirementResult, Results, Role, RunInfo, Subject, Tool
from scaraspec.user_message import UserMessage


def failed(case_id: str, template: str, **values: object) -> Case:
    """Return a failed case with its fingerprint."""
    message = UserMessage(template, **values)
    requirement = case_id.partition(".seen-")[0]
    return Case(
        case_id,
        (requirement,),
        Verdict.FAIL,
        Cause.SUBJECT,
        message=message,
        replay=f"scaraspec certify controller tcp://robot --only {case_id}",
        fingerprint=fingerprint(case_id, requirement, message),
    )


def results_of(*cases: Case, seed: int = 0) -> Results:
    """Return the results of a run with these cases."""
    verdicts = {case.verdict for case in cases}
    verdict = Conclusion.CONFORMANT
    if Verdict.INCONCLUSIVE in verdicts:
        verdict = Conclusion.INCONCLUSIVE
    if Verdict.FAIL in verdicts:
        verdict = Conclusion.NONCONFORMANT
    return Results(
        tool=Tool("scaraspec", "0.2.0"),
        subject=Subject(Role.CONTROLLER, "Cell 7", "1.4", "tcp://robot"),
        role=Role.CONTROLLER,
        verdict=verdict if cases else Conclusion.NOTHING_TESTED,
        counts={v: sum(case.verdict is v for case in cases) for v in Verdict},
        readings={},
        requirements=tuple(
            RequirementResult(each, case.verdict, (case.id,))
            for case in cases
            for each in case.requirements
        ),
        cases=cases,
        run=RunInfo(1_700_000_000_000_000_000, 1_700_000_060_000_000_000, seed, {"allow": "state"}),
    )


PASSED = Case("4.8/1", ("4.8/1",), Verdict.PASS, title="The status has two digits.")
FAILED = failed("4.15/3", "the code is {code} after {time_s:.1f} s", code="07", time_s=1.25)
SEEN = failed("3/18.seen-1", "{command} ended a second time", command="run_program")
