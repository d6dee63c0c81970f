"""The scope: which side a finding is about, and which findings count."""

from collections.abc import Callable

import pytest

from scaraspec.judge.judge import Judge
from scaraspec.judge.scope import EVERYTHING, Scope
from scaraspec.judge.verdicts import Conclusion, Finding, Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import WireEvent

Script = Callable[[str], list[WireEvent]]

UPLOAD_AND_BACK = """
    login
    > upload_name a.rob
    < upload_name 1
    > chunk 0/5
    < upload_chunk 1
    > download_name a.rob
    < download_name 1
    < chunk 0/5
    > download_chunk 1
"""


def judged(session: list[WireEvent], scope: Scope) -> tuple[Judge, list[Finding]]:
    """Judge a session; return the judge and all findings."""
    judge = Judge(scope=scope)
    items = [item for event in session for item in judge.feed(event)] + [*judge.close()]
    return judge, [item for item in items if isinstance(item, Finding)]


@pytest.mark.parametrize(
    ("session", "requirement", "side"),
    [
        ("login\n> get_status 1\n< get_status 00", "4.8/1", A2C),
        ("login\n> get_status\n< get_status 0", "4.8/2", C2A),
        ("login\n> =AA 09 01 CC\n> get_status\n< get_status 00", "3/6", A2C),  # binds both
        ("login\n> get_status\n< =CC 09 03 30 30 AA\n< get_status 00", "3/6", C2A),
    ],
)
def test_the_side_of_a_finding(
    script: Script, session: str, requirement: str, side: Direction
) -> None:
    """All findings are yielded; only those about the subject are counted."""
    events = script(session)
    for subject in (A2C, C2A):
        judge, findings = judged(events, Scope(subject))
        assert [f.verdict for f in findings if f.requirement == requirement] == [Verdict.FAIL]
        counts = judge.tallies[requirement].counts
        assert counts[Verdict.FAIL] == (subject is side)
        assert bool(judge.other_side) == (subject is not side)
        assert (judge.conclusion is Conclusion.NONCONFORMANT) is (subject is side)


@pytest.mark.parametrize("side", [A2C, C2A])
def test_a_finding_about_both(script: Script, side: Direction) -> None:
    """A controller that opens the connection to a client that listens: both are wrong."""
    judge, _ = judged(script("< open"), Scope(side))
    assert judge.tallies["2/1"].verdict is Verdict.FAIL


def test_passes_of_the_other_side(script: Script) -> None:
    """A side without traffic has passed nothing."""
    events = script(UPLOAD_AND_BACK)
    both, client, controller = (judged(events, Scope(side))[0].tallies for side in (None, A2C, C2A))
    assert both.keys() == client.keys() | controller.keys()
    for requirement, tally in both.items():
        passes = client[requirement].passes, controller[requirement].passes
        assert tally.passes == (passes[0] if requirement == "2/1" else sum(passes)), requirement
    assert client["2/1"].passes == controller["2/1"].passes == 1
    (request,) = script("> get_status")[1:]
    judge = Judge(scope=Scope(C2A))
    list(judge.feed(request))
    assert not judge.tallies


def test_what_cannot_be_decided(script: Script) -> None:
    """The finding is yielded, but counts for neither side."""
    events = script("login\n> get_status\n< get_status 0")
    judge, findings = judged(events, Scope(C2A, undecidable=frozenset({"4.8/2"})))
    assert "4.8/2" in {finding.requirement for finding in findings}
    assert "4.8/2" not in judge.tallies
    assert judge.other_side == 0


def test_unsupported_commands(script: Script) -> None:
    """Exchanges of unsupported commands count for the client, not for the controller."""
    events = script("login\n> get_time\n+6\n> get_status\n< get_status 00\n> close")
    assert judged(events, EVERYTHING)[0].tallies["3/31"].verdict is Verdict.FAIL
    scope = Scope(unsupported=frozenset({"get_time"}))
    assert judged(events, scope)[0].tallies["3/31"].verdict is Verdict.PASS
