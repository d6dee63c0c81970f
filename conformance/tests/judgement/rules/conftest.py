"""How a case of a rule is held: its requirement's verdict, and all else that fails."""

from collections.abc import Callable

import pytest

from scaraspec.judgement.verdicts import Verdict


@pytest.fixture(scope="session")
def check_case(judged: Callable) -> Callable[[str, str, str], None]:
    """Holds a session against what is expected of one requirement.

    Expected is a verdict; behind "tolerated" stands the reading, behind another what else fails.
    """

    def check(requirement: str, expected: str, session: str) -> None:
        verdict, _, more = expected.partition(" ")
        record = judged(session)
        told = "\n".join(f"{f.requirement} {f.verdict.value}: {f.message}" for f in record.findings)
        assert record.verdict(requirement) is Verdict(verdict), told
        also = set() if verdict == "tolerated" else set(more.split())
        assert record.failed == also | ({requirement} if verdict == "fail" else set()), told
        findings = [f for f in record.findings if f.requirement == requirement]
        if verdict == "tolerated":
            assert {f.reading for f in findings} == {tuple(more.split("=", 1))}, told
        for finding in findings:
            assert finding.message
            assert finding.evidence

    return check
