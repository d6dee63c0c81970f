"""The outcome of a case."""

from dataclasses import dataclass

from scaraspec.judge.verdicts import Cause, Verdict
from scaraspec.report.model import AttemptResult
from scaraspec.suite.engine.case import Case
from scaraspec.traffic.events import FrameSeen, InvalidBytes


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
        duration_s: The duration in seconds, on the clock of the subject.
        examples: The number of values that were tried; 0 if the case draws no values.
        frames: The last frames of the case.
        readings: The readings that were tolerated, as key and option.
        attempts: The results of all attempts, if there were several.
    """

    case: Case
    verdict: Verdict
    requirement: str = ""
    cause: Cause | None = None
    message: str = ""
    expected: str = ""
    observed: str = ""
    duration_s: float = 0.0
    examples: int = 0
    frames: tuple[FrameSeen | InvalidBytes, ...] = ()
    readings: tuple[tuple[str, str], ...] = ()
    attempts: tuple[AttemptResult, ...] = ()
