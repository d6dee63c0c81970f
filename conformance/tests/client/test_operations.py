"""Operations: one per command of the table, with its arguments, request and result."""

import inspect
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from scaraspec.client import Client, RunningProgram, State, Status
from scaraspec.client.operations import Operations, operation, start_method
from scaraspec.client.text_interface import OPERATIONS, TRANSFERS, parameter_names
from scaraspec.protocol.commands import COMMANDS, JointValues, Network, Point, Pose
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.errors import TABLE_8_1, Joint, Kind
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import JogDirection
from scaraspec.protocol.readings import Dialect

POSE = (200, 300.5, -324, 34.6, 34.5, 0)
NOON = datetime(2014, 12, 22, 14, 30)  # noqa: DTZ001 - the document names no zone

NETWORK = Network("10.0.0.1", "255.0.0.0", "10.0.0.2")
NETWORK_DATA = b"10.0.0.1|255.0.0.0|10.0.0.2"
BAD_ROTATION = Status(State.ERROR, "18", "motor fault: rotation", (Joint.ROTATION,))

# Every operation, as a user calls it: the data of the request, the data of the reply, the result.
CALLS: dict[str, tuple[tuple[Any, ...], bytes, bytes, Any]] = {
    "login": (("password",), b"password", b"1", None),
    "set_password": (("old", b"new"), b"old|new", b"1", None),
    "get_network": ((), b"", NETWORK_DATA, NETWORK),
    "set_network": (NETWORK, NETWORK_DATA, b"1", None),
    "set_time": ((NOON,), b"20141222143000", b"1", None),
    "get_time": ((), b"", b"20141222143000", NOON),
    "get_version": ((), b"", b"1.0.0", "1.0.0"),
    "get_status": ((), b"", b"18", BAD_ROTATION),
    "get_running_program": ((), b"", b"1|a.rob|01000001", RunningProgram("a.rob", 86401)),
    "list_programs": ((), b"", b"0|a.rob|b.rob", ("a.rob", "b.rob")),
    "delete_program": (("a.rob",), b"a.rob", b"1", None),
    "get_default_program": ((), b"", b"a.rob", "a.rob"),
    "set_default_program": (("a.rob",), b"a.rob", b"1", None),
    "get_motor_temperatures": ((), b"", b"20|38|34|22", JointValues(20, 38, 34, 22)),
    "run_program": (("a.rob",), b"a.rob", b"1", None),
    "simulate_program": (("a.rob",), b"a.rob", b"1", None),
    "emergency_stop": ((), b"", b"1", None),
    "reset": ((), b"", b"1", None),
    "get_gripper_center": ((), b"", b"200|300|456", Point(200, 300, 456)),
    "set_gripper_center": ((200, 300.125, -4.5), b"200|300.125|-4.5", b"1", None),
    "set_initial_tool_position": (POSE, b"200|300.5|-324|34.6|34.5|0", b"1", None),
    "get_initial_tool_position": ((), b"", b"200|300.5|-324|34.6|34.5|0", Pose(*POSE)),
    "get_tool_coordinates": ((), b"", b"200|300.5|-324|34.6|34.5|0", Pose(*POSE)),
    "set_tool_coordinates": ((60, *POSE), b"60|200|300.5|-324|34.6|34.5|0", b"1", None),
    "release_joints": ((), b"", b"1", None),
    "lock_joints": ((), b"", b"1", None),
    "get_joint_angles": ((), b"", b"20.4|30.5|38.0|0", JointValues(20.4, 30.5, 38, 0)),
    "jog": (("-x",), b"4", b"1", None),
    "get_digital_inputs": ((), b"", b"1|10000000", "10000000"),
    "set_digital_output": ((8, 1), b"8|1", b"1", None),
    "get_analog_input": ((8,), b"08", b"1|100", 100.0),
    "get_digital_outputs": ((), b"", b"1|1001000011110000", "1001000011110000"),
    "shutdown": ((), b"", b"1", None),
}  # fmt: skip


def talk(scripted_link: Any, *replies: bytes, **options: Any) -> tuple[Client, Any]:
    """Return a client and its link to a controller that sends these replies, then ``11``."""
    coming = list(replies)

    def answer(opcode: int, _data: bytes) -> list[tuple[float, bytes]]:
        reply = Frame(C2A, opcode, coming.pop(0)).encode()
        return [(0.1, reply), (60, Frame(C2A, opcode, b"11", tagged=True).encode())]

    link = scripted_link(answer)
    client = Client(link, **options)
    client._core.logged_in = True  # the login is tested elsewhere
    return client, link


def test_every_command_has_an_operation() -> None:
    """Fails for a command without a method, and a method without a command."""
    methods = {name for name, value in vars(Operations).items() if isinstance(value, operation)}
    contents = {"upload_bytes", "download_bytes"}
    assert methods - contents == set(OPERATIONS)
    carried_out_by = {c.name: c.name.split("_")[0] for c in COMMANDS if c.clause[0] == "5"}
    assert set(carried_out_by.values()) == set(TRANSFERS)
    assert {c.name for c in COMMANDS} - set(carried_out_by) == set(CALLS)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_arguments_are_those_of_the_table(command: Any) -> None:
    """Same names, same order; two-stage commands have both forms."""
    if command.clause[0] == "5":
        return
    method = vars(Operations)[command.name]
    assert list(inspect.signature(method.describe).parameters)[1:] == list(parameter_names(command))
    assert method.__doc__
    start = vars(Operations).get(f"start_{command.name}")
    assert isinstance(start, start_method) == command.two_stage


