"""Clause 3: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

QUERY = """
    login
    > get_status
    < get_status 00
"""
RUN = """
    login
    > run_program a.rob
    < run_program 1
    <90 run_program 11
"""
LONG_NAME = "6E" * 300  # with the length byte 300 - 256

PIPELINED = """
    login
    {asked}
    < get_time 20260101000000
    > get_version
    < get_version 1.0.0
    +6
    > close
"""
PAUSED = """
    login
    > =AA
    +{pause}
    > =07 00 CC
    > get_status
    < get_status 00
    +6
    > close
"""
LATE_CHUNK = """
    login
    > upload_name a.rob
    < upload_name 1
    +{pause}
    > chunk 0/300
    > get_status
    < get_status 00
    +31
    > get_status
    < get_status 00
"""

HALF = """
    login
    > = AA 0D 0A 00 CC
    +3
    > list_programs
    {answered}
    > get_version
    < get_version 1.0.0
    +6
    > get_status
    < get_status 00
    > get_status
    < get_status 00
"""
LATE_REST = """
    login
    > = AA 30 05 61
    +3
    > = AA 2E 72 CC CC
    < run_program 1
    <90 run_program 11
"""
IN_TIME = HALF.format(answered="< list_programs 0|a.rob")
NEVER_ANSWERED = HALF.format(answered="")

LEFT = """
    login
    > run_program a
    < run_program 1
    > close
    2> login password
    2< login 1
"""
TWO_CLIENTS = "login\n2> login password\n2< login 1\n"
RESET_OF_ANOTHER = TWO_CLIENTS + "2> reset\n2< reset 1\n2<90 reset 11\n"

LATER = """
    2> get_time
    2< get_time 20260101000000
    +11
    2> get_time
    2< get_time 20260101000011
