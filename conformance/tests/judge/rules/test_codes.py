"""Clause 8: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

STATUS = "login\n> get_status\n< get_status {}"
REFUSED = "login\n> reset\n< reset {}"
FAILED = "login\n> reset\n< reset 1\n<90 reset {}"

CASES = (
    ("8/1", "pass", STATUS.format("1f")),
    ("8/1", "fail T/7 4.8/2", STATUS.format(r"\x00")),
    ("8/1", "fail T/7", REFUSED.format(r"0|\x11")),
    ("8/1", "none", REFUSED.format("1")),
    ("8/2", "pass", REFUSED.format("0|1A")),
    ("8/2", "tolerated A-T-7=lower case", REFUSED.format("0|1a")),
    ("8/2", "pass", FAILED.format("00|12")),
    ("8/2", "fail T/7 4.8/2", STATUS.format("99")),
    ("8/2", "fail T/7", REFUSED.format("0|2F")),
    ("8/2", "fail T/7 4/3 4.18/5", FAILED.format("00|21")),
    ("8/2", "none", FAILED.format("11")),
    ("8/3", "pass", STATUS.format("00")),
    ("8/3", "tolerated A-8-3=07", REFUSED.format("0|07")),
    ("8/3", "tolerated A-8-3=10", STATUS.format("10")),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_codes(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
