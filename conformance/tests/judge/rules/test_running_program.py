"""The running program: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

DURING = """
    login
    > {name} a.rob
    < {name} 1
    +60
    > get_running_program
    < get_running_program {answer}
    {rest}
"""
IDLE = """
    login
    > get_status
    < get_status {status}
    {pause}
    > get_running_program
    < get_running_program {answer}
    > get_status
    < get_status {status}
"""
ASK = "login\n> get_running_program\n< get_running_program {}"
LONG = "n" * 31


def during(answer: str, name: str = "run_program", rest: str = "") -> str:
    """A query of the running program while a program executes."""
    return DURING.format(name=name, answer=answer, rest=rest or f"<90 {name} 11")


def twice(first: str, pause: str, second: str) -> str:
    """Two queries while a program runs."""
    again = f"+{pause}\n> get_running_program\n< get_running_program 1|a.rob|{second}"
    return during(f"1|a.rob|{first}", rest=f"{again}\n<90 run_program 11")


def idle(answer: str, status: str = "00", pause: str = "") -> str:
    """A query of the running program between two status queries."""
    return IDLE.format(answer=answer, status=status, pause=pause)


SECONDS = "".join(
    f"+1\n> get_running_program\n< get_running_program 1|a.rob|{{}}{second:02}\n"
    for second in range(50, 60)
)

RESTARTED = """
    login
    > run_program a.rob
    < run_program 1
    > get_status
    < get_status 01
    > emergency_stop
    < emergency_stop 1
    <90 run_program 00|00
    <90 emergency_stop 11
    > get_running_program
    < get_running_program 0
    > run_program a.rob
    < run_program 1
    > get_status
    < get_status 01
"""

RUN_ENDED = """
    login
    > run_program a.rob
    < run_program 1
    +1
    <90 run_program 11
    {pause}
    > get_status
    < get_status {status}
    {between}
    > get_running_program
    < get_running_program 1|a.rob|00000001
"""
RUN_B = "> run_program b\n< run_program 1"

CASES = (
    ("4.9/2", "pass", during("1|a.rob|00000000")),
    ("4.9/2", "pass", during(r"\x01|a.rob|00000000")),
    ("4.9/2", "fail", during("0")),
    ("4.9/2", "fail T/1", during("1a.rob00000000")),
    ("4.9/2", "fail", during("1|a.rob")),
    ("4.9/2", "none", during("0", name="simulate_program")),
    ("4.9/2", "none", ASK.format("0")),
    ("4.9/4", "pass", during("1|a.rob|00000000", name="simulate_program")),
    ("4.9/4", "fail", during("1|b.rob|00000000")),
    ("4.9/4", "none", ASK.format("1|b.rob|00000000")),
    (
        "4.9/4",
        "tolerated A-4.9-5=cut",
        during(f"1|{LONG[:30]}|00000000").replace("> run_program a.rob", f"> run_program {LONG}"),
    ),
    ("4.9/5", "pass", twice("00000055", "10", "00000105")),
    ("4.9/5", "pass", twice("00000055", "0.5", "00000055")),
    ("4.9/5", "fail", twice("00000055", "10", "00000055")),
    ("4.9/5", "fail", twice("00000059", "1", "00000000")),
    # The difference does not accumulate: each step is within the tolerance.
    ("4.9/5", "fail", during("1|a.rob|00000045", rest=SECONDS.format(*["000001"] * 10))),
    (
        "4.9/5",
        "none",
        twice("00000055", "10", "00000055").replace(" run_program", " simulate_program"),
    ),
    # It counts from the start of this run (A-4.9-3).
    ("4.9/5", "fail", during("1|a.rob|01000000")),
    ("4.9/5", "fail", during("1|a.rob|00000105")),
    ("4.9/5", "none", during("1|a.rob|00000102")),
    ("4.9/5", "none", during("1|a.rob|01000000", name="simulate_program")),
    ("4.9/5", "none", ASK.format("1|a.rob|01000000")),
    ("4.9/6", "fail", RUN_ENDED.format(pause="", status="00", between="")),
    ("4.9/6", "fail", RUN_ENDED.format(pause="+2", status="00", between="")),
    ("4.9/6", "none 4.9/4", RUN_ENDED.format(pause="", status="00", between=RUN_B)),
    ("4.9/6", "none", RUN_ENDED.format(pause="", status="00", between="> run_program b")),
    ("4.9/6", "none", RUN_ENDED.format(pause="", status="00", between="+1")),
    ("4.9/6", "pass", ASK.format("0")),
    ("4.9/6", "pass", idle("0")),
    ("4.9/6", "fail", ASK.format("0|a.rob|00000000")),
    ("4.9/6", "fail", idle("1|a.rob|00000000")),
    ("4.9/6", "none", idle("1|a.rob|00000000", pause="+2")),
    ("4.9/6", "none", idle("1|a.rob|00000000", status="01")),
    ("4.9/7", "pass", ASK.format("0")),
    ("4.9/7", "tolerated runinfo_none=0||", ASK.format("0||")),
    ("4.9/8", "pass", ASK.format("1|a.rob|00000000")),
    ("4.9/8", "tolerated A-4.9-5=longer", ASK.format(f"1|{LONG}|00000000")),
    ("4.9/10", "pass", idle("1|a.rob|00000000", status="01")),
    ("4.9/10", "pass", idle("1|a.rob|00000000", status="02")),
    ("4.9/10", "fail", idle("0", status="01")),
    ("4.9/10", "tolerated A-4.9-4=no", idle("0", status="02")),
    ("4.9/10", "none", idle("0", status="01", pause="+2")),
    ("4.9/10", "none", idle("0", status="12")),
    ("4.9/10", "none", RESTARTED),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_running_program(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
