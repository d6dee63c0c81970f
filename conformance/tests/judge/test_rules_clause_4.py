"""Clauses 4.1 and 4.8: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

RELOGIN = """
    login
    > close
    2> login {password}
    2< login {answer}
"""
STATUS = "login\n> get_status\n< get_status {}"
DURING = """
    login
    > {name} {data}
    < {name} 1
    > get_status
    < get_status {status}
    <90 {name} 11
"""

OTHER = """
    login
    > jog 1
    < jog 1
    2> get_status
    2< get_status 00
    {pause}
    <90 jog 11
"""


def during(name: str, status: str, data: str = "") -> str:
    """A status query while a command executes."""
    return DURING.format(name=name, status=status, data=data)


CASES = (
    ("4.1/1", "pass", "login"),
    ("4.1/1", "fail", "> login\n< login 0"),
    ("4.1/2", "pass", RELOGIN.format(password="password", answer=1)),
    ("4.1/2", "fail", RELOGIN.format(password="password", answer=0)),
    ("4.1/2", "pass", RELOGIN.format(password="password", answer=0).replace("> c", "+61\n> c")),
    # After a change or a gap it is unknown which password is right.
    (
        "4.1/2",
        "pass",
        RELOGIN.format(password="password", answer=0).replace(
            "> close", "> set_password password|new\n< set_password 1\n> close"
        ),
    ),
    ("4.1/2", "pass", RELOGIN.format(password="password", answer=0).replace("> c", "> gap 9\n> c")),
    # The controller may accept only one client (A-2-2).
    ("4.1/2", "pass", RELOGIN.format(password="password", answer=0).replace("> close", "")),
    # The robot may have been switched off and have lost the password that was set (A-4-6).
    ("4.1/2", "pass", RELOGIN.format(password="password", answer=0).replace("> close", "< rst")),
    ("4.1/3", "pass", RELOGIN.format(password="wrong", answer=0)),
    ("4.1/3", "fail", RELOGIN.format(password="wrong", answer=1)),
    ("4.1/4", "pass", "login"),
    ("4.1/4", "fail", "> login password\n< login 1|welcome"),
    ("4.1/4", "fail", "> login password\n< login"),
    # The notation of the flag is judged by T/2 to T/4.
    ("4.1/4", "none T/3", "> login password\n< login \\x01"),
    ("4.1/4", "none", "> login password\n< login 1\\x00"),
    ("4.1/5", "pass", "login\n> get_status\n< get_status 00"),
    ("4.1/5", "pass", "> login wrong\n< login 0\nlogin\n> get_status\n< get_status 00"),
    ("4.1/5", "fail", "> login wrong\n< login 0\n> get_status"),
    ("4.1/5", "none", "> login wrong\n< login 0\n> emergency_stop"),
    # The state of a login before this one is not specified (A-4.1-2).
    ("4.1/5", "none", "login\n> login wrong\n< login 0\n> get_status"),
    ("4.1/5", "none", "> login wrong\n< login 0\n< gap 9\n> get_status"),
    # The name of the connection is used again: the new connection has refused nothing.
    ("4.1/5", "none 2/10", "> login wrong\n< login 0\n> open\n> get_status"),
    ("4.8/1", "pass", STATUS.format("00")),
    ("4.8/1", "fail", "login\n> get_status 0\n< get_status 00"),
    ("4.8/2", "pass", STATUS.format("1f")),
    ("4.8/2", "pass", STATUS.format("00\\x00")),
    ("4.8/2", "fail T/7", STATUS.format("IDLE")),
    ("4.8/2", "fail T/7 8/1", STATUS.format("")),
    ("4.8/3", "pass", STATUS.format("00")),
    ("4.8/3", "none", STATUS.format("01")),
    ("4.8/4", "pass", during("run_program", "01", "a.rob")),
    ("4.8/4", "pass", during("run_program", "12", "a.rob")),
    ("4.8/4", "fail", during("run_program", "02", "a.rob")),
    ("4.8/4", "fail 4/8", during("run_program", "00", "a.rob")),
    # After a gap another command may be executing.
    ("4.8/4", "none", "> gap\nlogin" + during("run_program", "04", "a.rob")),
    # An emergency stop in progress may have ended the program already.
    (
        "4.8/4",
        "none",
        """
        login
        > run_program a.rob
        < run_program 1
        > emergency_stop
        > get_status
        < emergency_stop 1
        < get_status 00
        <90 emergency_stop 11
        <90 run_program 00|00
        """,
    ),
    # Without a final result the status 00 is right; the final result is missing.
    (
        "4.8/4",
        "none 3/18 4.15/5",
        during("run_program", "00", "a.rob").split("<90")[0] + "+6\n> close",
    ),
    ("4.8/5", "pass", during("simulate_program", "02", "a.rob")),
    ("4.8/5", "fail", during("simulate_program", "01", "a.rob")),
    ("4.8/5", "fail 4/8", during("simulate_program", "00", "a.rob")),
    ("4.8/6", "pass", during("reset", "03")),
    ("4.8/6", "fail", during("reset", "04")),
    ("4.8/6", "fail 4/8", during("reset", "00")),
    ("4.8/7", "pass", during("set_tool_coordinates", "04", "50|200|300|200|0|0|0")),
    ("4.8/7", "fail", during("set_tool_coordinates", "01", "50|200|300|200|0|0|0")),
    ("4.8/7", "fail 4/8", during("set_tool_coordinates", "00", "50|200|300|200|0|0|0")),
    ("4.8/7", "fail 4/8", during("jog", "00", "1")),
    # Frames of two connections may be captured in another order.
    ("4.8/7", "none", "2> login password\n2< login 1" + OTHER.format(pause="").replace("00", "02")),
    ("4.8/7", "none", "2> login password\n2< login 1" + OTHER.format(pause="")),
    ("4.8/7", "fail 4/8", "2> login password\n2< login 1" + OTHER.format(pause="+2")),
    ("4.8/8", "pass", STATUS.format("12")),
    ("4.8/8", "none", STATUS.format("00")),
    ("4.8/9", "pass", STATUS.format("04")),
    ("4.8/9", "tolerated A-8-3=20", STATUS.format("20")),
    ("4.8/9", "tolerated A-8-3=07", STATUS.format("07")),
    ("4.8/10", "pass", during("reset", "03")),
    (
        "4.8/10",
        "tolerated A-4-3=not served",
        """
        login
        > reset
        < reset 1
        > get_status
        > get_time
        < get_time 20260101000000
        +11
        > get_time
        < get_time 20260101000011
        <90 reset 11
        """,
    ),
    ("4.8/10", "inconclusive", "login\n> reset\n< reset 1\n> get_status\n+6\n<90 reset 11"),
)

PASSES_ONLY = {
    "4.8/8": "whether a fault is present shows nowhere else",
}


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_clause_4(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
