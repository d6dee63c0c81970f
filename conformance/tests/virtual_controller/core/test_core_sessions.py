"""Connections, logins, and which client gets which frame."""

from typing import Any

import pytest

from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.hazard import Hazard
from scaraspec.transports.link import Ending

_MOVE = b"10|200|300|324|34.6|0|0"


def test_a_right_password_is_answered_1_and_a_wrong_one_0(bench: Any) -> None:
    """4.1 (L111-119); a wrong password does not log the client out (A-4.1-2)."""
    client = bench.guest()
    assert client.ask("login", b"wrong") == b"0"
    assert client.ask("get_status") is None
    assert client.ask("login", b"password") == b"1"
    assert client.ask("login", b"wrong") == b"0"
    assert client.ask("get_status") == b"00"


@pytest.mark.parametrize("password", [b"", b"|", b"pass|word", b"password|", b'"password"', b" "])
def test_a_malformed_password_is_wrong(bench: Any, password: bytes) -> None:
    """A-3-9: a known opcode with a failure form gets that form as the reply."""
    guest = bench.guest()
    assert guest.ask("login", password) == b"0"
    assert guest.ask("get_status") is None


def test_a_login_is_for_one_connection_only(bench: Any) -> None:
    """A-4.1-1: another connection without its own login is not served."""
    bench.client()
    assert bench.guest().ask("get_status") is None


def test_before_the_login_no_command_is_served(bench: Any) -> None:
    """A-4-4 (a): no command is served or executed."""
    guest = bench.guest()
    for row in COMMANDS:
        if row.name != "login":
            assert guest.ask(row.name, b"") is None
    assert bench.core.powered
    assert bench.client().ask("get_status") == b"00"


def test_failure_forms_before_the_login_are_a_reading(bench_of: Any) -> None:
    """A-4-4 (b): commands with a failure form get it as the reply, the others get none."""
    guest = bench_of(prelogin="failure").guest()
    assert guest.ask("set_tool_coordinates", _MOVE) == b"0|05"
    assert guest.ask("delete_program", b"a") == b"0"
    assert guest.ask("upload_chunk", bytes(212)) == b"0"
    assert guest.ask("get_analog_input", b"01") == b"0"
    assert guest.ask("get_status") is None
    assert guest.ask("download_chunk", b"1") is None


def test_closing_before_the_login_is_a_reading(bench_of: Any) -> None:
    """A-4-4 (c): any other request ends the connection."""
    guest = bench_of(prelogin="close").guest()
    assert guest.ask("get_status") is None
    assert guest.ending is Ending.CLOSED


@pytest.mark.parametrize("reading", ["reads", "all"])
def test_serving_before_the_login_is_a_reading(bench_of: Any, reading: str) -> None:
    """A-4-4 (d) and (e): queries are served, or all requests."""
    guest = bench_of(prelogin=reading).guest()
    assert guest.ask("get_status") == b"00"
    served = guest.ask("set_time", b"20200101000000")
    assert served == (b"1" if reading == "all" else None)


def test_reads_serves_exactly_the_read_only_rows(bench_of: Any) -> None:
    """The reading means the commands that the table marks as read-only."""
    bench = bench_of(prelogin="reads", empty_file="name-only")
    bench.store.write(b"x", b"")
    for row in COMMANDS:
        if row.name in ("login", "download_chunk"):
            continue
        answered = bench.guest().ask(row.name, {"get_analog_input": b"01"}.get(row.name, b"x"))
        assert (answered is not None) == (row.hazard is Hazard.READ_ONLY), row.name


def test_results_are_sent_only_to_the_requesting_connection(bench: Any) -> None:
    """A-2-2: each of two clients receives its own replies and results."""
    mover, watcher = bench.client(), bench.client()
    assert mover.ask("set_tool_coordinates", _MOVE) == b"1"
    assert watcher.ask("get_status") == b"04"
    assert watcher.receive(30.0) == []
    assert mover.receive() == [("*set_tool_coordinates", b"11")]


def test_a_result_for_a_closed_connection_is_dropped(bench: Any) -> None:
    """A-2-8 and A-2-9: the move continues to its end, and its result is not sent."""
    mover = bench.client()
    mover.ask("set_tool_coordinates", _MOVE)
    mover.link.close()
    watcher = bench.client()
    assert watcher.ask("get_status") == b"04"
    assert watcher.receive(30.0) == []
    assert watcher.where()[:3] == [200, 300, 324]


