"""Values of queries: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

VERSIONS = "login\n> get_version\n< get_version {}\n> get_version\n< get_version {}"
DEFAULT = "login\n> {}\n< {} a.rob"
TEMPERATURES = "login\n> get_motor_temperatures\n< {} {}"

CASES = (
    ("4.7/3", "pass", VERSIONS.format("1.0.0", "1.0.0")),
    ("4.7/3", "tolerated A-4.7-1=free text", VERSIONS.format("V1", "V1")),
    ("4.7/4", "pass", VERSIONS.format("1.0.0", "1.0.0")),
    ("4.7/4", "fail", VERSIONS.format("1.0.0", "1.0.1")),
    (
        "4.7/4",
        "none",
        VERSIONS.format("1.0.0", "1.0.1").replace(
            "> get_version\n< get_version 1.0.1",
            "> close\n2> login password\n2< login 1\n2> get_version\n2< get_version 1.0.1",
        ),
    ),
    ("4.12/1", "pass", "login\n> 0D"),
    ("4.12/1", "fail", "login\n> 0D a.rob"),
    ("4.12/1", "tolerated op_get_default=0x13", "login\n> 13"),
    ("4.12/2", "pass", DEFAULT.format("0D", "0D")),
    ("4.12/2", "pass", DEFAULT.format("13", "13")),
    ("4.12/2", "fail", DEFAULT.format("0D", "13")),
    ("4.12/4", "pass", "login\n> 0D\n< 0D"),
    ("4.12/4", "tolerated default_none=0", "login\n> 0D\n< 0D 0"),
    ("4.12/4", "none", DEFAULT.format("0D", "0D")),
    ("4.14/3", "pass", TEMPERATURES.format("0F", "20|38|34|22")),
    ("4.14/3", "tolerated op_temp_reply=0x0E", TEMPERATURES.format("0E", "20|38|34|22")),
    ("4.14/5", "pass", TEMPERATURES.format("0F", "-20|38|34|120")),
    ("4.14/5", "tolerated 4.14/5=observed otherwise", TEMPERATURES.format("0F", "293|311|307|295")),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_values(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
