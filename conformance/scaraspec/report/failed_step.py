"""Failed step: the message that a failure is about; attempts and sittings of a case; root causes.

These values belong to the results. `evidence.step_of` determines the step, `root_causes` the
causes.
"""

from dataclasses import dataclass
from enum import Enum

from scaraspec.judge.verdicts import Verdict


class Stage(Enum):
    """What was due when a step failed, from the first to the last stage of an exchange."""

    CONNECTION = "connection"
    """A connection, or its login."""
    FRAME = "frame"
    """A frame: the bytes belong to none."""
    REQUEST = "request"
    REPLY = "reply"
    RESULT = "result"


@dataclass(frozen=True, slots=True)
class FailedStep:
    """The step that failed.

    Attributes:
        time_ns: The time of the last byte before the failure, in nanoseconds since the Unix epoch;
            for a finding of the judge, of its first evidence.
        stage: What was due.
        command: The command whose message was wrong or missing; empty if it is not known.
        field: The field of the message; empty if it is not known.
        missing: Whether a message of the command was due and did not come.
        attempt: The attempt of the case, from 1 on; 0 for a finding of the judge.
        dependency: For a step that only prepared the case, the requirement that failed; empty for
            a step of the case itself.
    """

    time_ns: int
    stage: Stage
    command: str = ""
    field: str = ""
    missing: bool = False
    attempt: int = 0
    dependency: str = ""


def topic(clause: str) -> str:
    """Return what a clause is about; the clauses about file transfers are one topic."""
    return "5" if clause.startswith("5.") else clause


@dataclass(frozen=True, slots=True)
class AttemptResult:
    """One attempt of a case that was tried several times.

    Attributes:
        verdict: The verdict of this attempt alone.
        requirement: The requirement that was violated; empty if none was.
        message: One sentence.
        late: Whether a message was missing or late during it.
        stall_s: The longest stall of the tester's machine during it, in seconds; 0 for none.
    """

    verdict: Verdict
    requirement: str = ""
    message: str = ""
    late: bool = False
    stall_s: float = 0.0


@dataclass(frozen=True, slots=True)
class SittingResult:
    """What one of several merged sittings found in a case.

    Attributes:
        date: The start of the sitting in UTC, as ISO 8601.
        verdict: The verdict.
        message: One sentence.
    """

    date: str
    verdict: Verdict
    message: str = ""


@dataclass(frozen=True, slots=True)
class RootCause:
    """Failures that probably have one cause.

    Attributes:
        case: The id of the failure to look at first.
        requirements: The requirements that it violates, and those that the same bytes violate.
        cases: The ids of all failures of the group, that one first.
        prevented: The ids of the inconclusive cases that could not be judged because of it.
    """

    case: str
    requirements: tuple[str, ...]
    cases: tuple[str, ...]
    prevented: tuple[str, ...] = ()
