"""Settings and clock: 4.1 to 4.8 and 4.19 to 4.22."""

from typing import Any

import pytest

from scaraspec.protocol.transfer import FILE_DATA, Chunk
from scaraspec.virtual_controller.store import StoreError

_HOME = b"200|300|324|34.6|34.5|0"


def test_a_new_password_is_used_from_the_next_login(bench: Any) -> None:
    """Requirement 4.2/4; a client stays logged in (A-4.2-2)."""
    client = bench.client()
    assert client.ask("set_password", b"password|secret") == b"1"
    assert client.ask("get_status") == b"00"
    assert bench.guest().ask("login", b"password") == b"0"
    assert bench.guest().ask("login", b"secret") == b"1"


@pytest.mark.parametrize(
    "pair",
    [
        b"",
        b"wrong|secret",
        b"password",
        b"password|",
        b"|secret",
        b"password|a|b",
        b"password secret",
        b"password|" + b"x" * 128,
    ],
)
def test_a_refused_change_keeps_the_password(bench: Any, pair: bytes) -> None:
    """The old password is still valid (4.2/3, 4.2/5, 4.2/6)."""
    assert bench.client().ask("set_password", pair) == b"0"
    assert bench.guest().ask("login", b"password") == b"1"


@pytest.mark.parametrize(
    ("encoding", "accepted"), [("ascii", b"0"), ("utf-8", b"1"), ("gb18030", b"1"), ("bytes", b"1")]
)
def test_how_text_is_encoded_is_a_reading(bench_of: Any, encoding: str, accepted: bytes) -> None:
    """A-T-2: text that is invalid in that encoding is refused."""
    client = bench_of(text_encoding=encoding).client()
    assert client.ask("upload_name", "程序".encode()) == accepted
    assert client.ask("set_password", b"password|\xff") == (b"1" if encoding == "bytes" else b"0")


def test_the_network_is_stored_and_reported(bench: Any) -> None:
    """Requirement 4.4/4; each text has its own length, not the printed one (L153, A-4.3-1)."""
    client = bench.client()
    assert client.ask("get_network") == b"192.168.1.2|255.255.255.0|192.168.1.1"
    assert client.ask("set_network", b"10.0.0.9|255.0.0.0|10.0.0.1") == b"1"
    assert client.ask("get_network") == b"10.0.0.9|255.0.0.0|10.0.0.1"


@pytest.mark.parametrize("network", [b"999.1.1.1|255.0.0.0|10.0.0.1", b"10.0.0.9", b"", b"a|b|c"])
def test_an_impossible_network_is_refused(bench: Any, network: bytes) -> None:
    """An invalid address is refused and not stored (4.4/5)."""
    client = bench.client()
    assert client.ask("set_network", network) == b"0"
    assert client.ask("get_network") == b"192.168.1.2|255.255.255.0|192.168.1.1"


def test_the_clock_runs_after_it_was_set(bench: Any) -> None:
    """The reported time is the set time plus the time since (4.5/4, 4.6/4)."""
    client = bench.client()
    assert client.ask("get_time") == b"20141222143000"
    bench.pass_s(61.5)
    assert client.ask("get_time") == b"20141222143101"
    assert client.ask("set_time", b"20240228235959") == b"1"
    bench.pass_s(1.0)
    assert client.ask("get_time") == b"20240229000000"


@pytest.mark.parametrize("time", [b"20141332250000", b"2014122214300", b"", b"2014122214300x"])
def test_an_impossible_time_is_refused(bench: Any, time: bytes) -> None:
    """An invalid time is refused (4.5/5)."""
    client = bench.client()
    assert client.ask("set_time", time) == b"0"
    assert client.ask("get_time") == b"20141222143000"


def test_the_clock_can_be_set_while_a_program_runs(bench: Any) -> None:
    """A busy robot accepts a new time (A-4.5-2)."""
    bench.store_program(b"p")
    client = bench.client()
    client.ask("run_program", b"p")
    assert client.ask("set_time", b"20200101000000") == b"1"
    assert client.result("run_program") == b"11"


def test_setting_the_gripper_center_moves_nothing(bench: Any) -> None:
    """The center is stored, and the arm does not move (4.20/3, 4.20/5)."""
    client = bench.client()
    before = client.where()
    assert client.ask("set_gripper_center", b"-1.5|0|456.7") == b"1"
    assert client.ask("get_gripper_center") == b"-1.5|0|456.7"
    assert client.where() == before


