"""Forms of payloads: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable
from typing import Any

import pytest

_EMPTY = {
    "4.3/1": "get_network",
    "4.6/1": "get_time",
    "4.7/1": "get_version",
    "4.9/1": "get_running_program",
    "4.10/1": "list_programs",
    "4.14/1": "get_motor_temperatures",
    "4.17/1": "emergency_stop",
    "4.18/1": "reset",
    "4.19/1": "get_gripper_center",
    "4.22/1": "get_initial_tool_position",
    "4.23/1": "get_tool_coordinates",
    "4.25/1": "release_joints",
    "4.26/1": "lock_joints",
    "4.27/1": "get_joint_angles",
    "4.31/1": "get_digital_inputs",
    "4.34/1": "get_digital_outputs",
    "4.35/1": "shutdown",
}

_REQUESTS: dict[str, tuple[Any, ...]] = {
    # requirement: (command, right data, then pairs of wrong data and the other failures)
    "4.2/1": ("set_password", "old|new", ("oldnew", "T/1"), ("old new", "T/1")),
    "4.4/1": (
        "set_network",
        "10.0.0.2|255.0.0.0|10.0.0.1",
        ("10.0.0.2|255.0.0.0", ""),
        ("10.0.0.2|255.0.0.0|10.0.0.999", ""),
    ),
    "4.5/1": ("set_time", "20260101000000", ("2026-01-01", "")),
    "4.5/2": ("set_time", "20240229000000", ("20250229000000", "")),
    "4.11/1": ("delete_program", "a.rob", ("", "")),
    "4.13/1": ("set_default_program", "a.rob", ("", "")),
    "4.15/1": ("run_program", "a.rob", ("", "")),
    "4.16/1": ("simulate_program", "a.rob", ("", "")),
    "4.20/1": ("set_gripper_center", "1|-2.5|3", ("1|2", ""), ("1|2|x", "T/5")),
    "4.21/1": ("set_initial_tool_position", "1|2|3|4|5|6", ("1|2|3|4", "")),
    "4.24/1": (
        "set_tool_coordinates",
        "60|1|2|3|4|5|6",
        ("60|1|2|3", ""),
        ("60|1|2|3|4|5|1e3", "T/5"),
        ("60 1 2 3 4 5 6", "T/1"),
    ),
    "4.24/2": (
        "set_tool_coordinates",
        "100|1|2|3|4|5|6",
        ("0|1|2|3|4|5|6", ""),
        ("101|1|2|3|4|5|6", ""),
        ("60.5|1|2|3|4|5|6", ""),
    ),
    "4.28/1": ("jog", "1", ("11", ""), ("", "")),
    "4.32/1": ("set_digital_output", "8|1", ("8", "T/1"), ("8|on", "")),
    "4.33/1": ("get_analog_input", "08", ("8", ""), ("008", ""), ("ab", "")),
}

_REPLIES: dict[str, tuple[Any, ...]] = {
    # requirement: (command and its data, right reply, then pairs of a wrong reply and the other
    # failures)
    "4.3/2": (
        "get_network",
        "10.0.0.2|255.0.0.0|10.0.0.1",
        ("10.0.0.2,255.0.0.0,10.0.0.1", "T/1"),
        ("10.0.0.2|255.0.0.0", ""),
    ),
    "4.3/3": ("get_network", "010.0.0.2|255.0.0.0|10.0.0.1", ("10.0.0.256|255.0.0.0|10.0.0.1", "")),
    "4.6/2": ("get_time", "20260101000000", ("2026-01-01 00:00", "")),
    "4.6/3": ("get_time", "20260101000000", ("20260132000000", "")),
    "4.7/2": ("get_version", "1.0.0", ("", "")),
    "4.9/3": ("get_running_program", "1|a.rob|01020304", ("1|a.rob|00000060", "")),
    "4.10/2": ("list_programs", "0|a.rob", ("a.rob", "")),
    "4.10/3": ("list_programs", "0|a.rob|b.rob", ("0 a.rob b.rob", "T/1")),
    "4.12/3": ("get_default_program", "a.rob", ("a.rob|b.rob", "")),
    "4.14/2": ("get_motor_temperatures", "20|38.5|-4|22", ("20|38|34", ""), ("20|38|x|1", "T/5")),
    "4.16/2": ("simulate_program a.rob", "0|20", ("2", "4/1"), ("0", "4/1"), ("020", "4/1 T/1")),
    "4.19/2": ("get_gripper_center", "0|-1|2.5", ("0|1", "")),
    "4.22/2": ("get_initial_tool_position", "1|2|3|4|5|6", ("1|2|3|4", "")),
    "4.23/2": ("get_tool_coordinates", "1|2|3|4|0|0", ("1|2|3|4", "")),
    "4.25/2": ("release_joints", "0|04", ("yes", "4/1")),
    "4.26/2": ("lock_joints", "0|04", ("yes", "4/1")),
    "4.27/2": ("get_joint_angles", "1|2|3|4", ("1|2|3", "")),
    "4.28/4": ("jog 1", "0|04", ("yes", "4/1")),
    "4.31/2": ("get_digital_inputs", "1|10000000", ("1|1000000", ""), ("2|10000000", "")),
    "4.33/2": ("get_analog_input 08", "1|100", ("1|", "T/5"), ("100", "T/1")),
    "4.34/2": ("get_digital_outputs", "1|1001000011110000", ("1|10010000", "")),
}

_FLAGS = {
    "4.2/2": "set_password old|new",
    "4.4/2": "set_network 10.0.0.2|255.0.0.0|10.0.0.1",
    "4.5/3": "set_time 20260101000000",
    "4.11/2": "delete_program a.rob",
    "4.13/2": "set_default_program a.rob",
    "4.20/2": "set_gripper_center 1|2|3",
    "4.21/2": "set_initial_tool_position 1|2|3|4|0|0",
    "4.32/4": "set_digital_output 8|1",
}

_LENGTHS = {
    # requirement: (command, right reply, the reply with the length that the document prints)
    "4.3/4": ("get_network", "10.0.0.2|255.0.0.0|10.0.0.1", "= CC 04 05 31 7C 32 7C 33 34 AA"),
    "4.9/9": ("get_running_program", "0", "= CC 0A 03 30 7C 7C 31 AA"),
    "4.10/9": ("list_programs", "0|a", "= CC 0B 02 30 7C 61 62 AA"),
    "4.24/4": ("set_tool_coordinates 60|1|2|3|4|0|0", "0|05", "= CC 39 01 30 7C 30 35 AA"),
    "4.27/3": ("get_joint_angles", "1|2|3|4", "= CC 3C 08 31 7C 32 7C 33 7C 34 AA"),
    "4.31/4": ("get_digital_inputs", "1|10000000", "= CC 42 03 31 7C 31 30 30 30 30 30 30 30 AA"),
    "4.34/4": ("get_digital_outputs", "0", "= CC 49 03 31 7C 31 30 AA"),
}

SET = "set_initial_tool_position"


def cases() -> list[tuple[str, str, str]]:
    """The tables above, converted to cases."""
    found = []
    for requirement, name in _EMPTY.items():
        found.append((requirement, "pass", f"login\n> {name}"))
        found.append((requirement, "fail", f"login\n> {name} 0"))
    for requirement, (name, right, *wrongs) in _REQUESTS.items():
        found.append((requirement, "pass", f"login\n> {name} {right}"))
        found += [
            (requirement, f"fail {also}", f"login\n> {name} {wrong}") for wrong, also in wrongs
        ]
    for requirement, (request, right, *wrongs) in _REPLIES.items():
        name = request.split()[0]
        found.append((requirement, "pass", f"login\n> {request}\n< {name} {right}"))
        found += [
            (requirement, f"fail {also}", f"login\n> {request}\n< {name} {wrong}")
            for wrong, also in wrongs
        ]
    for requirement, request in _FLAGS.items():
        name = request.split()[0]
        found.append((requirement, "pass", f"login\n> {request}\n< {name} 0"))
        found.append((requirement, "fail", f"login\n> {request}\n< {name} 2"))
        found.append((requirement, "none T/3", f"login\n> {request}\n< {name} \\x00"))
    for requirement, (request, right, wrong) in _LENGTHS.items():
        name = request.split()[0]
        found.append((requirement, "pass", f"login\n> {request}\n< {name} {right}"))
        after = "> get_status\n< get_status 00"
        found.append((requirement, "fail 3/6 3/7", f"login\n> {request}\n< {wrong}\n{after}"))
    return found


CASES = (
    *cases(),
    # A deviation that the text conventions tolerate violates no form.
    ("4.27/2", "none", "login\n> get_joint_angles\n< get_joint_angles 1|2|3|4\\x00"),
    # Without bars the speed cannot be found.
    ("4.24/2", "none 4.24/1", "login\n> set_tool_coordinates 60|1|2|3"),
    (
        "4.18/5",
        "fail 3/6 3/7",
        "login\n> reset\n< reset 1\n< = CC 90 33 04 30 30 7C 31 31 AA\n> get_time",
    ),
    ("4.21/6", "pass", f"login\n> {SET} 200|300|324|34.6|34.5|0"),
    (
        "4.21/6",
        "fail 3/6 3/7",
        "login\n> = AA 36 19 31 7C 32 7C 33 7C 34 7C 30 7C 30 CC\n> get_status\n< get_status 00",
    ),
    ("4.21/6", "pass", "login\n> get_tool_coordinates\n< get_tool_coordinates 1|2|3|4|0|0"),
    (
        "4.21/6",
        "fail 3/6 3/7",
        """
        login
        > get_tool_coordinates
        < = CC 38 0A 31 7C 32 7C 33 7C 34 7C 30 7C 30 AA
        > get_status
        < get_status 00
        """,
    ),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_forms(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)


def test_passwords_are_not_shown(judged: Callable) -> None:
    """Message and evidence about a malformed 0x03 do not show the password."""
    record = judged("login\n> set_password secret")
    (finding,) = [f for f in record.findings if f.requirement == "4.2/1"]
    assert "secret" not in finding.message + finding.observed + finding.expected
