"""Connections, logins, and which client gets which frame."""

from typing import Any

import pytest

from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.hazard import Hazard
from scaraspec.transports.link import Ending

_MOVE = b"10|200|300|324|34.6|0|0"


def test_a_right_password_is_answered_1_and_a_wrong_one_0(bench: Any) -> None:
    """4.1 (L111-119), and a wrong attempt does not log out (A-4.1-2)."""
    client = bench.stranger()
    assert client.ask("login", b"wrong") == b"0"
    assert client.ask("get_status") is None
    assert client.ask("login", b"password") == b"1"
    assert client.ask("login", b"wrong") == b"0"
    assert client.ask("get_status") == b"00"


@pytest.mark.parametrize("password", [b"", b"|", b"pass|word", b"password|", b'"password"', b" "])
def test_a_malformed_password_is_a_wrong_one(bench: Any, password: bytes) -> None:
    """A-3-9: a known opcode that has a failure form is answered with it."""
    stranger = bench.stranger()
    assert stranger.ask("login", password) == b"0"
    assert stranger.ask("get_status") is None


def test_a_login_is_for_one_connection_only(bench: Any) -> None:
    """A-4.1-1: another connection that has not itself logged in is served nothing."""
    bench.client()
    assert bench.stranger().ask("get_status") is None


def test_before_the_login_nothing_is_answered_and_nothing_done(bench: Any) -> None:
    """A-4-4 (a): no command is served, whatever it does."""
    stranger = bench.stranger()
    for row in COMMANDS:
        if row.name != "login":
            assert stranger.ask(row.name, b"") is None
    assert bench.core.powered
    assert bench.client().ask("get_status") == b"00"


def test_before_the_login_failure_forms_can_be_a_reading(bench_of: Any) -> None:
    """A-4-4 (b): what has a failure form is answered with it, the rest with silence."""
    stranger = bench_of(prelogin="failure").stranger()
    assert stranger.ask("set_tool_coordinates", _MOVE) == b"0|05"
    assert stranger.ask("delete_program", b"a") == b"0"
    assert stranger.ask("upload_chunk", bytes(212)) == b"0"
    assert stranger.ask("get_analog_input", b"01") == b"0"
    assert stranger.ask("get_status") is None
    assert stranger.ask("download_chunk", b"1") is None


def test_before_the_login_closing_can_be_a_reading(bench_of: Any) -> None:
    """A-4-4 (c): any other request ends the connection."""
    stranger = bench_of(prelogin="close").stranger()
    assert stranger.ask("get_status") is None
    assert stranger.ending is Ending.CLOSED


@pytest.mark.parametrize("reading", ["reads", "all"])
def test_before_the_login_serving_can_be_a_reading(bench_of: Any, reading: str) -> None:
    """A-4-4 (d) and (e): read-only requests are served, or all of them."""
    stranger = bench_of(prelogin=reading).stranger()
    assert stranger.ask("get_status") == b"00"
    served = stranger.ask("set_time", b"20200101000000")
    assert served == (b"1" if reading == "all" else None)


def test_reads_serves_exactly_the_read_only_rows(bench_of: Any) -> None:
    """What the table calls read-only is what the reading means."""
    bench = bench_of(prelogin="reads", empty_file="name-only")
    bench.store.write(b"x", b"")
    for row in COMMANDS:
        if row.name in ("login", "download_chunk"):
            continue
        answered = bench.stranger().ask(row.name, {"get_analog_input": b"01"}.get(row.name, b"x"))
        assert (answered is not None) == (row.hazard is Hazard.READ_ONLY), row.name


def test_results_go_only_to_the_connection_that_asked(bench: Any) -> None:
    """A-2-2: of two clients each hears its own replies and results."""
    mover, watcher = bench.client(), bench.client()
    assert mover.ask("set_tool_coordinates", _MOVE) == b"1"
    assert watcher.ask("get_status") == b"04"
    assert watcher.hear(30.0) == []
    assert mover.hear() == [("*set_tool_coordinates", b"11")]


def test_a_result_whose_connection_is_gone_is_dropped(bench: Any) -> None:
    """A-2-8 and A-2-9: the move continues to its end, and its result is not sent."""
    mover = bench.client()
    mover.ask("set_tool_coordinates", _MOVE)
    mover.link.close()
    watcher = bench.client()
    assert watcher.ask("get_status") == b"04"
    assert watcher.hear(30.0) == []
    assert watcher.where()[:3] == [200, 300, 324]


