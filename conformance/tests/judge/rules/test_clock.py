"""The clock: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

SET = """
    login
    > set_time {value}
    < set_time {reply}
    +{pause}
    > get_time
    < get_time {answer}
"""
READ = """
    login
    > get_time
    < get_time {first}
    {between}
    > get_time
    < get_time {second}
"""
NOON, LATER = "20260101120000", "20260101120010"
STEADY = "".join(f"+1\n> get_time\n< get_time 202601011200{second:02}\n" for second in range(1, 40))
HURRIED = "".join(
    f"+1\n> get_time\n< get_time 202601011200{second * 11 // 10:02}\n" for second in range(1, 40)
)

JUMP = (
    "> get_time\n< get_time 20260101120000\n"
    + STEADY
    + "+{pause}\n"
    + STEADY.replace("1200", "1201")
)

CASES = (
    ("4.5/4", "pass", SET.format(value=NOON, reply="1", pause=10, answer=LATER)),
    ("4.5/4", "pass", SET.format(value=NOON, reply="1", pause=0, answer="20260101120002")),
    ("4.5/4", "fail", SET.format(value=NOON, reply="1", pause=0, answer="20260101120003")),
    ("4.5/4", "fail", SET.format(value=NOON, reply="1", pause=10, answer=NOON)),
    ("4.5/4", "fail", SET.format(value="99991231235959", reply="1", pause=9, answer=NOON)),
    ("4.5/4", "none", SET.format(value=NOON, reply="0", pause=0, answer=LATER)),
    # A clock with a wrong rate violates another requirement.
    ("4.5/4", "none", SET.format(value=NOON, reply="1", pause=100, answer=NOON)),
    ("4.6/4", "pass", READ.format(first=NOON, between="+10", second=LATER)),
    ("4.6/4", "pass", READ.format(first=NOON, between="+0.1", second=NOON)),
    ("4.6/4", "pass", "login\n" + STEADY),
    ("4.6/4", "fail", READ.format(first=LATER, between="", second="20260101120009")),
    ("4.6/4", "fail", READ.format(first=NOON, between="+10", second=NOON)),
    ("4.6/4", "fail", READ.format(first=NOON, between="", second=LATER)),
    # Each step is within the tolerance, but their sum is not.
    ("4.6/4", "fail", "login\n" + HURRIED),
    ("4.6/4", "pass", "login\n" + JUMP.format(pause=20)),
    # The clock runs; one delay may be a step of the recording computer's clock.
    ("4.6/4", "inconclusive", "login\n" + JUMP.format(pause=3600)),
    ("4.6/4", "fail", "login\n" + JUMP.format(pause=0)),
    # Daylight saving time ends and begins; on a Monday neither happens.
    (
        "4.6/4",
        "tolerated A-4.5-1=local time",
        READ.format(first="20261025025959", between="+1", second="20261025020000"),
    ),
    (
        "4.6/4",
        "tolerated A-4.5-1=local time",
        READ.format(first="20260329015959", between="+1", second="20260329030000"),
    ),
    ("4.6/4", "fail", READ.format(first="20261026025959", between="+1", second="20261026020000")),
    ("4.6/4", "none", READ.format(first=LATER, between="> set_time 20260101000000", second=NOON)),
    ("4.6/4", "none", READ.format(first=LATER, between="> shutdown\n< shutdown 1", second=NOON)),
    ("4.6/4", "none", READ.format(first=LATER, between="> gap\n+30", second=NOON)),
    # Between two sessions the clock may have been set, or the robot switched off.
    (
        "4.6/4",
        "none",
        READ.format(first=LATER, between="2> login password\n2< login 1", second=NOON).replace(
            f"> get_time\n    < get_time {NOON}", f"2> get_time\n2< get_time {NOON}"
        ),
    ),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_clock(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
