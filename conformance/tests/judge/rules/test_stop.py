"""Emergency stops: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

STOPPED = """
    login
    > {request}
    < {name} 1
    > emergency_stop
    < emergency_stop 1
    <90 {name} {result}
    <90 emergency_stop 11
"""
REFUSED = """
    login
    > run_program a
    < run_program 1
    > emergency_stop
    < emergency_stop 0
    {then}
"""
ENDS = "<90 run_program 11"
STATUS = "> get_status\n< get_status {}\n"

CASES = (
    ("4.17/2", "pass", "login\n> emergency_stop\n< emergency_stop 0"),
    ("4.17/2", "tolerated A-4.17-1=0|…", "login\n> emergency_stop\n< emergency_stop 0|00"),
    *(
        case
        for requirement, other in (("4.17/3", "4.17/6"), ("4.17/6", "4.17/3"))
        for case in (
            (requirement, "pass", STOPPED.format(request="jog 1", name="jog", result="11")),
            (requirement, "fail " + other, REFUSED.format(then="+1\n" + ENDS)),
            (requirement, "fail " + other, REFUSED.format(then=STATUS.format("01"))),
            # The motion had just ended by itself.
            (requirement, "none", REFUSED.format(then=ENDS)),
            (requirement, "none", "login\n> emergency_stop\n< emergency_stop 0"),
        )
    ),
    ("4.17/8", "pass", STOPPED.format(request="reset", name="reset", result="00|00")),
    ("4.17/8", "pass", STOPPED.format(request="jog 1", name="jog", result="11")),
    ("4.17/8", "fail", STOPPED.format(request="reset", name="reset", result="11")),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_stop(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
