"""Failures with one cause are one group, and its first line names the violated requirement."""

from dataclasses import replace

from scaraspec.judge.verdicts import Cause, Reason, Verdict
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.report.failed_step import FailedStep, Stage
from scaraspec.report.model import Case, Evidence, Results, Role
from scaraspec.report.root_causes import root_causes, summary

_REPLY = Evidence("1", C2A, 8, 6, 40)


def failure(
    case_id: str, requirement: str, at: int, stage: Stage = Stage.REPLY, /, **step: object
) -> Case:
    """Return a failed case whose failing step has this time."""
    values = {"attempt": 0 if ".seen-" in case_id else 1, **step}
    return Case(
        case_id,
        (requirement,),
        Verdict.FAIL,
        Cause.SUBJECT,
        message=case_id,
        step=FailedStep(at, stage, **values),  # type: ignore[arg-type] # names of its members
    )


def groups(*cases: Case, role: Role = Role.CONTROLLER) -> list[tuple[str, ...]]:
    """Return the ids of each group."""
    return [cause.cases for cause in root_causes(cases, role)]


def test_one_requirement_is_one_cause() -> None:
    """Findings of the judge and of cases are merged, the earliest case of the requirement first."""
    late, early = failure("3/18.late", "3/18", 9), failure("3/18.early", "3/18", 5)
    seen, other = failure("3/18.seen-1", "3/18", 2), failure("8/4", "3/18", 1)
    assert groups(late, seen, other, early) == [("3/18.early", "3/18.late", "8/4", "3/18.seen-1")]


def test_different_faults_are_different_causes() -> None:
    """The earlier one is first. Requirements of one general clause are not related."""
    assert groups(failure("3/18", "3/18", 9), failure("3/19", "3/19", 5)) == [("3/19",), ("3/18",)]


def test_one_command_is_one_cause() -> None:
    """Also all clauses about file transfers; another command is another cause."""
    assert groups(failure("4.6/2", "4.6/2", 1), failure("4.6/4", "4.6/4", 2)) == [
        ("4.6/2", "4.6/4")
    ]
    assert groups(failure("5.1/2", "5.1/2", 1), failure("5.3/4", "5.3/4", 2)) == [
        ("5.1/2", "5.3/4")
    ]
    assert len(groups(failure("4.6/2", "4.6/2", 1), failure("4.7/4", "4.7/4", 2))) == 2


def test_a_missing_message_belongs_to_its_command() -> None:
    """A message that was received only shows the latest request, which need not be wrong."""
    wrong = failure("4.6/2", "4.6/2", 1)
    missing = failure("3/31", "3/31", 2, command="get_time", missing=True)
    came = failure("3/31", "3/31", 2, command="get_time")
    assert groups(wrong, missing) == [("4.6/2", "3/31")]
    assert groups(wrong, came) == [("4.6/2",), ("3/31",)]


def test_refused_connections_are_one_cause() -> None:
    """Whatever the cases needed the connections for."""
    refused = [
        failure(case, case, at, Stage.CONNECTION, missing=True)
        for at, case in enumerate(("2/13", "3/19", "T/5"))
    ]
    assert groups(*refused) == [("2/13", "3/19", "T/5")]


def test_the_same_bytes_are_one_cause() -> None:
    """A case fails on the frame that the judge found wrong; without that finding, equal bytes are
    no evidence."""
    case = replace(failure("4/8", "4/8", 41), wire=(_REPLY, replace(_REPLY, offset_bytes=14)))
    seen = replace(failure("T/4.seen-1", "T/4", 40), wire=(_REPLY,))
    assert groups(case, seen) == [("4/8", "T/4.seen-1")]
    assert (
        len(groups(case, replace(seen, id="T/4", step=FailedStep(40, Stage.REPLY, attempt=1)))) == 2
    )


def test_the_first_line_names_each_requirement_that_the_same_bytes_violate() -> None:
    """One rule can judge several requirements."""
    seen = [
        replace(failure(f"{r}.seen-1", r, 40), message="the length is wrong", wire=(_REPLY,))
        for r in ("3/6", "3/7")
    ]
    (cause,) = root_causes(seen, Role.CONTROLLER)
    assert cause.requirements == ("3/6", "3/7")


def test_the_sides_of_a_capture_have_different_causes() -> None:
    """The request of a client and the reply of a controller may both violate a clause."""
    reply = replace(failure("4.6/2", "4.6/2", 2), wire=(_REPLY,))
    request = replace(failure("4.6/1", "4.6/1", 1), wire=(replace(_REPLY, direction=A2C),))
    assert groups(request, reply, role=Role.CAPTURE) == [("4.6/1",), ("4.6/2",)]
    assert groups(request, reply) == [("4.6/1", "4.6/2")]


def test_prevented_cases_are_counted_once(full: Results) -> None:
    """Prevented cases are not listed; other inconclusive cases are."""
    stop, upload = failure("4.17/6", "4.17/6", 5), failure("5.2/2", "5.2/2", 6)
    undone = Case("4.28/2", ("4.28/2",), Verdict.INCONCLUSIVE)
    step = FailedStep(7, Stage.REPLY, attempt=1, dependency="5.2/2")
    prevented = replace(undone, id="4.11/3", reason=Reason.DEPENDENCY, step=step)
    withheld = replace(undone, id="4.24/8", reason=Reason.WITHHELD)
    dead = replace(undone, id="4.9/2", reason=Reason.UNREACHABLE)
    cases = (stop, upload, undone, prevented, withheld, dead)
    assert [cause.prevented for cause in root_causes(cases, Role.CONTROLLER)] == [
        ("4.24/8",),
        ("4.11/3", "4.9/2"),
    ]
    lines = summary(replace(full, cases=cases))
    assert [(line.name, line.prevented) for line in lines] == [
        ("4.17/6", 1),
        ("5.2/2", 2),
        ("4.28/2", 0),
    ]


def test_a_line_names_the_violated_requirement(full: Results) -> None:
    """The id of the case may begin with another one. A finding in a capture is not repeated."""
    case = replace(failure("4/3.fault", "4/5", 1), replay="scaraspec certify --only 4/3.fault")
    results = replace(full, cases=(case,))
    (line,) = summary(results)
    assert (line.name, line.replay) == ("4/5 in 4/3.fault", case.replay)
    (line,) = summary(replace(results, role=Role.CAPTURE))
    assert line.replay == ""
