"""User programs: list, default, deletion, run and simulation."""

from typing import Any

import pytest

from scaraspec.protocol.program_files import (
    Condition,
    Node,
    NodeType,
    PortType,
    SetOutput,
    WaitInput,
    WaitSeconds,
)

_OUTPUT = Node(b"", NodeType.SET_OUTPUT, data=SetOutput(PortType.DIGITAL_OUTPUT, 3, 1))
_MINUTE = Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(61))
_TURN = Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(1))


def test_a_program_runs_to_its_end(bench: Any) -> None:
    """Requirements 4.15/4 and 4.15/5; its outputs stay set."""
    bench.store_program(b"p", _OUTPUT, _TURN)
    client = bench.client()
    assert client.ask("run_program", b"p") == b"1"
    assert client.result("run_program") == b"11"
    assert client.ask("get_digital_outputs") == b"1|0000000000000100"


def test_a_simulated_run_has_the_real_duration_and_no_effect(bench: Any) -> None:
    """A simulation takes the time of a run and sets no output (4.16/5, A-4.16-1)."""
    bench.store_program(b"p", _OUTPUT, _MINUTE)
    client = bench.client()
    before = client.where()
    assert client.ask("simulate_program", b"p") == b"1"
    assert client.receive(60.0) == []
    assert client.result("simulate_program") == b"11"
    assert client.ask("get_digital_outputs") == b"1|0000000000000000"
    assert client.where() == before


@pytest.mark.parametrize("name", [b"q", b"", b"..", b"../p", b"p|p", b"x" * 255, b'"p"'])
@pytest.mark.parametrize("command", ["run_program", "simulate_program"])
def test_a_program_that_does_not_exist_is_refused_with_20(
    bench: Any, command: str, name: bytes
) -> None:
    """The refusal has the code 20 (4.15/7, L1044)."""
    bench.store_program(b"p")
    client = bench.client()
    assert client.ask(command, name) == b"0|20"
    assert client.receive(20.0) == []


@pytest.mark.parametrize("content", [b"", b"no program", b"SCARA" + bytes(200) + b"ARACS"])
def test_a_damaged_program_is_refused_as_missing(bench: Any, content: bytes) -> None:
    """A-4.15-2 and requirement 6.5/28."""
    bench.store.write(b"p", content)
    assert bench.client().ask("run_program", b"p") == b"0|20"


def test_an_unbalanced_program_is_refused_as_missing(bench: Any) -> None:
    """Requirement 6.5/28: a program with lint errors is never run."""
    bench.store_program(b"p", Node(b"", NodeType.LOOP, counts=1), _TURN)
    assert bench.client().ask("run_program", b"p") == b"0|20"


def test_the_running_program_and_its_time_are_reported(bench: Any) -> None:
    """Requirements 4.9/2 to 4.9/7, also for a simulated run (A-4.9-4)."""
    for_ever = Node(b"", NodeType.WAIT_INPUT, data=WaitInput(1, 100, Condition.EQUAL))
    bench.store_program(b"p", for_ever)
    client = bench.client()
    assert client.ask("get_running_program") == b"0"
    for command in ("run_program", "simulate_program"):
        client.ask(command, b"p")
        assert client.ask("get_running_program") == b"1|p|00000000"
        bench.pass_s(90061.5)
        assert client.ask("get_running_program") == b"1|p|01010101"
        client.send("emergency_stop")
        client.receive()
        assert client.ask("get_running_program") == b"0"


def test_a_move_is_not_a_running_program(bench: Any) -> None:
    """During a move no running program is reported (4.9/10)."""
    client = bench.client()
    client.ask("jog", b"1")
    assert client.ask("get_running_program") == b"0"


def test_reply_without_running_program_is_a_reading(bench_of: Any) -> None:
    """The reply is 0|| or a zero byte (A-4.9-2 b, A-T-1 b)."""
    assert bench_of(runinfo_none="0||").client().ask("get_running_program") == b"0||"
    assert bench_of(runinfo_binary="binary").client().ask("get_running_program") == b"\0"


# --------------------------------------------------------------------------- the list


def test_the_list_is_sorted_and_complete(bench: Any) -> None:
    """Each stored program is in the list, in the order of names (4.10/11)."""
    client = bench.client()
    assert client.ask("list_programs") == b"0"
    for name in (b"b.rob", b"a.rob", "程序".encode()):
        bench.store.write(name, b"x")
    assert client.ask("list_programs") == b"0|a.rob|b.rob|" + "程序".encode()


@pytest.mark.parametrize(
    ("readings", "names", "reported"),
    [
        ({"list_empty": "0|"}, [], b"0|"),
        ({"list_empty": "empty"}, [], b""),
        ({"list_prefix_sep": "0a"}, [b"a", b"b"], b"0a|b"),
    ],
)
def test_the_form_of_a_list_is_a_reading(
    bench_of: Any, readings: dict[str, str], names: list[bytes], reported: bytes
) -> None:
    """Bars and empty lists have several forms (A-4.10-2, A-4.10-4)."""
    bench = bench_of(**readings)
    for name in names:
        bench.store.write(name, b"x")
    assert bench.client().ask("list_programs") == reported


def _fill(bench: Any) -> list[bytes]:
    """Store programs whose names fill one part exactly, exceed it by one byte, and by far."""
    names = [b"a" * 126, b"b" * 126, b"c" * 126, b"d" * 127, b"e" * 244]
    names += [b"f%029d" % number for number in range(50)]
    for name in names:
        bench.store.write(name, b"x")
    return names


def _joined(parts: list[bytes]) -> list[bytes]:
    assert [part[:2] for part in parts] == [b"1|"] * (len(parts) - 1) + [b"0|"]
    assert all(len(part) <= 255 for part in parts)
    return [name for part in parts for name in part[2:].split(b"|")]


