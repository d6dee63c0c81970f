"""The history: limited memory, certain exchanges only, and since when the robot is idle."""

from collections.abc import Callable

import pytest

from scaraspec.traffic.exchange_history import KEPT_EXCHANGES, ExchangeHistory

STATUS = "> get_status\n< get_status {}\n"
MOVE = "> reset\n< reset 1\n<90 reset 11\n"


@pytest.fixture
def memory_of(judged: Callable) -> Callable[[str], ExchangeHistory]:
    """Return the history after a session."""
    return lambda session: judged("login\n" + session).robot.history


def test_exchanges_are_found_by_time(judged: Callable) -> None:
    """The last exchange before a time, and those between two times."""
    record = judged("login\n" + STATUS.format("00") * 3)
    history = record.robot.history
    first, second, third = (x for x in record.exchanges if x.name == "get_status")
    assert history.last("get_status") is third
    assert history.last("get_status", before_ns=third.time_ns) is second
    assert history.last("get_status", before_ns=first.time_ns) is None
    assert list(history.between("get_status", first.time_ns, third.time_ns)) == [second]
    assert history.last("get_time") is None


def test_memory_is_bounded(memory_of: Callable[[str], ExchangeHistory]) -> None:
    """Memory has a limit for any length of a recording."""
    logins = "".join(f"> login {i}\n< login 1\n" for i in range(9))
    history = memory_of(
        STATUS.format("00") * (KEPT_EXCHANGES + 9) + MOVE * (KEPT_EXCHANGES + 9) + logins
    )
    assert len(history.recent["get_status"]) == KEPT_EXCHANGES
    assert len(history.accepted) == KEPT_EXCHANGES
    assert len(history.passwords) == 2


def test_no_file_is_kept(memory_of: Callable[[str], ExchangeHistory]) -> None:
    """Exchanges of transfers are kept without content; RobotState keeps files, with its own
    limit."""
    history = memory_of("> upload_name a\n< upload_name 1\n> chunk 0/9\n< upload_chunk 1\n")
    assert set(history.recent) == {"login"}
    assert set(history.last_requests) == {"login", "upload_name", "upload_chunk"}


def test_a_gap_empties_the_history(memory_of: Callable[[str], ExchangeHistory]) -> None:
    """What was known before a gap is uncertain after it."""
    history = memory_of(
        STATUS.format("00") + MOVE + "> delete_program a\n< delete_program 1\n> gap 5"
    )
    assert not history.recent
    assert not history.accepted
    assert not history.deleted
    assert not history.passwords
    assert history.idle_since_ns is None


@pytest.mark.parametrize(
    ("session", "since_ms"),
    [
        ("", None),
        (STATUS.format("00"), 5),
        (STATUS.format("00") * 3, 5),
        (STATUS.format("04"), None),
        (STATUS.format("00") + STATUS.format("12"), None),
        (MOVE, 6),
        (STATUS.format("00") + MOVE, 8),
        (STATUS.format("00") + "> reset\n< reset 1", None),
        # The end of the link releases the command, but it may continue.
        (MOVE + "> jog 1\n< jog 1\n> close", None),
        ("> jog 1\n< jog 1\n> emergency_stop\n< emergency_stop 1\n<90 emergency_stop 11", 8),
    ],
)
def test_idleness(
    session: str, since_ms: int | None, memory_of: Callable[[str], ExchangeHistory]
) -> None:
    """Only a final result or a status 00 shows that the robot is idle."""
    since_ns = memory_of(session).idle_since_ns
    assert since_ns == (None if since_ms is None else since_ms * 1_000_000)


def test_a_deletion_holds_until_the_next_upload(
    memory_of: Callable[[str], ExchangeHistory],
) -> None:
    """Even if it is unknown whether the upload succeeded."""
    deletion = "> delete_program a\n< delete_program 1\n"
    assert set(memory_of(deletion).deleted) == {b"a"}
    assert not memory_of(deletion + "> upload_name a").deleted
    assert not memory_of("> delete_program a\n< delete_program 0").deleted


def test_a_new_password_replaces_the_old(memory_of: Callable[[str], ExchangeHistory]) -> None:
    """The earlier password is not right any longer."""
    assert memory_of("").passwords == {b"password"}
    assert memory_of("> set_password password|new\n< set_password 1").passwords == {b"new"}
    assert memory_of("> set_password password|new\n< set_password 0").passwords == {b"password"}
    assert not memory_of("> set_password password|new\n> set_password x|y").passwords
