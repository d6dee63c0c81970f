"""Damage that may be sent to a real robot: no bytes of it hold a request that it could execute."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.suite.controller.harness.malformed.mutation_targets import (
    FLOOD,
    OPCODES,
    damaged_targets,
    is_harmless,
    stray_bytes,
)


def test_carriers_are_harmless() -> None:
    """Whole requests for time, version and status may stand anywhere."""
    assert is_harmless(b"".join(Frame(A2C, opcode).encode() for opcode in OPCODES) + FLOOD)


@given(opcode=st.integers(0, 255), before=st.binary(max_size=8), data=st.binary(max_size=8))
def test_other_requests_are_not(opcode: int, before: bytes, data: bytes) -> None:
    """A whole request of any other opcode is found, whatever stands before it."""
    frame = Frame(A2C, opcode, data).encode()
    assert opcode in OPCODES or not is_harmless(before + frame)


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(Frame(C2A, 0x30, b"a.rob").encode(), id="of-the-other-direction"),
        pytest.param(Frame(A2C, 0x30, b"a.rob", tagged=True).encode(), id="tagged"),
        pytest.param(b"\xaa\x08\x09" + Frame(A2C, 0x32).encode() + b"\x55", id="inside-another"),
    ],
)
def test_disguised_requests_are_found(data: bytes) -> None:
    """A request that only a lenient receiver takes for one is found too."""
    assert not is_harmless(data)


def test_unfinished_requests_are_harmless() -> None:
    """A request without its end byte is none, until something ends it."""
    torn = Frame(A2C, 0x32).encode()[:-1]
    assert is_harmless(torn)
    assert not is_harmless(torn + b"\xcc")


@given(damage=stray_bytes | damaged_targets)
def test_drawn_damage_can_be_sent(damage: bytes) -> None:
    """What is drawn can be sent before any number of carriers."""
    assert is_harmless(damage + FLOOD)


@given(damage=damaged_targets)
def test_spoiled_frames_are_none(damage: bytes) -> None:
    """A spoilt frame is never found as it stands."""
    assert Frame(A2C, damage[1], damage[3:-1]) not in Framer(A2C).feed(damage)
