"""Which readings are detected from the traffic of a peer, and where it contradicts itself."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.readings import READINGS

Judged = Callable[..., Any]

STOPPED = "login\n> jog 1\n< jog 1\n> emergency_stop\n< emergency_stop 1\n"
MOVE = "login\n> set_tool_coordinates 50|200|300|324|0|0|0\n"
RUN = "login\n> run_program a\n< run_program 1\n"
LATER = "> get_version\n< get_version 1.0.0\n+11\n> get_version\n< get_version 1.0.0\n"

SEEN = [
    (C2A, "op_get_default", "0x0D", "login\n> 0D\n< 0D a"),
    (A2C, "op_get_default", "0x13", "login\n> 13"),
    (C2A, "op_temp_reply", "0x0F", "login\n> get_motor_temperatures\n< 0F 1|2|3|4"),
    (C2A, "op_temp_reply", "0x0E", "login\n> get_motor_temperatures\n< 0E 1|2|3|4"),
    (C2A, "list_cont", "push", "login\n> list_programs\n< list_programs 1|a\n< list_programs 0|b"),
    (
        C2A,
        "list_cont",
        "request",
        "login\n> list_programs\n< list_programs 1|a\n> list_programs\n< list_programs 0|b",
    ),
    (C2A, "list_prefix_sep", "0a", "login\n> list_programs\n< list_programs 0a|b"),
    (C2A, "list_empty", "0|", "login\n> list_programs\n< list_programs 0|"),
    (C2A, "runinfo_none", "0||", "login\n> get_running_program\n< get_running_program 0||"),
    (C2A, "default_none", "empty", "login\n> get_default_program\n< get_default_program"),
    (C2A, "err_bare0", "0", MOVE + "< set_tool_coordinates 0"),
    (C2A, "err_bare0", "0|code", MOVE + "< set_tool_coordinates 0|12"),
    (C2A, "busy_reply", "state", RUN + "> simulate_program a\n< simulate_program 0|01"),
    (C2A, "busy_reply", "silence", RUN + "> reset\n" + LATER),
    (C2A, "estop_interrupted", "first", STOPPED + "<90 jog 11\n<90 emergency_stop 11"),
    (C2A, "estop_interrupted", "after", STOPPED + "<90 emergency_stop 11\n<90 jog 11"),
    (C2A, "estop_interrupted", "none", STOPPED + "<90 emergency_stop 11\n> reset\n< reset 1"),
    (C2A, "prelogin", "ignore", "> reset\n+6\n> close"),
    (C2A, "prelogin", "failure", "> reset\n< reset 0|06"),
    (C2A, "prelogin", "failure", "> get_digital_inputs\n< get_digital_inputs 0"),
    (C2A, "prelogin", "reads", "> get_status\n< get_status 00"),
    (C2A, "prelogin", "all", "> set_time 20260101000000\n< set_time 1"),
    (C2A, "prelogin", "close", "> get_status\n< half-close\n> close"),
    (C2A, "on_unknown", "0", "login\n> 77\n< 77 0"),
    (C2A, "on_unknown", "close", "login\n> 77\n< rst"),
    (C2A, "on_unknown", "ignore", "login\n> 77\n" + LATER),
    (A2C, "jog_byte", "binary", "login\n> jog \\x01"),
    (A2C, "trailing_nul", "yes", "login\n> delete_program a\\x00"),
    (A2C, "endian", "big", "login\n> upload_name a\n< upload_name 1\n> chunk 0/300 big"),
    (
        C2A,
        "chunk_trunc",
        "truncated",
        "login\n> download_name a\n< download_name 1\n< chunk 0/9 cut",
    ),
]

OF_EXCHANGES = {
    "op_get_default",
    "op_temp_reply",
    "list_cont",
    "busy_reply",
    "estop_interrupted",
    "prelogin",
    "on_unknown",
}
"""Readings that one frame alone does not show."""


@pytest.mark.parametrize(("peer", "key", "option", "session"), SEEN)
def test_a_reading_is_seen(
    judged: Judged, peer: Direction, key: str, option: str, session: str
) -> None:
    """The detector reports this reading, and no other option of it."""
    assert option in {o.name for o in READINGS[key].options}
    assert judged(session).judge.dialect_seen.of(peer)[key] == (option,)


@pytest.mark.parametrize(
    ("peer", "key", "session"), [(p, k, s) for p, k, _, s in SEEN if k in OF_EXCHANGES]
)
def test_nothing_is_detected_after_a_gap(
    judged: Judged, peer: Direction, key: str, session: str
) -> None:
    """After a gap no reading is detected, because the gap may be the cause."""
    seen = judged("> gap\n< gap\n" + session).judge.dialect_seen
    assert key not in seen.of(peer)


def test_mixed_readings_are_reported(judged: Judged) -> None:
    """Both options are reported, the more frequent one first."""
    lists = "> list_programs\n< list_programs {}\n"
    record = judged("login\n" + lists.format("0|") + lists.format("0") * 2)
    seen = record.judge.dialect_seen
    assert seen.of(C2A)["list_empty"] == ("0", "0|")
    assert seen.mixed(C2A) == {"list_empty": ("0", "0|")}
    assert not seen.mixed(A2C)


def test_both_opcodes_are_not_mixed(judged: Judged) -> None:
    """A controller may serve both opcodes (A-4.12-1)."""
    seen = judged("login\n> 0D\n< 0D a\n> 13\n< 13 a").judge.dialect_seen
    assert set(seen.of(C2A)["op_get_default"]) == {"0x0D", "0x13"}
    assert not seen.mixed(C2A)


def test_the_refusal_of_a_reset_shows_no_reading(judged: Judged) -> None:
    """A busy robot refuses a reset even if it ignores other requests (A-4-2)."""
    seen = judged(RUN + "> reset\n< reset 0|01").judge.dialect_seen
    assert "busy_reply" not in seen.of(C2A)


def test_an_answer_as_to_an_undefined_opcode_shows_no_reading(judged: Judged) -> None:
    """A bare 0 is also a possible reply to an unknown opcode (A-3-9)."""
    seen = judged("login\n> 0D\n< 0D 0").judge.dialect_seen
    assert "op_get_default" not in seen.of(C2A)
