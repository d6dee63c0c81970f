"""The example drivers in C and Python are conformant."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from scaraspec.client.text_interface import OPERATIONS

DRIVERS = Path(__file__).parents[4] / "fixtures" / "drivers"
BUILD = ("cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-O2")
ONLY = "3/13,4.8,4.12,4.15,4.32,5.2/5,5.3/12"
"""A few cases of each kind; the whole suite takes a minute, and is run with `certify`."""

TIMEOUT_S = 120


@pytest.fixture(scope="module", params=["driver.c", "driver.py"])
def driver(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the command line of an example."""
    source = DRIVERS / request.param
    if source.suffix == ".py":
        return shlex.join([sys.executable, str(source)])
    program = tmp_path_factory.mktemp("built") / "driver"
    subprocess.run([*BUILD, "-o", program, source], check=True, timeout=TIMEOUT_S)
    return shlex.quote(str(program))


def _scaraspec(*parse_arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "scaraspec", *parse_arguments],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )


def test_the_readme_lists_all_operations() -> None:
    """The README lists every operation with its values."""
    table = (DRIVERS / "README.md").read_text("utf-8").partition("## Operations")[2]
    printed = {
        name: re.findall(r"`(\w+)`", values)
        for names, values, _ in re.findall(r"^\| (`.+?) \| (.*?)\| (.+) \|$", table, re.MULTILINE)
        for name in re.findall(r"`(\w+)`", names)
    }
    assert printed == {name: [v.strip("[]") for v in takes] for name, takes in OPERATIONS.items()}


def test_is_a_driver(driver: str) -> None:
    """The example follows the driver protocol."""
    done = _scaraspec("driver-check", driver)
    assert done.returncode == 0, done.stdout + done.stderr


def test_is_conformant(driver: str) -> None:
    """The example conforms to the document in some clauses of each kind."""
    line = f"{driver} --transfer-timeout 1"
    options = ("--transfer-timeout", "1", "--only", ONLY)
    done = _scaraspec("certify", "client", "--driver", line, *options)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " pass" in done.stdout
