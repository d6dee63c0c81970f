"""A busy robot: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

TWO = """
    login
    > {first}
    < {first_name} 1
    > {second}
    < {second_name} {reply}
    {rest}
"""


def two(first: str, second: str, reply: str, rest: str = "") -> str:
    """A command that executes, and a second one with its reply."""
    names = {"first_name": first.partition(" ")[0], "second_name": second.partition(" ")[0]}
    return TWO.format(first=first, second=second, reply=reply, rest=rest, **names)


def ends(*names: str) -> str:
    """Final results, one after the other."""
    return "\n".join(f"<90 {name} 11" for name in names)


RUN, RESET, JOG, MOVE = "run_program a", "reset", "jog 1", "set_tool_coordinates 50|1|2|3|4|0|0"
END_BOTH = "<90 {0} 11\n<90 {1} 11"
ELSEWHERE = """
    login
    2> login password
    2< login 1
    > run_program a
    < run_program 1
    2> reset
    2< reset 1
    {pause}
    <90 run_program 11
    2<90 reset 11
"""
OVER_FIRST = """
    login
    2> login password
    2< login 1
    > run_program a
    < run_program 1
    2> reset
    2< reset 1
    {pause}
    2<90 reset 11
    <90 run_program 11
"""
BESIDE = """
    login
    2> login password
    2< login 1
    > run_program a
    < run_program 1
    {second}
    +2
    {end}
"""
PROGRAM_ENDS = "<90 run_program 11"
# The last packets of the first connection, with the end of the program, are not in the capture.
IDLE_ELSEWHERE = """
    login
    > run_program a
    < run_program 1
    +2
    2> login password
    2< login 1
    2> get_status
    2< get_status 00
    2> {second}
    2< {second} {reply}
"""
LATE_AFTER_RESULT = """
    login
    > reset
    < reset 1
    +1.1
    <90 reset 11
    > get_status
    < get_status 03
    +0.03
    > get_status
    < get_status 00
"""
IDLE = """
    login
    > get_status
    < get_status 00
    {pause}
    > {request}
    < {request} 0|{code}
    > get_status
    < get_status {status}
"""
DONE = """
    login
    > reset
    < reset 1
    <90 reset {result}
    {pause}
    > get_status
    < get_status {status}
"""
LOCK_BESIDE_ANOTHER = """
    login
    2> login password
    2< login 1
    > lock_joints
    < lock_joints 1
    <90 lock_joints 11
"""
DONE_ELSEWHERE = f"""{LOCK_BESIDE_ANOTHER}
    {{pause}}
    2> get_status
    2< get_status 03
"""
NEVER_IDLE = """
    login
    > run_program a
    < run_program 1
    +1
    <90 run_program 11
    +0.02
    > get_status
    < get_status {first}
    +{pause}
    > get_status
    < get_status {second}
    {then}
"""
NEVER_IDLE_BESIDE = """
    login
    2> login password
    2< login 1
    > run_program a
    < run_program 1
    <90 run_program 11
    2> run_program b
    > get_status
    < get_status 01
    +1
    > get_status
    < get_status 01
    {then}
"""
STOPPED = """
    login
    > run_program a
    < run_program 1
    > emergency_stop
    < emergency_stop 1
    {own}
    <90 emergency_stop 11
"""
STOPPED_AND_BUSY = (
    STOPPED.replace("{own}", "<90 run_program 00|00")
    + """
    +0.2
    > get_status
    < get_status 01
    +{pause}
    > get_status
    < get_status 01
    {then}
"""
)
FLICKER = """
    login
    {before}
    > get_status
    < get_status 00
    +{pause}
    > get_status
    < get_status 04
    {then}
    +0.2
    > get_status
    < get_status 00
"""
SHORT_RESET = "> reset\n< reset 1\n<90 reset 11\n+0.2"
REFUSED_AS_BUSY = "> reset\n< reset 0|01\n"
FAULT = """
    login
    > get_status
    < get_status {status}
    > reset
    < reset {reply}
"""
BEGUN_ELSEWHERE = f"""{LOCK_BESIDE_ANOTHER}
    {{begun}}
    +0.2
    > get_status
    < get_status 01
    {{then}}