def test_many_clients_are_served_by_default(bench: Any) -> None:
    """A-2-2 (b)."""
    clients = [bench.client() for _ in range(10)]
    assert [client.ask("get_status") for client in clients] == [b"00"] * 10


def test_one_client_can_be_a_reading(bench_of: Any) -> None:
    """A-2-2 (a): a second one is closed at once, until the first has gone."""
    bench = bench_of(max_clients="one")
    first, second = bench.client(), bench.stranger()
    assert (second.hear(), second.ending) == ([], Ending.CLOSED)
    assert first.ask("get_status") == b"00"
    first.link.close()
    assert bench.client().ask("get_status") == b"00"


def test_the_newest_client_can_displace_the_one_before(bench_of: Any) -> None:
    """A-2-2 (c)."""
    bench = bench_of(max_clients="newest")
    first, second = bench.client(), bench.client()
    assert first.hear() == []
    assert first.ending is Ending.CLOSED
    assert second.ask("get_status") == b"00"


def test_a_serial_client_needs_no_login(bench: Any) -> None:
    """使用蓝牙通信时不需要登录验证 (L83); one that logs in all the same is answered (A-2-5)."""
    client = bench.stranger("serial")
    assert client.ask("get_status") == b"00"
    assert client.ask("login", b"wrong") == b"0"
    assert client.ask("login", b"password") == b"1"


def test_a_serial_client_is_masked_while_a_network_client_is_connected(bench: Any) -> None:
    """L81 and A-2-4: its frames are dropped silently until the last TCP connection has closed."""
    serial = bench.stranger("serial")
    first, second = bench.stranger(), bench.stranger()
    assert serial.ask("get_status") is None
    first.link.close()
    assert serial.ask("get_status") is None
    second.link.close()
    assert serial.ask("get_status") == b"00"
    assert serial.hear(10.0) == []


def test_to_a_serial_client_masking_is_the_loss_of_its_link(bench: Any) -> None:
    """A masked client cannot stop its jog, so the jog stops; half a frame of it is forgotten."""
    serial = bench.stranger("serial")
    assert serial.ask("jog", b"1") == b"1"
    serial.link.send(b"\xaa\x09")
    network = bench.client()
    assert network.ask("get_status") == b"00"
    network.link.close()
    assert serial.hear(1.0) == []
    assert serial.ask("get_status") == b"00"


def test_a_serial_client_that_comes_second_is_masked_too(bench: Any) -> None:
    """Masking depends on who is connected, not on who came first."""
    bench.client()
    assert bench.stranger("serial").ask("get_status") is None


@pytest.mark.parametrize("opcode", [0x00, 0x02, 0x10, 0x3E, 0x41, 0x51, 0x90, 0xAA, 0xCC, 0xFF])
@pytest.mark.parametrize("reading", ["ignore", "0", "close"])
def test_unknown_opcodes(bench_of: Any, opcode: int, reading: str) -> None:
    """A-3-9: silence, the same opcode with 0, or the end; and the robot stays as it was."""
    bench = bench_of(on_unknown=reading)
    client = bench.client()
    client.link.send(bytes([0xAA, opcode, 0x01, 0x31, 0xCC]))
    answered = reading == "0" and opcode != 0x90  # which no controller can answer: it is the tag
    assert client.hear() == ([(f"0x{opcode:02X}", b"0")] if answered else [])
    assert (client.ending is Ending.CLOSED) == (reading == "close")
    assert bench.client().ask("get_status") == b"00"


def test_shutdown_answers_then_closes_everything(bench: Any) -> None:
    """4.35 (L696; A-4.35-2): 1, no tagged frame, the end, and no further client is accepted."""
    client, other = bench.client(), bench.client()
    assert client.ask("shutdown") == b"1"
    assert (client.hear(), client.ending) == ([], Ending.CLOSED)
    assert (other.hear(), other.ending) == ([], Ending.CLOSED)
    late = bench.stranger()
    assert (late.hear(), late.ending) == ([], Ending.CLOSED)
    assert not bench.core.powered
    assert bench.core.next_event_s is None


def test_shutdown_is_refused_while_a_command_executes(bench: Any) -> None:
    """L701-706: 0|01 while a program runs, and the robot stays on."""
    bench.store_program(b"p")
    client = bench.client()
    client.ask("run_program", b"p")
    assert client.ask("shutdown") == b"0|01"
    assert client.ask("get_status") == b"01"
