"""Clause 2: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

CASES = (
    ("2/1", "pass", "login"),
    ("2/1", "fail", "< open"),
    # An observer that starts later does not see the connection opened.
    ("2/1", "none", "> gap\n> get_status"),
    ("2/3", "pass", "> open 192.0.2.1:50000 → 192.0.2.2:8877"),
    ("2/3", "none", "> open 192.0.2.1:50000 → 192.0.2.2:18877"),
    ("2/3", "none", "> open 192.0.2.1:8877 → 192.0.2.2:88770"),
    ("2/4", "pass", "login"),
    ("2/4", "fail 3/32", "> = 16 03 01 02 00 01 00 01 FC 03 03"),
    ("2/4", "fail 3/32", "< = 1F 8B 08 00 00 00 00 00 00 03"),
    # In the middle of a stream the same bytes are ordinary stray bytes.
    ("2/4", "pass 3/32", "login\n> = 16 03 01 02\n> get_status\n< get_status 00"),
    ("2/10", "pass", "login\n> get_status\n< get_status 00"),
    ("2/10", "fail", "> get_status\n< get_status 00"),
    ("2/10", "fail", "> get_status\n+20\n> close"),
    ("2/10", "none", "> gap\n> get_status\n< get_status 00"),
    ("2/10", "none", "> emergency_stop\n< emergency_stop 0"),
    # After a refused login the violation is of 4.1/5.
    ("2/10", "none 4.1/5", "> login x\n< login 0\n> get_status"),
    # The login was sent first; its reply is on the way.
    ("2/10", "pass", "> login password\n> get_status\n< login 1\n< get_status 00"),
    (
        "2/10",
        "pass",
        "> open\n> login password\n2> gap\n2> get_time\n+1\n> get_status\n< get_status 00",
    ),
    ("2/11", "pass 2/10", "> reset\n+20\n> close"),
    ("2/11", "pass 2/10", "> reset\n< rst"),
    ("2/11", "pass 2/10", "> reset\n< reset 0|06"),
    ("2/11", "pass 2/10", "> jog 1\n< jog 0"),  # the form of such a refusal is open
    ("2/11", "pass 2/10", "> set_time 20260101000000\n< set_time 0"),
    ("2/11", "pass 2/10", "> get_running_program\n< get_running_program 0"),
    ("2/11", "fail 2/10", "> reset\n< reset 1\n<90 reset 11"),
    ("2/11", "fail 2/10", "> delete_program a.rob\n< delete_program 1"),
    ("2/11", "fail 4.1/5", "> login x\n< login 0\n> delete_program a.rob\n< delete_program 1"),
    ("2/11", "none", "login\n> reset\n< reset 1\n<90 reset 11"),
    ("2/11", "tolerated A-4-4=stop served", "> emergency_stop\n< emergency_stop 1"),
    # The request is answered after the login succeeded.
    (
        "2/11",
        "none",
        "> login password\n> set_time 20260101000000\n< login 1\n< set_time 1",
    ),
)


PASSES_ONLY = {"2/3": "to another port the user may have sent the client"}


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_clause_2(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)


def test_reading_without_a_login_is_tolerated(judged: Callable) -> None:
    """The controller may serve queries (A-4-4), though the client should not send them (2/10)."""
    record = judged("> get_status\n< get_status 00")
    (finding,) = [f for f in record.findings if f.requirement == "2/11"]
    assert finding.reading == ("prelogin", "reads")


def test_a_serial_link_needs_no_login(judged: Callable) -> None:
    """A serial link permits every request without a login (L83)."""
    session = "> delete_program a.rob\n< delete_program 1"
    assert not judged(session, needs_login=False).failed
