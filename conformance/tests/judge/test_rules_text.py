"""The text conventions: each requirement with traffic that meets it and traffic that violates
it."""

from collections.abc import Callable

import pytest


def answered(name: str, reply: str, request: str = "") -> str:
    """A session with one exchange."""
    return f"login\n> {name} {request}\n< {name} {reply}"


NETWORK = answered("get_network", "192.168.1.2|255.255.255.0|192.168.1.1")
ANGLES = answered("get_joint_angles", "20.4|-30.5|38.0|0")
STATUS = answered("get_status", "1a")
REFUSED = answered("run_program", "0|20", "a.rob")
FAILED = "login\n> run_program a.rob\n< run_program 1\n<90 run_program 00|12"

CASES = (
    ("T/1", "pass", NETWORK),
    ("T/1", "pass", answered("get_running_program", "1|my prog |00011230")),
    ("T/1", "pass", answered("get_running_program", "0||")),
    ("T/1", "pass", answered("list_programs", "0a.rob|b.rob")),
    ("T/1", "pass", REFUSED),
    # One field too few between single bars violates the clause, not the rule about bars.
    ("T/1", "pass 4.3/2", answered("get_network", "192.168.1.2|255.255.255.0")),
    ("T/1", "fail 4.3/2", answered("get_network", "192.168.1.2 255.255.255.0 192.168.1.1")),
    ("T/1", "fail 4.3/2", answered("get_network", "192.168.1.2,255.255.255.0,192.168.1.1")),
    ("T/1", "fail 4.3/2", answered("get_network", "192.168.1.2||255.255.255.0|192.168.1.1")),
    ("T/1", "fail", answered("get_network", "192.168.1.2 | 255.255.255.0 | 192.168.1.1")),
    ("T/1", "fail", answered("get_running_program", "1|my prog | 00011230")),
    ("T/1", "fail 4.31/2", answered("get_digital_inputs", "1 10000000")),
    ("T/1", "fail 4.10/3", answered("list_programs", "0 a.rob b.rob")),
    ("T/1", "fail", answered("run_program", "0 20", "a.rob")),
    ("T/1", "fail", FAILED.replace("00|12", "00 12")),
    ("T/1", "fail 4.2/1", "login\n> set_password old new\n< set_password 0"),
    ("T/2", "pass", NETWORK),
    ("T/2", "fail", answered("get_version", '"1.0.0"')),
    ("T/2", "fail", answered("delete_program", "1", r"\xe2\x80\x9ca.rob\xe2\x80\x9d")),
    ("T/3", "pass", answered("get_running_program", "0")),
    ("T/3", "fail", answered("set_time", r"\x01", "20260101000000")),
    ("T/3", "fail", answered("run_program", r"\x01", "a.rob")),
    ("T/3", "fail", answered("get_digital_inputs", r"\x01|10000000")),
    ("T/3", "tolerated runinfo_binary=binary", answered("get_running_program", r"\x00")),
    ("T/4", "pass", NETWORK),
    ("T/4", "tolerated trailing_nul=yes", answered("get_version", r"1.0.0\x00")),
    ("T/4", "tolerated trailing_nul=yes", answered("get_status", r"00\x00")),
    ("T/4", "tolerated trailing_nul=yes", "> login password\n< login 1\\x00"),
    ("T/4", "tolerated A-T-4=trailing bar", answered("get_joint_angles", "20.4|30.5|38.0|0|")),
    ("T/4", "tolerated A-T-4=trailing bar", answered("list_programs", "0|a|b|")),
    ("T/5", "pass", ANGLES),
    ("T/5", "pass", answered("get_analog_input", "1|0", "08")),
    ("T/5", "none", answered("get_analog_input", "0", "08")),
    ("T/5", "fail 4.27/2", answered("get_joint_angles", "20.4|30,5|38.0|0")),
    ("T/5", "fail 4.27/2", answered("get_joint_angles", "20.4|3e1|38.0|0")),
    ("T/5", "fail 4.27/2", answered("get_joint_angles", "20.4|nan|38.0|0")),
    ("T/5", "fail 4.27/2", answered("get_joint_angles", "20.4||38.0|0")),
    ("T/5", "fail 4.33/2", answered("get_analog_input", "1|1,5", "08")),
    ("T/5", "fail 4.20/1", answered("set_gripper_center", "0", "1|2|+3")),
    # A speed with decimals is a plain number; 4.24/2 requires an integer.
    ("T/5", "pass 4.24/2", answered("set_tool_coordinates", "0|05", "60.0|1|2|3|4|5|6")),
    ("T/6", "pass", answered("delete_program", "1", "a.rob")),
    ("T/6", "fail", answered("delete_program", "0", "a|b.rob")),
    ("T/6", "fail", "> login pass|word\n< login 0"),
    ("T/6", "fail 4.2/1", "login\n> set_password old|new|er\n< set_password 0"),
    ("T/7", "pass", STATUS),
    ("T/7", "pass", REFUSED),
    ("T/7", "pass", FAILED),
    ("T/7", "none", answered("run_program", "1", "a.rob")),
    ("T/7", "fail 4.15/3", answered("run_program", "0|2", "a.rob")),
    ("T/7", "fail 4.15/6 4/3 8/2", FAILED.replace("12", "0C")),
    ("T/7", "fail 4.8/2 8/2", answered("get_status", "99")),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_text_conventions(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
