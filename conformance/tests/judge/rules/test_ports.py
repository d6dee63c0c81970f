"""Digital outputs: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

NONE = "0" * 16
READ = "> get_digital_outputs\n< get_digital_outputs 1|{}"
SET = "> set_digital_output {}\n< set_digital_output {}"
SECOND = "2> login password\n2< login 1"
ELSEWHERE = "2> set_digital_output 8|1\n2< set_digital_output 1"
ANSWER = f"< get_digital_outputs 1|{NONE}"
SWITCHED_OFF = "< rst\n> open\nlogin"
PROGRAM = "> run_program a\n< run_program 1\n<90 run_program 11"


def bits(*ports: int) -> str:
    """The data of 0x49 in which these ports are on."""
    return "".join("1" if port in ports else "0" for port in range(16, 0, -1))


def session(*lines: str) -> str:
    """A login, then these lines."""
    return "\n".join(("login", *lines))


def read(*ports: int) -> str:
    """A query with 0x49."""
    return READ.format(bits(*ports))


def put(port: int, value: int, reply: str = "1") -> str:
    """A port set with 0x43."""
    return SET.format(f"{port}|{value}", reply)


CASES = (
    ("4.32/2", "pass", session(put(8, 0))),
    ("4.32/2", "fail", session(put(8, 2))),
    ("4.32/3", "pass", session(put(16, 0))),
    ("4.32/3", "tolerated 4.32/3=observed otherwise", session(put(17, 0))),
    ("4.32/4", "pass", session(read(), put(8, 1, reply="0"), read())),
    ("4.32/4", "fail", session(read(), put(8, 1, reply="0"), read(8))),
    ("4.32/4", "pass", session(read(), put(8, 1, reply="0"), PROGRAM, read(8))),
    ("4.32/4", "pass", session(read(), put(8, 1, reply="0"), "+90", read(8))),
    ("4.32/4", "pass", session(read(), put(8, 1, reply="0"), put(8, 1), read(8))),
    ("4.32/4", "pass", session(read(), put(8, 1, reply="0"), read(7))),
    ("4.32/6", "pass", session(read(), put(8, 1), read(8))),
    ("4.32/6", "pass", session(read(8, 2), put(8, 0), put(3, 1), read(2, 3))),
    ("4.32/6", "pass", session(put(8, 1), read(8, 3))),
    ("4.32/6", "fail", session(put(8, 1), read())),
    ("4.32/6", "fail", session(read(8), put(8, 0), read(8))),
    ("4.32/6", "fail", session(read(), put(8, 1), read(8, 3))),
    ("4.32/6", "fail", session(read(2), put(8, 0), read())),
    ("4.32/6", "none", session(put(8, 1, reply="0"), read())),
    ("4.32/6", "none", session(put(8, 1), PROGRAM, read())),
    ("4.32/6", "pass", session(read(), PROGRAM, put(8, 1), read(8, 3))),
    # A client that was not recorded may have set another port since.
    ("4.32/6", "pass", session(read(), put(8, 1), "+90", read(8, 3))),
    # A setting by another client during the query may have come before or after it.
    ("4.32/6", "pass", session(SECOND, "> get_digital_outputs", ELSEWHERE, ANSWER, read(8))),
    ("4.32/6", "none", session(put(20, 1), read())),
    # The robot has closed all connections, perhaps because it was switched off (A-4-6).
    ("4.32/6", "none", session(put(8, 1), SWITCHED_OFF, read())),
    ("4.32/6", "pass", session(read(3), SWITCHED_OFF, put(8, 1), read(8))),
    ("4.34/3", "pass", session(read(), put(16, 1), read(16))),
    ("4.34/3", "fail", session(read(), put(16, 1), read(1))),
    ("4.34/3", "fail", session(put(3, 1), read(14))),
    ("4.34/3", "none 4.32/6", session(read(16), put(16, 1), read(16, 1))),
    ("4.34/3", "none", session(put(3, 1, reply="0"), read(14))),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_ports(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
