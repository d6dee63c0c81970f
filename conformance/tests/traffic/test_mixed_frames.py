"""Frames whose bytes are mixed, because two threads write at once."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.mixed_frames import find_mixed

STATUS = bytes.fromhex("AA 09 00 CC")
RUN = bytes.fromhex("AA 30 05 61 2E 72 6F 62 CC")
RESULT = bytes.fromhex("CC 90 30 02 31 31 AA")


@pytest.mark.parametrize("at", range(1, len(STATUS)))
def test_a_frame_inside_of_another(at: int) -> None:
    """Wherever it begins."""
    data = STATUS[:at] + RUN + STATUS[at:]
    assert find_mixed(data, A2C) == "get_status and run_program"


def test_frames_of_the_controller() -> None:
    """They may have a tag."""
    reply = bytes.fromhex("CC 09 02 30 30 AA")
    data = RESULT[:3] + reply + RESULT[3:]
    assert find_mixed(data, C2A) == "get_status and run_program"


@pytest.mark.parametrize("data", [STATUS, RUN, STATUS + RUN, RUN[:4], RUN + b"\xaa", b""])
def test_other_bytes(data: bytes) -> None:
    """Whole frames one after the other are not mixed."""
    assert not find_mixed(data, A2C)


@pytest.mark.parametrize(
    "session",
    [
        "> =AA 09\n> =AA 30 05 61 2E 72 6F 62 CC\n> =00 CC\n+5\n> get_time",
        "> =AA 30 05 61 2E\n> =AA 09 00 CC\n> =72 6F 62 CC\n> get_time",
    ],
)
def test_the_client_is_the_cause(judged: Callable[..., Any], session: str) -> None:
    """It is no gap in the recording."""
    record = judged(f"login\n{session}\n< get_time 20260101120000")
    (finding, *_) = (f for f in record.findings if f.requirement == "3/32")
    assert "the bytes of get_status and run_program are mixed" in finding.message
    assert finding.side.value == "client"
    assert not any("gap" in f.message for f in record.findings)