"""

CASES = (
    ("4/6", "pass", two(RUN, RESET, "0|01", ends("run_program"))),
    ("4/6", "fail", two(JOG, RESET, "1", ends("jog", "reset"))),
    (
        "4/6",
        "tolerated busy_reply=silence",
        """
        login
        > jog 1
        < jog 1
        > reset
        > get_status
        < get_status 04
        +11
        > get_status
        < get_status 04
        <90 jog 11
        """,
    ),
    ("4/6", "tolerated A-4.28-5=replace", two(JOG, "jog 2", "1", ends("jog", "jog"))),
    (
        "4/6",
        "tolerated A-4.25-2=at lock",
        two("release_joints", "lock_joints", "1", ends("release_joints", "lock_joints")),
    ),
    # Frames of two connections may be captured in another order than they were sent.
    ("4/6", "none", ELSEWHERE.format(pause="")),
    ("4/6", "fail 4.18/2", ELSEWHERE.format(pause="+2")),
    ("4/6", "none", OVER_FIRST.format(pause="")),
    ("4/6", "fail 4.18/2", OVER_FIRST.format(pause="+2")),
    ("4/6", "none", IDLE_ELSEWHERE.format(second="reset", reply="1")),
    *(
        (requirement, expected, BESIDE.format(second=second, end=PROGRAM_ENDS))
        for requirement, expected, second in (
            ("4.15/8", "fail 4/6", "2> run_program b\n2< run_program 1\n2<90 run_program 11"),
            (
                "4.25/5",
                "fail 4/6",
                "2> release_joints\n2< release_joints 1\n2<90 release_joints 11",
            ),
            ("4.35/4", "fail 4/15", "2> shutdown\n2< shutdown 0|04"),
            ("4/15", "fail 4.18/2", "2> reset\n2< reset 0|04"),
        )
    ),
    # Its final result may be missing in the capture.
    (
        "4/6",
        "none",
        BESIDE.format(second="2> run_program b\n2< run_program 1\n2<90 run_program 11", end=""),
    ),
    # The program may have been stopped because its client disconnected (A-2-8).
    ("4/6", "none", ELSEWHERE.format(pause="+2").replace("2> reset", "> half-close\n2> reset")),
    # An emergency stop is always allowed.
    ("4/6", "none", two(JOG, "emergency_stop", "1", ends("jog", "emergency_stop"))),
    ("4.15/8", "pass", two(RUN, "run_program b", "0|01", ends("run_program"))),
    ("4.15/8", "fail 4/6", two(RUN, "run_program b", "1", ends("run_program", "run_program"))),
    ("4.15/8", "none", two(RESET, RUN, "0|03", ends("reset"))),
    ("4.25/5", "pass", two(MOVE, "release_joints", "0|04", ends("set_tool_coordinates"))),
    (
        "4.25/5",
        "fail 4/6",
        two(MOVE, "release_joints", "1", ends("set_tool_coordinates", "release_joints")),
    ),
    ("4.18/2", "pass", two(RUN, RESET, "0|01", ends("run_program"))),
    ("4.18/2", "pass", two(RUN, RESET, "0|12", ends("run_program"))),
    ("4.18/2", "fail 4/15", two(RUN, RESET, "0|02", ends("run_program"))),
    ("4.18/2", "fail 4/6", two(RUN, RESET, "1", ends("reset", "run_program"))),
    ("4.18/2", "none", two("simulate_program a", RESET, "0|02", ends("simulate_program"))),
    ("4.35/4", "pass", two(RUN, "shutdown", "0|01", ends("run_program"))),
    ("4.35/4", "fail", two(RUN, "shutdown", "1", "< close")),
    ("4.35/4", "none", IDLE_ELSEWHERE.format(second="shutdown", reply="1")),
    ("4/15", "pass", two(JOG, RESET, "0|04", ends("jog"))),
    ("4/15", "fail", two(JOG, RESET, "0|01", ends("jog"))),
    ("4/15", "none", two(JOG, RESET, "0|12", ends("jog"))),
    ("4/15", "none", two("lock_joints", RESET, "0|04", ends("lock_joints"))),
    ("4/15", "fail", IDLE.format(request="reset", code="01", status="00", pause="")),
    ("4/15", "fail", IDLE.format(request="shutdown", code="04", status="00", pause="")),
    # A client that was not recorded may have started a command, which may have ended since.
    ("4/15", "none", IDLE.format(request="reset", code="01", status="01", pause="")),
    ("4/15", "none", IDLE.format(request="reset", code="01", status="00", pause="+2")),
    ("4/15", "none", IDLE.format(request="reset", code="06", status="00", pause="")),
    ("4/8", "pass", "login\n> reset\n< reset 1\n> get_status\n< get_status 03\n<90 reset 11"),
    ("4/8", "fail 4.8/6", "login\n> reset\n< reset 1\n> get_status\n< get_status 00\n<90 reset 11"),
    # Within 0.1 s the status may be the one before the command (A-4.8-3).
    (
        "4/8",
        "tolerated status_lag=0.091",
        "login\n> reset\n< reset 1\n+0.09\n> get_status\n< get_status 00\n<90 reset 11",
    ),
    (
        "4/8",
        "pass",
        "login\n> reset\n< reset 1\n+0.09\n> get_status\n< get_status 04\n<90 reset 11",
    ),
    # Table 8-1 has no code for locking the joints (A-4-5).
    (
        "4/8",
        "none",
        "login\n> lock_joints\n< lock_joints 1\n> get_status\n< get_status 00\n<90 lock_joints 11",
    ),
    ("4/7", "pass", DONE.format(result="11", pause="", status="00")),
    (
        "4/7",
        "tolerated status_lag=0.051",
        DONE.format(result="11", pause="+0.05", status="03"),
    ),  # it may be the status before the result
    *(
        ("4/7", expected, NEVER_IDLE.format(first=first, pause=pause, second=second, then=then))
        for expected, first, pause, second, then in (
            ("fail", "01", 1, "01", ""),
            ("fail", "01", 0.2, "01", "+1\n> get_status\n< get_status 01"),
            ("pass", "00", 1, "01", ""),
            ("none", "12", 1, "01", ""),
            # A client that is not recorded may have begun it.
            ("tolerated status_lag=0.021", "01", 8, "01", ""),
            ("tolerated status_lag=0.021", "01", 1, "00", ""),
        )
    ),
    # Another client has begun a program; its first reply may come later.
    ("4/7", "none", NEVER_IDLE_BESIDE.format(then="2< run_program 1")),
    ("4.8/3", "fail", FLICKER.format(before="", pause=0.2, then="")),
    ("4.8/3", "pass", FLICKER.format(before="", pause=2, then="")),
    ("4.8/3", "pass", FLICKER.format(before="", pause=0.2, then="> reset")),
    ("4.8/3", "pass", FLICKER.format(before=SHORT_RESET, pause=0.2, then="")),
    ("4.8/3", "pass", LATE_AFTER_RESULT),  # 4/7 judges the status after a final result
    ("4.17/6", "fail 4.17/7", STOPPED_AND_BUSY.format(pause=1, then="")),
    ("4.17/7", "fail 4.17/6", STOPPED_AND_BUSY.format(pause=1, then="")),
    ("4/15", "fail 4.17/6 4.17/7", STOPPED_AND_BUSY.format(pause=1, then=REFUSED_AS_BUSY)),
    ("4/15", "fail", STOPPED.format(own="") + "+1.5\n" + REFUSED_AS_BUSY),
    ("4/15", "none", STOPPED.format(own="") + "+0.5\n" + REFUSED_AS_BUSY),  # it settles (A-4-9)
    ("4/15", "none", STOPPED.format(own="") + "+9\n" + REFUSED_AS_BUSY),
    ("4.17/6", "pass", STOPPED_AND_BUSY.replace("status 01", "status 00").format(pause=1, then="")),
    (
        "4/7",
        "tolerated A-5-17=status",
        DONE.replace("reset", "lock_joints").format(
            result="11", pause="> upload_name a\n< upload_name 1\n+0.2", status="01"
        ),
    ),
    # After a stop or a reset the robot may settle for a second (A-4-9).
    (
        "4/7",
        "tolerated A-4-9=settles",
        DONE.format(result="11", pause="+0.2", status="03"),
    ),
    (
        "4/7",
        "fail",
        DONE.replace("reset", "lock_joints").format(result="11", pause="+0.2", status="04"),
    ),
    ("4/7", "none", DONE.format(result="11", pause="", status="12")),
    ("4/7", "none", DONE.format(result="00|12", pause="", status="03")),
    ("4/7", "none", DONE.format(result="11", pause="+2", status="01")),
    ("4/7", "none", DONE_ELSEWHERE.format(pause="+0.05")),  # the frames may be in another order
    ("4/7", "fail", DONE_ELSEWHERE.format(pause="+0.2")),
    # Another client has started a program, and its first reply has not arrived yet.
    ("4/7", "none", BEGUN_ELSEWHERE.format(begun="2> run_program a", then="2< run_program 1")),
    ("4/7", "fail", BEGUN_ELSEWHERE.format(begun="2> get_time", then="2< get_time 20260101000000")),
    ("4.18/6", "pass", FAULT.format(status="12", reply="1")),
    ("4.18/6", "tolerated reset_from_error=idle-only", FAULT.format(status="12", reply="0|12")),
    ("4.18/6", "none", FAULT.format(status="00", reply="0|12")),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_busy(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
