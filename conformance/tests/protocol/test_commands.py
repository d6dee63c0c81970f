"""The command table: completeness, consistency, and a round trip of every payload."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scaraspec.protocol.commands import BY_NAME, BY_OPCODE, COMMANDS, Command, parse_frame
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Payload
from scaraspec.suite.engine.strategies import payload_values

PAYLOADS = [
    pytest.param(payload, id=f"{command.name}-{part}")
    for command in COMMANDS
    for part, payload in zip(
        ("request", "reply", "result"),
        (command.request, command.reply, command.result),
        strict=True,
    )
    if payload is not None
]


def test_complete() -> None:
    """All 37 opcodes of clauses 4 and 5 are present; eight are two-stage (catalogue, overview)."""
    assert len(COMMANDS) == 37
    assert len(BY_NAME) == 37
    assert len(BY_OPCODE) == 38
    assert {c.opcode for c in COMMANDS if c.two_stage} == {
        0x30, 0x31, 0x32, 0x33, 0x39, 0x3A, 0x3B, 0x3D,
    }  # fmt: skip
    assert [c.name for c in COMMANDS if c.initiator is C2A] == ["download_chunk"]
    assert {c.name for c in COMMANDS if c.secret} == {"login", "set_password"}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c.name)
def test_rows_cite_the_document(command: Command) -> None:
    """Each row cites its clause, its first and last line, and its heading."""
    first, last = command.lines
    assert 100 < first < last < 800
    assert command.clause.split(".")[0] in ("4", "5")
    assert command.original


@pytest.mark.parametrize("payload", PAYLOADS)
@settings(max_examples=25)
@given(data=st.data())
def test_payload_round_trip(payload: Payload, data: st.DataObject) -> None:
    """Every encoded value is decoded unchanged, without an issue."""
    value = data.draw(payload_values(payload))
    decoded = payload.decode(payload.encode(value))
    assert decoded.issues == ()
    assert _plain(decoded.value) == _plain(value)


def _plain(value: Any) -> Any:
    """Return a value that ignores the padding of a decoded chunk."""
    return (*value[:3], value.data) if hasattr(value, "buffer") else value


@pytest.mark.parametrize("payload", PAYLOADS)
@settings(max_examples=25)
@given(data=st.binary(max_size=255) | st.text("01|. ,-xyz\"'\0", max_size=40).map(str.encode))
def test_decoding_never_raises(payload: Payload, data: bytes) -> None:
    """Decoding never raises; without a value there is an issue, or the data is a valid "none"."""
    decoded = payload.decode(data)
    if decoded.value is None and data not in (b"", b"0", b"0||", b"\0", b"\0||"):
        assert decoded.issues


def test_motor_temperatures_with_the_printed_opcode() -> None:
    """A reply 0x0E has temperatures if it has four fields, else set-default's flag (A-4.14-1)."""
    hot = parse_frame(Frame(C2A, 0x0E, b"20|38|34|22"))
    flag = parse_frame(Frame(C2A, 0x0E, b"1"))
    assert hot is not None
    assert flag is not None
    assert hot.command.name == "get_motor_temperatures"
    assert flag.command.name == "set_default_program"


def test_undefined_opcodes() -> None:
    """Undefined opcodes, and tags on one-stage commands, give None."""
    assert parse_frame(Frame(A2C, 0x3E)) is None
    assert parse_frame(Frame(C2A, 0x09, b"00", tagged=True)) is None
