"""The state of the robot, shared by all connections: limited, and empty after a gap."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.traffic import robot_state as scene_module
from scaraspec.traffic.events import Transfer
from scaraspec.traffic.robot_state import RobotState

Judged = Callable[..., Any]


def stored(name: bytes, size: int) -> Transfer:
    """A complete upload."""
    return Transfer(upload=True, name=name, begun_ns=0, content=bytearray(size))


def test_files_are_kept_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """The oldest files are dropped, by bytes and by number; each name is kept once."""
    monkeypatch.setattr(scene_module, "FILES_LIMIT_BYTES", 100)
    monkeypatch.setattr(scene_module, "FILES_LIMIT", 3)
    robot = RobotState()
    for name, size in ((b"a", 60), (b"b", 30), (b"a", 50), (b"c", 30)):
        robot.stored(stored(name, size))
    assert list(robot.files) == [b"a", b"c"]
    robot.forget(b"a")
    robot.forget(b"a")
    for name in (b"d", b"e", b"f"):
        robot.stored(stored(name, 1))
    assert list(robot.files) == [b"d", b"e", b"f"]


def test_the_last_exchange_of_each_command_is_kept(judged: Judged) -> None:
    """For all connections, as soon as it is answered."""
    record = judged(
        "login\n2> login password\n2< login 1\n> get_status\n< get_status 00\n"
        "2> get_status\n2< get_status 01\n> get_status"
    )
    assert record.robot.last["get_status"].reply_value == "01"
    assert record.robot.last["get_status"].request.place.connection == "2"


def test_uncertain_exchanges_are_not_kept(judged: Judged) -> None:
    """A gap empties the state, and nothing is added until it is over."""
    asked = "> get_version\n< get_version 1.0.0\n"
    assert "get_version" not in judged(f"login\n{asked}> gap 3").robot.last
    assert "get_version" not in judged(f"login\n> gap 3\n{asked}").robot.last
    assert "get_version" in judged(f"login\n> gap 3\n{asked}+6\n{asked * 2}").robot.last


def test_setting_a_password_makes_it_uncertain(judged: Judged) -> None:
    """Even if there is no reply that would show whether it was set."""
    record = judged("login\n> set_password a|b")
    assert "login" not in record.robot.last


def test_a_deletion_request_makes_the_file_uncertain(judged: Judged) -> None:
    upload = "login\n> upload_name a\n< upload_name 1\n> chunk 0/9\n< upload_chunk 1\n"
    assert list(judged(upload).robot.files) == [b"a"]
    assert not judged(upload + "> delete_program a\n< delete_program 0").robot.files


def test_sessions_are_those_that_are_logged_in(judged: Judged, script: Callable) -> None:
    record = judged([])
    for event in script("login\n2> login a\n2< login 1\n3> login b\n3< login 0\n> close"):
        list(record.judge.feed(event))
    assert record.robot.sessions == {"2"}
