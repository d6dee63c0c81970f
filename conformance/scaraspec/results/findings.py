"""Findings of results: which are failures, which place they have, and which values are stable."""

import re
from collections import Counter
from collections.abc import Mapping
from typing import Final

from scaraspec.judge.verdicts import Conclusion, Reason, Verdict
from scaraspec.report.model import SEEN, Case, Results
from scaraspec.user_message import UserMessage

SKIPPED_AFTER_FAILURE: Final = frozenset({Reason.FAILED_BEFORE, Reason.DEPENDENCY})
"""Reasons of cases that did not run because of a failure that the results contain."""

_VOLATILE_NAMES: Final = frozenset({"connection", "count", "first_case", "port", "times"})
_TIME_UNITS: Final = ("_s", "_ms", "_ns")
_VOLATILE: Final = re.compile(
    r"\bzs[a-z]{2}[a-z0-9]*"  # names of the suite's files have a token of the run
    r"|\d+\.\d+|\d+ (?:ms|s|min|times)\b"  # measured values
)


class OldResultsError(ValueError):
    """Results that a version without fingerprints has written."""


def contradiction(results: Results) -> str:
    """Return what in results cannot be true; empty if nothing is known."""
    ids = Counter(case.id for case in results.cases)
    if doubled := [case_id for case_id, count in ids.items() if count > 1]:
        return UserMessage("case {case} occurs more than once", case=doubled[0])
    counts = Counter(case.verdict for case in results.cases)
    if counts != Counter(results.counts):
        return "the numbers of verdicts are not those of the cases"
    if (results.verdict is Conclusion.NONCONFORMANT) != bool(counts[Verdict.FAIL]):
        return "the verdict does not follow from the cases"
    return ""


def failures(results: Results) -> tuple[Case, ...]:
    """Return the failed cases.

    Raises:
        OldResultsError: A failed case has no fingerprint.
    """
    failed = tuple(case for case in results.cases if case.verdict is Verdict.FAIL)
    if not all(case.fingerprint for case in failed):
        raise OldResultsError("the results are of an old version of scaraspec: repeat the run")
    return failed


def place(case: Case) -> str:
    """Return the id of a case; for a finding of the judge without its number, which may change."""
    base, seen, _ = case.id.partition(SEEN)
    return f"{base}{seen}"


def decided(case: Case) -> bool:
    """Whether a case of the suite has a verdict. Findings of the judge come and go with traffic."""
    return SEEN not in case.id and case.verdict in (Verdict.PASS, Verdict.TOLERATED, Verdict.FAIL)


def stable_values(case: Case) -> Mapping[str, str]:
    """Return the values of a message that are equal if the same run is repeated.

    Measured times, ports, connections, counts and the names of test files are left out.
    """
    message = case.message
    values = message.values if isinstance(message, UserMessage) else {}
    return {
        name: _VOLATILE.sub("#", value)
        for name, value in values.items()
        if name not in _VOLATILE_NAMES and not name.endswith(_TIME_UNITS)
    }