@pytest.mark.parametrize(
    "point", [b"1|2", b"1|2|3|4", b"1|2|x", b"1|2|", b"1|2|3|", b"1,5|2|3", b"1|2|1e3"]
)
@pytest.mark.parametrize("command", ["set_gripper_center", "set_initial_tool_position"])
def test_malformed_coordinates_are_refused(bench: Any, command: str, point: bytes) -> None:
    """A wrong number of fields or an invalid number is refused (4.20/4, 4.21/4)."""
    client = bench.client()
    assert client.ask(command, point) == b"0"
    assert client.ask("get_gripper_center") == b"0|0|0"
    assert client.ask("get_initial_tool_position") == b"300|0|250|0|0|0"


def test_huge_coordinates_are_refused(bench: Any) -> None:
    """A number that no reply could contain is refused."""
    client = bench.client()
    huge = b"9" * 250
    assert client.ask("set_gripper_center", huge + b"|0|0") == b"0"
    assert client.ask("set_initial_tool_position", b"200|300|324|0|" + huge[:200] + b"|0") == b"0"
    assert client.ask("set_tool_coordinates", b"10|200|300|" + huge[:200] + b"|0|0|0") == b"0|05"


def test_the_initial_tool_position_is_stored(bench: Any) -> None:
    """Requirements 4.21/3 and 4.21/5: thetaY and thetaZ are kept (A-4.21-3)."""
    client = bench.client()
    before = client.where()
    assert client.ask("set_initial_tool_position", _HOME) == b"1"
    assert client.ask("get_initial_tool_position") == _HOME
    assert client.ask("get_gripper_center") == b"0|0|0"
    assert client.where() == before


def test_an_initial_position_out_of_reach_is_refused(bench: Any) -> None:
    """A-4.21-2: a reset must be able to reach it."""
    assert bench.client().ask("set_initial_tool_position", b"900|0|250|0|0|0") == b"0"


def test_the_meaningless_angles_are_a_reading(bench_of: Any) -> None:
    """A-4.21-3: ignored and reported as 0, or refused unless 0."""
    client = bench_of(theta_yz="zero").client()
    assert client.ask("set_initial_tool_position", _HOME) == b"1"
    assert client.ask("get_initial_tool_position") == b"200|300|324|34.6|0|0"
    client = bench_of(theta_yz="reject").client()
    assert client.ask("set_initial_tool_position", _HOME) == b"0"
    assert client.ask("set_tool_coordinates", b"60|" + _HOME) == b"0|05"
    assert client.ask("set_initial_tool_position", b"200|300|324|34.6|0|0") == b"1"


def test_nothing_is_configured_while_a_command_executes(bench: Any) -> None:
    """A busy robot refuses settings (A-4.20-1)."""
    bench.store_program(b"p")
    client = bench.client()
    client.ask("run_program", b"p")
    assert client.ask("set_gripper_center", b"1|2|3") == b"0"
    assert client.ask("set_initial_tool_position", _HOME) == b"0"


def test_settings_are_refused_if_the_disk_is_full(bench: Any) -> None:
    """A-5-21: settings are stored in a file, too."""
    bench.plant.disk_full = True
    client = bench.client()
    assert client.ask("set_password", b"password|secret") == b"0"
    assert client.ask("set_network", b"10.0.0.9|255.0.0.0|10.0.0.1") == b"0"
    assert client.ask("set_gripper_center", b"1|2|3") == b"0"
    bench.plant.disk_full = False
    assert client.ask("set_gripper_center", b"1|2|3") == b"1"


def test_changes_are_refused_if_the_disk_fails(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A-5-21: settings, the last chunk of a file, and a deletion; the stored data does not
    change."""

    def fail(*_: object) -> None:
        raise StoreError("the disk failed")

    bench.store.write(b"old", b"x")
    client = bench.client()
    assert client.ask("upload_name", b"new") == b"1"
    for method in ("save", "write", "delete"):
        monkeypatch.setattr(bench.store, method, fail)
    chunk = FILE_DATA.encode(Chunk(1, 0, 1, b"x"))
    assert client.ask("upload_chunk", chunk) == b"0"
    assert client.ask("set_password", b"password|secret") == b"0"
    assert client.ask("delete_program", b"old") == b"0"
    assert client.ask("list_programs") == b"0|old"


def test_the_form_of_replies_is_a_reading(bench_of: Any) -> None:
    """A-T-3 and A-T-5: a NUL in the length, exactly one decimal."""
    guest = bench_of(trailing_nul="yes").guest()
    assert guest.ask("login", b"password") == b"1\0"
    client = bench_of(num_format="one-decimal").client()
    assert client.ask("get_gripper_center") == b"0.0|0.0|0.0"


def test_a_trailing_nul_is_accepted(bench: Any) -> None:
    """A-T-3: a request with a NUL in its length is accepted."""
    client = bench.guest()
    assert client.ask("login", b"password\0") == b"1"
    assert client.ask("set_gripper_center", b"1|2|3\0") == b"1"