"""

CASES = (
    ("3/1", "pass", QUERY),
    ("3/1", "fail", "login\n> = AA 09 05 01 02 03 04 05 06 07\n> get_status\n< get_status 00"),
    ("3/1", "inconclusive", "> gap\n> = AA 09 05 01 02 03 04 05 06 07\n> get_status"),
    ("3/2", "pass", QUERY),
    ("3/2", "fail", "login\n> = AB 09 00 CC\n> get_status\n< get_status 00"),
    ("3/2", "fail", "login\n> = CC 09 00 AA\n< get_status 00"),
    # "AA AA 09 .. CC" would be a frame of 13 bytes with the opcode AA.
    ("3/2", "fail", "login\n> = CC 09 00 AA" + "\n> get_status\n< get_status 00" * 3),
    ("3/3", "pass", QUERY),
    ("3/3", "fail", "login\n> = AA 09 00 CD\n> get_status\n< get_status 00"),
    ("3/4", "pass", QUERY),
    ("3/4", "fail", "login\n> get_status\n< = AB 09 02 30 30 AA\n< get_status 00"),
    ("3/4", "fail", "login\n> get_status\n< = AA 09 02 30 30 CC\n< get_status 00"),
    ("3/5", "pass", QUERY),
    ("3/5", "fail", "login\n> get_status\n< = CC 09 02 30 30 BB\n> get_time"),
    ("3/5", "fail", "login\n> get_status\n< = CC 09 02 30 30 CC\n> get_time"),
    ("3/5", "fail", "login\n> reset\n< reset 1\n< = CC 90 33 02 31 31 BB\n> get_time"),
    # "CC CC 09 .. AA" after it would be a frame of 13 bytes with the opcode CC.
    (
        "3/5",
        "fail",
        "login\n> get_version\n< = CC 08 01 31 CC" + "\n> get_status\n< get_status 00" * 3,
    ),
    ("3/6", "pass", QUERY),
    ("3/6", "fail 3/7", "login\n> get_status\n< = CC 09 01 30 30 AA\n> get_time"),
    ("3/7", "pass", QUERY),
    (
        "3/7",
        "fail 3/6",
        "login\n> get_status\n< = CC 09 03 30 30 AA\n> get_time\n< get_time 20260101000000",
    ),
    (
        "3/7",
        "fail 3/6 4.18/5",
        "login\n> reset\n< reset 1\n< = CC 90 33 04 30 30 7C 31 31 AA\n> get_time",
    ),
    # No frame end follows: the length is one that the document prints (L450).
    (
        "3/7",
        "fail 3/6 4.21/6",
        "login\n> = AA 36 19 32 30 30 7C 33 30 30 7C 33 32 34 7C 33 34 7C 33 34 7C 30 CC",
    ),
    # No frame end follows: the length is that of the whole frame, so that the login is never
    # answered.
    ("3/7", "fail 3/6", "> = AA 01 0C 70 61 73 73 77 6F 72 64 CC\n+5\n> close"),
    # A text contains no end byte; it ends the frame also if another length is declared.
    ("3/7", "fail 3/6", "> = AA 01 0D 70 61 73 73 77 6F 72 64 CC\n+5\n> close"),
    ("3/7", "fail 3/6", "login\n> get_status\n< = CC 09 FF 30 30 AA CC 07 FF 31 AA"),
    ("3/7", "pass", "login\n> = AA 30 0D 61 62\n> close"),
    ("3/7", "pass", "login\n> = AA 30 0D 61 62 CC 00\n> close"),
    ("3/7", "pass", "login\n> = AA 52 D4 00 01 CC\n> close"),
    ("3/7", "inconclusive", "> gap\n> = AA 01 0C 70 61 73 73 77 6F 72 64 CC\n> close"),
    ("3/8", "pass", QUERY),
    ("3/8", "fail 3/6 3/7", "login\n> = AA 09 00 30 CC\n> get_status\n< get_status 00"),
    ("3/10", "pass", QUERY),
    ("3/10", "pass", "login\n> 13\n< 13 a.rob"),
    ("3/10", "fail", "login\n> 3E\n> get_status\n< get_status 00"),
    ("3/10", "fail", "login\n> get_status\n< get_status 00\n< 77 1"),
    ("3/10", "inconclusive", "> gap\n> =CC\n> get_time\n> 77"),
    ("3/11", "pass", QUERY),
    ("3/11", "pass", "login\n> get_motor_temperatures\n< 0E 20|38|34|22"),
    ("3/11", "pass 4.12/2", "login\n> get_default_program\n< 13 a.rob"),
    # The heartbeat of 0x09 is unsolicited (A-3-16); the request has its own reply.
    ("3/11", "pass", "login\n> get_time\n< get_status 00\n< get_time 20260101000000"),
    (
        "3/11",
        "fail",
        "login\n> get_time\n< 08 20260101000000\n> get_status\n< get_status 00\n+6\n> get_status",
    ),
    (
        "3/11",
        "inconclusive",
        "login\n> gap 4\n> get_time\n< 08 1\n> get_status\n< get_status 00\n+11\n> get_status",
    ),
    ("3/12", "pass", RUN),
    ("3/12", "fail 4.15/5", "login\n> run_program a.rob\n< run_program 1\n< run_program 11"),
    ("3/14", "pass", RUN),
    ("3/14", "tolerated A-3-6=90 09", "login\n> get_status\n< get_status 00\n<90 09 00"),
    ("3/15", "pass", QUERY),
    ("3/15", "fail", "login\n> 90\n> get_status\n< get_status 00"),
    ("3/15", "fail", "login\n> = AA 90 30 02 31 31 CC\n> get_status\n< get_status 00"),
    ("3/16", "pass", RUN),
    ("3/16", "fail", "login\n> run_program a.rob\n<90 run_program 11\n< run_program 1"),
    ("3/16", "fail", "login\n<90 run_program 11"),
    ("3/16", "inconclusive", "login\n> gap 10\n<90 run_program 11"),
    (
        "3/16",
        "tolerated A-2-9=elsewhere",
        """
        login
        2> login password
        2< login 1
        > run_program a.rob
        < run_program 1
        <90 run_program 11
        2<90 run_program 11
        """,
    ),
    ("3/17", "pass", "login\n> run_program a.rob\n< run_program 0|20"),
    ("3/17", "fail", "login\n> run_program a.rob\n< run_program 0|20\n<90 run_program 00|20"),
    # The earlier reset of the other client has its result: a later one belongs to no command.
    ("3/17", "fail", RESET_OF_ANOTHER + "+2\n> reset\n< reset 0|01\n<90 reset 11"),
    ("3/16", "fail", RESET_OF_ANOTHER + "+2\n2> reset\n2< reset 0|01\n<90 reset 11"),
    # It may be a copy of the result that the other client has got.
    ("3/16", "tolerated A-2-9=elsewhere", RESET_OF_ANOTHER + "<90 reset 11"),
    (
        "3/17",
        "inconclusive",
        "login\n> run_program a\n< run_program 0|20\n> gap 9\n<90 run_program 00|20",
    ),
    ("3/18", "pass", RUN),
    ("3/18", "fail", RUN + "<90 run_program 11"),
    # The run of the other connection had ended before this one was accepted.
    (
        "3/18",
        "fail",
        """
        2> login password
        2< login 1
        2> run_program a.rob
        2< run_program 1
        2<90 run_program 11
        """
        + RUN
        + "<90 run_program 11",
    ),
    (
        "3/18",
        "fail 4.15/5",
        """
        login
        > run_program a.rob
        < run_program 1
        > get_status
        < get_status 00
        > reset
        < reset 1
        <90 reset 11
        """,
    ),
    (
        "3/18",
        "fail 4.18/4",
        "login\n> reset\n< reset 1\n> get_status\n< get_status 00\n+6\n> close",
    ),
    ("3/18", "inconclusive", "login\n> reset\n< reset 1\n< gap 7\n> get_status\n< get_status 00"),
    # The connection was closed or the robot shut down before the final result: no verdict.
    ("3/18", "none", "login\n> reset\n< reset 1\n> close"),
    (
        "3/18",
        "tolerated estop_interrupted=none",
        """
        login
        > run_program a.rob
        < run_program 1
        > emergency_stop
        < emergency_stop 1
        <90 emergency_stop 11
        > reset
        < reset 1
        """,
    ),
    (
        "3/18",
        "tolerated A-4.28-5=replace",
        """
        login
        > jog 1
        < jog 1
        > jog 2
        < jog 1
        <90 jog 11
        > reset
        < reset 1
        """,
    ),
    ("3/24", "pass", "login\n> get_time\n> get_status\n< get_time 20260101000000\n< get_status 00"),
    # A request that is never answered is not overtaken.
    ("3/24", "pass 3/10", "login\n> 77\n> get_status\n< get_status 00"),
    (
        "3/24",
        "tolerated pipelining=any-order",
        "login\n> get_time\n> get_status\n< get_status 00\n< get_time 20260101000000",
    ),
    ("3/25", "pass", QUERY),
    (
        "3/25",
        "tolerated A-3-14=two open requests",
        "login\n> get_status\n> get_status\n< get_status 00\n< get_status 00",
    ),
    # After the reply time a repetition is a new attempt.
    ("3/25", "pass 3/31", "login\n> get_status\n+6\n> get_status\n< get_status 00\n> close"),
    ("3/26", "pass", QUERY),
    ("3/26", "tolerated A-3-16=unsolicited frame", QUERY + "< get_status 00"),
    ("3/26", "inconclusive", "> gap\n< get_status 00"),
    ("3/28", "pass", QUERY),
    (
        "3/28",
        "fail 3/6 3/7",
        f"login\n> = AA 30 2C {LONG_NAME} CC\n> get_status\n< get_status 00",
    ),
    # The announced bytes never come, but another request does: the controller answers after 2 s.
    ("3/7", "fail 3/6", IN_TIME),
    ("3/26", "pass 3/6 3/7", IN_TIME),
    ("3/31", "pass 3/32", "login\n> = AA\n+3\n> get_time\n< get_time 20260101000000"),
    ("3/31", "pass", "login\n> = AA 09\n+3\n> = 00 CC\n< get_status 00"),
    ("3/31", "pass", LATE_REST),
    ("3/31", "pass 3/6 3/7", IN_TIME),
    # A controller that waits longer takes it for the rest (A-3-11).
    ("3/31", "inconclusive 3/6 3/7", NEVER_ANSWERED),
    ("3/31", "pass", QUERY),
    ("3/31", "pass", "login\n> get_time\n+6\n< get_time 20260101000000"),
    # Before the login a controller may refuse by silence (A-4-4).
    ("3/31", "none 2/10", "> get_time\n> get_status\n+20\n> get_status"),
    (
        "3/31",
        "fail",
        "login\n> get_time\n> get_status\n< get_status 00\n+6\n> get_status\n< get_status 00",
    ),
    ("3/31", "fail", "login\n> get_time\n> get_status\n< get_status 00\n+6\n> close"),
    (
        "3/31",
        "fail",
        "login\n> get_time\n> get_status\n< get_status 00\n+6\n< get_time 20260101000000",
    ),
    # The second reply overtakes the first one and is itself too late.
    (
        "3/31",
        "fail",
        "login\n> get_time\n> get_status\n+6\n< get_status 00\n< get_time 20260101000000",
    ),
    # Requested again after the reply time, but answered once: one of the two was not answered.
    ("3/31", "fail", "login\n> get_time\n+6\n> get_time\n< get_time 20260101000000\n+11\n> close"),
    ("3/31", "pass", "login\n> get_time\n> get_status\n< get_status 00\n> close"),
    # A robot that serves one request at a time drops others while one is open (A-3-14) ...
    ("3/31", "tolerated pipelining=one", PIPELINED.format(asked="> get_time\n> get_status")),
    # ... but only until the reply is due, and not if both came in one segment (2/6).
    ("3/31", "fail", PIPELINED.format(asked="> get_time\n+6\n> get_status")),
    ("3/31", "fail", PIPELINED.format(asked="> = AA 07 00 CC AA 09 00 CC")),
    # It is open whether port 17 exists (A-4.32-2), and also the reply if it does not.
    (
        "3/31",
        "tolerated A-3-9=ignored",
        "login\n> set_digital_output 17|1\n+6\n> get_status\n< get_status 00\n> close",
    ),
    ("3/31", "inconclusive", "login\n> get_time\n+6\n> close"),
    # A client may abort an upload after 30 s of silence, and then a late chunk is ignored (A-5-16).
    ("3/31", "fail", LATE_CHUNK.format(pause=20)),
    ("3/31", "pass", LATE_CHUNK.format(pause=40)),
    # A request may be dropped after a pause of more than a second (A-3-11).
    ("3/31", "fail", PAUSED.format(pause=0.9)),
    ("3/31", "inconclusive", PAUSED.format(pause=1.1)),
    # A robot that shuts down or changes its address answers no further requests.
    ("3/31", "pass", "login\n> shutdown\n< shutdown 1\n> get_time\n+6\n> close"),
    ("3/31", "inconclusive", "login\n> get_time\n< gap 18\n> get_status\n< get_status 00"),
    (
        "3/31",
        "tolerated busy_reply=silence",
        RUN.replace(
            "<90", "> reset\n> get_status\n< get_status 01\n+11\n> get_status\n< get_status 01\n<90"
        ),
    ),
    # The client that started the program has disconnected, so that no final result follows.
    ("3/31", "tolerated busy_reply=silence", LEFT + "2> reset" + LATER),
    # No recorded client started the program that the robot reports (A-4.12-3).
    (
        "3/31",
        "tolerated busy_reply=silence",
        TWO_CLIENTS + "> get_status\n< get_status 01\n2> reset" + LATER,
    ),
    (
        "3/31",
        "tolerated busy_reply=silence",
        TWO_CLIENTS + "2> reset\n> get_status\n< get_status 01" + LATER,
    ),
    ("3/31", "fail", LEFT + "2> get_status\n2< get_status 00\n2> reset" + LATER),
    # Another client started a program first; its first reply came later.
    (
        "3/31",
        "tolerated busy_reply=silence",
        TWO_CLIENTS + "> run_program a\n2> reset\n< run_program 1" + LATER,
    ),
    (
        "3/31",
        "fail",
        TWO_CLIENTS + "> run_program a\n2> reset\n< run_program 0|05" + LATER,
    ),
    (
        "3/31",
        "tolerated A-4-3=not served",
        RUN.replace(
            "<90",
            "> get_time\n> get_status\n< get_status 01\n+11\n> get_status\n< get_status 01\n<90",
        ),
    ),
    (
        "3/31",
        "tolerated op_get_default=0x13",
        "login\n> get_default_program\n> 13\n< 13 a.rob\n+11\n> get_status\n< get_status 00",
    ),
    (
        "3/31",
        "tolerated default_none=silence",
        "login\n> get_default_program\n> get_status\n< get_status 00\n+11\n> get_status",
    ),
    (
        "3/31",
        "tolerated jog_byte=binary",
        "login\n> jog 1\n> get_status\n< get_status 00\n+11\n> get_status\n< get_status 00",
    ),
    # The controller accepts this notation of the command.
    (
        "3/31",
        "fail",
        "login\n> jog 1\n< jog 0|05\n> jog 2\n> get_status\n< get_status 00\n+11\n> close",
    ),
    ("3/32", "pass", QUERY),
    ("3/32", "fail", "login\n> = 00\n> get_status\n< get_status 00"),
    (
        "3/32",
        "fail",
        "login\n> get_status\n< = CC\n< get_status 00\n> get_time\n< get_time 20260101000000",
    ),
    ("3/32", "inconclusive", "> gap\n> = 00 00\n> get_status"),
    # Another kind of program connects to the port, and may get a reply in its own protocol.
    ("3/32", "none", f"> = {b'GET / HTTP/1.1'.hex()}\n< = {b'HTTP/1.1 400'.hex()}"),
    ("3/32", "none", f"> = {b'SSH-2.0-x'.hex()}\n< close"),
    ("3/32", "fail", "> = 68 65 6C 6C 6F\n< close"),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_clause_3(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
