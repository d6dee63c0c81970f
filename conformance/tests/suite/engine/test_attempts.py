"""When a case is repeated, and what follows from its attempts."""

from dataclasses import replace

import pytest

from scaraspec.judge.verdicts import Reason, Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.attempts import Attempt, needs_another, settle
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.outcome import Outcome

CASE = Case("4.8/2", ("4.8/2",), frozenset({Hazard.READ_ONLY}))
KINDS = {
    "P": Attempt(Outcome(CASE, Verdict.PASS)),
    "F": Attempt(Outcome(CASE, Verdict.FAIL, "4.8/2", message="wrong bytes")),
    "L": Attempt(Outcome(CASE, Verdict.FAIL, "4.8/2", message="no reply"), late=True),
    "I": Attempt(Outcome(CASE, Verdict.INCONCLUSIVE, message="unclear")),
    "S": Attempt(Outcome(CASE, Verdict.FAIL, "4.8/2", message="stalled"), stall_s=2.0),
    "T": Attempt(Outcome(CASE, Verdict.NONE, message="too short", reason=Reason.TOO_SHORT)),
    "J": Attempt(Outcome(CASE, Verdict.PASS), frozenset({"3/31"}), late=True),
}
"""Pass, failure by bytes, failure by lateness, inconclusive, stalled, too short, judge's
finding."""


@pytest.mark.parametrize(
    ("attempts", "verdict"),
    [
        ("P", Verdict.PASS),
        ("I", Verdict.INCONCLUSIVE),
        ("FP", Verdict.FAIL),
        ("FF", Verdict.FAIL),
        ("LPP", Verdict.INCONCLUSIVE),
        ("LPL", Verdict.FAIL),
        ("LL", Verdict.FAIL),
        ("LF", Verdict.FAIL),
        ("SP", Verdict.PASS),
        ("SSS", Verdict.INCONCLUSIVE),
        ("SFP", Verdict.FAIL),
        ("SLPP", Verdict.INCONCLUSIVE),
        ("TTTP", Verdict.PASS),
        ("TTTTTTTT", Verdict.NONE),
        ("TFP", Verdict.FAIL),
        ("STLPP", Verdict.INCONCLUSIVE),
        ("JP", Verdict.PASS),
        ("JJ", Verdict.PASS),
    ],
)
def test_attempts(attempts: str, verdict: Verdict) -> None:
    """The series ends exactly here, and has this outcome."""
    series = [KINDS[kind] for kind in attempts]
    for count in range(1, len(series)):
        assert needs_another(series[:count])
    assert not needs_another(series)
    outcome = settle(series)
    assert outcome.verdict is verdict
    assert len(outcome.attempts) == (len(series) if len(series) > 1 else 0)


def test_a_failure_that_cannot_be_repeated_counts() -> None:
    """A destructive case is tried once: its failure stands."""
    assert settle([KINDS["L"]], repeatable=False).verdict is Verdict.FAIL


def test_a_late_message_in_a_case_that_is_not_repeated() -> None:
    """The message came late, while the case waited longer."""
    delayed = replace(KINDS["L"], delayed=True)
    assert settle([delayed], repeatable=False).reason is Reason.INTERMITTENT


def test_messages() -> None:
    """The message names the reason why a failure does not count."""
    assert settle([KINDS[kind] for kind in "LPP"]).message == (
        "intermittent: the case failed in 1 of 3 attempts, in which a message was missing or late: "
        "no reply"
    )
    assert settle([KINDS["S"]] * 3).message == "this machine stalled for 2.0 s: stalled"