@pytest.mark.parametrize("name", CALLS)
def test_an_operation_sends_its_request_and_returns_its_result(
    scripted_link: Any, name: str
) -> None:
    """T/9, T/10: values in the documented order, unchanged in both directions."""
    parse_arguments, request, reply, result = CALLS[name]
    client, link = talk(scripted_link, reply)
    assert getattr(client, name)(*parse_arguments) == result
    opcode = next(c.opcode for c in COMMANDS if c.name == name)
    assert link.requests == [(opcode, request)]


@pytest.mark.parametrize("name", ["程序.rob", b"\xb3\xcc\xd0\xf2.rob", "a b.rob", b"\xff\xfe"])
def test_names_survive_the_round_trip(scripted_link: Any, name: str | bytes) -> None:
    """T/8: bytes are sent as they were received."""
    raw = name.encode() if isinstance(name, str) else name
    client, link = talk(scripted_link, b"0|" + raw, b"1", raw)
    (listed,) = client.list_programs()
    client.set_default_program(listed)
    assert link.requests[1] == (0x0E, raw)
    assert client.get_default_program() == listed
    assert isinstance(name, bytes) or listed == name


def test_text_is_sent_in_the_encoding_of_the_dialect(scripted_link: Any) -> None:
    """A-T-2: such as GB18030; a name that cannot be encoded is not sent."""
    client, link = talk(scripted_link, b"1", dialect=Dialect.of(text_encoding="gb18030"))
    client.delete_program("程序")
    assert link.requests == [(0x0C, b"\xb3\xcc\xd0\xf2")]
    client, link = talk(scripted_link, dialect=Dialect.of(text_encoding="ascii"))
    with pytest.raises(PayloadError, match="cannot be encoded in ascii"):
        client.delete_program("程序")
    assert link.requests == []


def test_there_may_be_no_program(scripted_link: Any) -> None:
    """No running program, no default program, an empty list."""
    client, _ = talk(scripted_link, b"0", b"", b"0")
    assert client.get_running_program() is None
    assert client.get_default_program() is None
    assert client.list_programs() == ()


@pytest.mark.parametrize("code", TABLE_8_1.values(), ids=lambda code: code.text)
def test_every_code_is_one_of_three_states(scripted_link: Any, code: Any) -> None:
    """4.8/11, in upper and lower case."""
    states = {Kind.IDLE: State.IDLE, Kind.RUNNING: State.RUNNING}
    expected = Status(states.get(code.kind, State.ERROR), code.text, code.meaning, code.joints)
    client, _ = talk(scripted_link, code.text.encode(), code.text.lower().encode())
    assert client.get_status() == client.get_status() == expected


def test_an_unknown_status_is_an_error_with_its_code(scripted_link: Any) -> None:
    """4.8/11: the status contains the unknown code."""
    client, _ = talk(scripted_link, b"zz")
    status = client.get_status()
    assert (status.state, status.code) == (State.ERROR, "zz")
    assert "not in table 8-1" in status.meaning


def test_directions_have_names(scripted_link: Any) -> None:
    """4.28/3: as text and as enum."""
    names = ("+y", "-y", "+x", "-x")
    client, link = talk(scripted_link, *[b"1"] * 8)
    for direction in (*names, *JogDirection):
        client.jog(direction)
    assert [data for _, data in link.requests] == [b"1", b"2", b"3", b"4"] * 2
    with pytest.raises(PayloadError, match=r"'up' is not one of \+y, -y, \+x, -x"):
        client.jog("up")


@pytest.mark.parametrize("call", [lambda c: c.jog("+z"), lambda c: c.delete_program("a|b")])
def test_invalid_values_raise_before_anything_is_sent(
    scripted_link: Any, call: Callable[[Client], None]
) -> None:
    """The error is raised before the request is sent (T/6)."""
    client, link = talk(scripted_link)
    with pytest.raises(PayloadError):
        call(client)
    assert link.requests == []


def test_an_upload_is_named_after_its_file(scripted_link: Any, tmp_path: Path) -> None:
    """The stored name is that of the file, unless another name is given."""
    (tmp_path / "a.rob").write_bytes(b"content")
    client, link = talk(scripted_link, *[b"1"] * 4)
    client.upload(tmp_path / "a.rob")
    client.upload(str(tmp_path / "a.rob"), "b.rob")
    assert [data for opcode, data in link.requests if opcode == 0x50] == [b"a.rob", b"b.rob"]


def test_a_missing_file_is_not_sent(scripted_link: Any, tmp_path: Path) -> None:
    """Neither the name nor a chunk is sent (5.2/19)."""
    client, link = talk(scripted_link)
    with pytest.raises(FileNotFoundError):
        client.upload(tmp_path / "a.rob")
    assert link.requests == []