def test_many_clients_are_served_by_default(bench: Any) -> None:
    """All connected clients are served at the same time (A-2-2 b)."""
    clients = [bench.client() for _ in range(10)]
    assert [client.ask("get_status") for client in clients] == [b"00"] * 10


def test_one_client_at_a_time_is_a_reading(bench_of: Any) -> None:
    """A-2-2 (a): a second client is disconnected immediately, until the first has disconnected."""
    bench = bench_of(max_clients="one")
    first, second = bench.client(), bench.guest()
    assert (second.receive(), second.ending) == ([], Ending.CLOSED)
    assert first.ask("get_status") == b"00"
    first.link.close()
    assert bench.client().ask("get_status") == b"00"


def test_replacing_the_previous_client_is_a_reading(bench_of: Any) -> None:
    """A new client ends the connection of the previous one (A-2-2 c)."""
    bench = bench_of(max_clients="newest")
    first, second = bench.client(), bench.client()
    assert first.receive() == []
    assert first.ending is Ending.CLOSED
    assert second.ask("get_status") == b"00"


def test_a_serial_client_needs_no_login(bench: Any) -> None:
    """使用蓝牙通信时不需要登录验证 (L83); a client that logs in anyway gets a reply (A-2-5)."""
    client = bench.guest("serial")
    assert client.ask("get_status") == b"00"
    assert client.ask("login", b"wrong") == b"0"
    assert client.ask("login", b"password") == b"1"


def test_a_serial_client_is_masked_while_a_network_client_is_connected(bench: Any) -> None:
    """L81 and A-2-4: its frames are dropped silently until the last TCP connection is closed."""
    serial = bench.guest("serial")
    first, second = bench.guest(), bench.guest()
    assert serial.ask("get_status") is None
    first.link.close()
    assert serial.ask("get_status") is None
    second.link.close()
    assert serial.ask("get_status") == b"00"
    assert serial.receive(10.0) == []


def test_masking_stops_a_jog_and_drops_a_partial_frame(bench: Any) -> None:
    """A masked client cannot stop its jog, so the jog stops; a partial frame is dropped."""
    serial = bench.guest("serial")
    assert serial.ask("jog", b"1") == b"1"
    serial.link.send(b"\xaa\x09")
    network = bench.client()
    assert network.ask("get_status") == b"00"
    network.link.close()
    assert serial.receive(1.0) == []
    assert serial.ask("get_status") == b"00"


def test_a_later_serial_client_is_masked(bench: Any) -> None:
    """Masking depends on the connected clients, not on their order."""
    bench.client()
    assert bench.guest("serial").ask("get_status") is None


@pytest.mark.parametrize("opcode", [0x00, 0x02, 0x10, 0x3E, 0x41, 0x51, 0x90, 0xAA, 0xCC, 0xFF])
@pytest.mark.parametrize("reading", ["ignore", "0", "close"])
def test_unknown_opcodes(bench_of: Any, opcode: int, reading: str) -> None:
    """A-3-9: silence, a reply 0 with the same opcode, or the end of the connection; the state does
    not change."""
    bench = bench_of(on_unknown=reading)
    client = bench.client()
    client.link.send(bytes([0xAA, opcode, 0x01, 0x31, 0xCC]))
    # No controller can send a reply with this opcode: it is the tag.
    answered = reading == "0" and opcode != 0x90
    assert client.receive() == ([(f"0x{opcode:02X}", b"0")] if answered else [])
    assert (client.ending is Ending.CLOSED) == (reading == "close")
    assert bench.client().ask("get_status") == b"00"


def test_shutdown_answers_then_closes_everything(bench: Any) -> None:
    """4.35 (L696; A-4.35-2): the reply 1, no final result, all connections close, and no client is
    accepted."""
    client, other = bench.client(), bench.client()
    assert client.ask("shutdown") == b"1"
    assert (client.receive(), client.ending) == ([], Ending.CLOSED)
    assert (other.receive(), other.ending) == ([], Ending.CLOSED)
    late = bench.guest()
    assert (late.receive(), late.ending) == ([], Ending.CLOSED)
    assert not bench.core.powered
    assert bench.core.next_event_s is None


def test_shutdown_is_refused_while_a_command_executes(bench: Any) -> None:
    """L701-706: 0|01 while a program runs, and the robot stays on."""
    bench.store_program(b"p")
    client = bench.client()
    client.ask("run_program", b"p")
    assert client.ask("shutdown") == b"0|01"
    assert client.ask("get_status") == b"01"
