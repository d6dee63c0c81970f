"""Outcome: the result of a case, which follows from the exceptions that it raises."""

from dataclasses import dataclass, replace

from scaraspec.judge.verdicts import Cause, Reason, Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.report.evidence import evidence_of, step_of
from scaraspec.report.failed_step import AttemptResult, FailedStep, topic
from scaraspec.report.operator_request import OperatorRequest
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
)
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.user_message import UserMessage, sentence_of


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a case.

    Attributes:
        case: The case.
        verdict: The verdict; ``none`` if the case did not run.
        requirement: The requirement that was violated; empty if none was.
        cause: Who is responsible if the case did not pass.
        message: One sentence.
        expected: What the document requires.
        observed: What was observed instead.
        begin_ns: When the case began, in nanoseconds since the Unix epoch, on the clock of its wire
            events; 0 if it did not run.
        duration_s: The duration in seconds, on the clock of the subject, without the time that an
            operator took.
        examples: The number of values that were tried; 0 if the case draws no values.
        frames: The last frames of the case.
        readings: The readings that were tolerated, as key and option.
        attempts: The results of all attempts, if there were several.
        reason: Why the verdict is none or inconclusive.
        missing_hooks: The hooks that the case needs and that the ICS does not define.
        step: The step that failed.
        operator: What an operator was asked to do.
    """

    case: Case
    verdict: Verdict
    requirement: str = ""
    cause: Cause | None = None
    message: str = ""
    expected: str = ""
    observed: str = ""
    begin_ns: int = 0
    duration_s: float = 0.0
    examples: int = 0
    frames: tuple[FrameSeen | InvalidBytes, ...] = ()
    readings: tuple[tuple[str, str], ...] = ()
    attempts: tuple[AttemptResult, ...] = ()
    reason: Reason | None = None
    missing_hooks: tuple[str, ...] = ()
    step: FailedStep | None = None
    operator: tuple[OperatorRequest, ...] = ()


def failed_outcome(case: Case, error: CaseFailed, requirement: str, message: str = "") -> Outcome:
    """Return the outcome of a failure, with the frames and the step at which it occurred.

    Args:
        case: The case.
        error: The failure.
        requirement: The requirement that was violated.
        message: Replaces the message of the failure.
    """
    moment = error.moment
    step = step_of([evidence_of(seen) for seen in moment.frames[-1:]], error.observed)
    if error.due:
        command, stage = error.due
        step = replace(step, command=command, stage=stage, field="", missing=True)
    return Outcome(
        case,
        Verdict.FAIL,
        requirement,
        Cause.SUBJECT,
        message or message_of(error),
        error.expected,
        error.observed,
        frames=moment.frames,
        step=replace(
            step,
            time_ns=moment.time_ns,
            attempt=1,
            dependency=requirement if error.preparation else "",
        ),
    )


def is_about(case: Case, requirement: str, command: str) -> bool:
    """Return whether a case is about a requirement or a command, and not only prepared with it.

    Cases about connections are about every message, and those about frames and about two-stage
    commands about every message but the login.
    """
    general = case.requirements[0].partition("/")[0]
    if general == "2" or (general in {"3", "4"} and command not in {"", "login"}):
        return True
    own = {topic(each.partition("/")[0]) for each in case.requirements}
    clauses = {requirement.partition("/")[0], BY_NAME[command].clause if command else ""}
    return not own.isdisjoint(map(topic, clauses))


def prevented(outcome: Outcome, first: str) -> Outcome:
    """Return the outcome of a case whose preparation failed as in the case `first`."""
    return replace(
        outcome,
        verdict=Verdict.INCONCLUSIVE,
        requirement="",
        cause=Cause.DEPENDENCY,
        reason=Reason.DEPENDENCY,
        message=UserMessage(
            "{requirement} failed already in case {case}: {message}",
            requirement=outcome.requirement,
            case=first,
            message=outcome.message,
        ),
    )


def unless_disturbed(outcome: Outcome, reason: str) -> Outcome:
    """The outcome; a failure becomes inconclusive if a reason is given why it does not count."""
    if outcome.verdict is not Verdict.FAIL or not reason:
        return outcome
    return replace(
        outcome,
        verdict=Verdict.INCONCLUSIVE,
        requirement="",
        cause=Cause.SET_UP,
        reason=Reason.OTHER_CLIENT,
        message=UserMessage(
            "{reason}. The case had found: {message}", reason=reason, message=outcome.message
        ),
    )


def unless_dependent(outcome: Outcome, raised: BaseException | None) -> Outcome:
    """The outcome of a case; inconclusive if an earlier case has shown the failure that it raised.

    See `CaseFailed.depends_on`.
    """
    if not isinstance(raised, CaseFailed) or not raised.depends_on:
        return outcome
    return prevented(outcome, raised.depends_on)


def message_of(error: BaseException) -> str:
    """The message of an exception, with its template if it has one."""
    message = error.args[0] if error.args else ""
    return message if isinstance(message, str) else sentence_of(error)


def root_cause(raised: BaseException | None) -> BaseException | None:
    """The exception of a case, without the wrapper for one that hypothesis cannot repeat."""
    if isinstance(raised, BaseExceptionGroup):
        inner = [root_cause(each) for each in raised.exceptions]
        return next(
            (each for each in inner if isinstance(each, CaseFailed | CaseInconclusive)), inner[0]
        )
    from hypothesis.errors import Flaky  # noqa: PLC0415 - audit starts sooner without it

    if isinstance(raised, Flaky) and raised.__cause__:
        return root_cause(raised.__cause__)
    return raised