def test_a_long_list_is_pushed_in_parts(bench: Any) -> None:
    """Requirements 4.10/4 to 4.10/6 (L251): all parts immediately, each with at most 255 bytes."""
    names = _fill(bench)
    client = bench.client()
    client.send("list_programs")
    parts = [data for _, data in client.receive()]
    assert [len(part) for part in parts[:4]] == [255, 128, 129, 246]
    assert _joined(parts) == names


def test_each_part_of_a_list_can_need_a_request(bench_of: Any) -> None:
    """A-4.10-3 (b): the next request gets the next part; another client gets its own first part."""
    bench = bench_of(list_cont="request")
    names = _fill(bench)
    client, other = bench.client(), bench.client()
    parts = [client.ask("list_programs")]
    assert other.ask("list_programs") == parts[0]
    while parts[-1][:1] == b"1":
        parts.append(client.ask("list_programs"))
    assert _joined(parts) == names
    assert client.ask("list_programs") == parts[0]


# --------------------------------------------------------------------------- default and deletion


@pytest.mark.parametrize(
    ("reading", "served"),
    [("0x0D", {0x0D, 0x13}), ("0x13", {0x13}), ("both", {0x0D, 0x13})],
)
def test_the_opcode_of_the_default_program_is_a_reading(
    bench_of: Any, reading: str, served: set[int]
) -> None:
    """A-4.12-1: the reply has the opcode of the request (requirement 4.12/2)."""
    bench = bench_of(op_get_default=reading)
    bench.store_program(b"p")
    client = bench.client()
    assert client.ask("set_default_program", b"p") == b"1"
    answered = set()
    for opcode in (0x0D, 0x13):
        client.link.send(bytes([0xAA, opcode, 0, 0xCC]))
        arrival = client.link.receive(client.link.now_s)
        if arrival:
            assert arrival.content == bytes([0xCC, opcode, 1]) + b"p\xaa"
            answered.add(opcode)
    assert answered == served


@pytest.mark.parametrize(("reading", "reported"), [("empty", b""), ("0", b"0"), ("silence", None)])
def test_reply_without_default_program_is_a_reading(
    bench_of: Any, reading: str, reported: bytes | None
) -> None:
    """The reply is empty, 0 or missing (A-4.12-2)."""
    assert bench_of(default_none=reading).client().ask("get_default_program") == reported


def test_only_a_stored_program_becomes_the_default(bench: Any) -> None:
    """A missing program is refused as default (4.13/3 to 4.13/6)."""
    bench.store_program(b"p")
    client = bench.client()
    assert client.ask("set_default_program", b"p") == b"1"
    for name in (b"q", b"", b"../p"):
        assert client.ask("set_default_program", name) == b"0"
    assert client.ask("get_default_program") == b"p"
    assert client.ask("get_status") == b"00"


def test_a_deleted_program_does_not_exist(bench: Any) -> None:
    """Requirements 4.11/3 and 4.11/4; a deleted default program is no longer the default."""
    bench.store_program(b"p")
    client = bench.client()
    client.ask("set_default_program", b"p")
    assert client.ask("delete_program", b"p") == b"1"
    assert client.ask("list_programs") == b"0"
    assert client.ask("run_program", b"p") == b"0|20"
    assert client.ask("download_name", b"p") == b"0"
    assert client.ask("get_default_program") == b""
    assert client.ask("delete_program", b"p") == b"0"


@pytest.mark.parametrize(
    "name", [b"", b".", b"..", b"../x", b"/etc/passwd", b"a\\b", b"a|b", b"p\0q"]
)
def test_a_name_with_path_elements_is_refused(bench: Any, name: bytes) -> None:
    """Such a name can be neither deleted nor transferred (4.11/6, 5.2/15)."""
    client = bench.client()
    assert client.ask("delete_program", name) == b"0"
    assert client.ask("upload_name", name) == b"0"
    assert client.ask("download_name", name) == b"0"


@pytest.mark.parametrize(("guard", "answer"), [("refuse", b"0"), ("allow", b"1")])
def test_whether_a_program_in_use_may_be_deleted_is_a_reading(
    bench_of: Any, guard: str, answer: bytes
) -> None:
    """A-4.11-1: during its run and during its download; the run continues in both cases."""
    bench = bench_of(delete_guard=guard)
    bench.store_program(b"p")
    bench.store_program(b"q")
    client = bench.client()
    client.ask("run_program", b"p")
    assert client.ask("delete_program", b"p") == answer
    client.send("download_name", b"q")
    client.receive()
    assert client.ask("delete_program", b"q") == answer
    assert client.result("run_program") == b"11"


def test_the_extension_of_programs_is_a_reading(bench_of: Any) -> None:
    """A-0-9: other programs cannot be uploaded, are not listed and cannot be run."""
    bench = bench_of(prog_ext=".rob")
    bench.store_program(b"p.rob")
    bench.store_program(b"p.txt")
    client = bench.client()
    assert client.ask("list_programs") == b"0|p.rob"
    assert client.ask("run_program", b"p.txt") == b"0|20"
    assert client.ask("upload_name", b"q.txt") == b"0"
    assert client.ask("upload_name", b"q.rob") == b"1"


def test_a_name_that_is_too_long_for_replies_is_not_listed(bench: Any) -> None:
    """A name of up to 255 bytes may be stored by other means; no reply may exceed its length."""
    name = b"x" * 250
    bench.store_program(name)
    client = bench.client()
    assert client.ask("list_programs") == b"0"
    assert client.ask("run_program", name) == b"0|20"
    bench.store_program(name[:244])
    assert client.ask("run_program", name[:244]) == b"1"
    assert client.ask("get_running_program") == b"1|" + name[:244] + b"|00000000"
