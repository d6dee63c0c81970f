"""First replies: late ones, and those to a request that was sent again after a timeout."""

from collections.abc import Callable
from typing import Any

import pytest

# A run is given up after 5 s and another one is ordered. Both are answered later.
LATE_RUN = """
    login
    > run_program a.rob
    +5.3
    > run_program b.rob
    +{after}
    < run_program 1
    +{then}
    < run_program 0|01
    +1
    <90 run_program 11
"""
# A slow thread of the robot answers a query late, when an output has been set.
LATE_QUERY = """
    login
    > get_digital_outputs
    +5
    > set_digital_output 1|1
    < set_digital_output 1
    > get_digital_outputs
    +{after}
    < get_digital_outputs 1|0000000000000000
    < get_digital_outputs 1|0000000000000001
    {then}
"""
# A query is not answered, but each later one is.
LOST = """
    login
    > get_status
    +5.3
    > get_status
    +{after}
    < get_status 00
    +{poll}
    > get_status
    < get_status 00
    > get_time
    < get_time 20260101000000
    +6
    > get_status
    < get_status 00
"""
MISMATCHED = "> get_status\n< get_version 1.0.0\n+1\n> get_status\n< get_version 1.0.0\n"
PORT_2 = "> set_digital_output 2|1\n< set_digital_output 1\n"
OUTPUTS = "> get_digital_outputs\n< get_digital_outputs 1|{}\n"

CASES = (
    *(
        (requirement, "inconclusive", session)
        for requirement in ("3/31", "3/33")
        for session in (
            LATE_RUN.format(after=0.7, then=1),
            LATE_RUN.format(after=0.01, then=0.01),
            LATE_QUERY.format(after=1, then=""),
            LATE_QUERY.format(after=0.01, then=""),
        )
    ),
    ("4.32/6", "pass", LATE_QUERY.format(after=1, then=PORT_2 + OUTPUTS.format("0" * 14 + "11"))),
    ("3/31", "fail", LOST.format(after=0, poll=0.1)),
    ("3/31", "fail", LOST.format(after=0, poll=6)),
    ("3/31", "inconclusive", LOST.format(after=1, poll=0.1)),
    # Each request is followed only by the reply of another command.
    ("3/11", "fail", "login\n" + MISMATCHED),
    ("3/11", "fail", "login\n" + MISMATCHED + "+9\n> get_status\n< get_status 00"),
    ("3/11", "pass", "login\n" + MISMATCHED.partition("+1")[0]),
    ("3/11", "pass", "login\n> get_status\n< get_time 20260101000000\n< get_status 00"),
    ("3/11", "inconclusive", "< gap 9\nlogin\n" + MISMATCHED),
    ("3/33", "none 3/31", LOST.format(after=0, poll=0.1)),
    ("3/33", "none", "login\n> get_status\n+6\n< get_status 00\n> get_status\n< get_status 00"),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_replies(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """The verdict is the register's, and nothing else fails for it."""
    check_case(requirement, expected, session)


def test_the_first_reply_after_a_timeout_answers_the_oldest_request(judged: Any) -> None:
    """The run that was accepted late is the first one."""
    record = judged(LATE_RUN.format(after=0.7, then=1))
    runs = {x.request.text: x for x in record.exchanges if x.name == "run_program"}
    assert runs[b"a.rob"].outcome.done
    assert runs[b"b.rob"].accepted is False


def test_a_query_is_certain_again_when_no_late_reply_can_come(judged: Any) -> None:
    """The doubt about which request a reply answers ends with the reply time."""
    record = judged(LOST.format(after=1, poll=0.1))
    last = [x for x in record.exchanges if x.name == "get_status"][-1]
    assert last.certain
