"""`scaraspec driver-check`: a good driver passes, each bad one is reported in a sentence."""

import shlex
import sys
from pathlib import Path
from typing import Any

import pytest

OWN = f"{shlex.quote(sys.executable)} -m scaraspec client-driver"


def test_the_reference_client(processes: Any) -> None:
    """Each step is printed."""
    done = processes.run("driver-check", OWN)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("ok  ") == 5


ANSWER = """
import json
while True:
    print(json.dumps({{'id': json.loads(input())['id'], {}}}), flush=True)
"""


@pytest.mark.parametrize(
    ("body", "timeout_s", "message"),
    [
        ("raise SystemExit('no licence')", 30, "no licence"),
        ("import time; time.sleep(60)", 0.5, "did not answer levitate"),
        (
            "import os\nwhile True: os.write(1, b'x' * 65536)",
            30,
            "keeps writing lines that answer no operation",
        ),
        ("print('[]' * 10, flush=True); input(); input()", 0.5, "did not answer levitate"),
        (ANSWER.format("'ok': True"), 30, "an unknown operation is answered {"),
        (ANSWER.format("'unimplemented': True"), 5, "opened no connection"),
    ],
)
def test_bad_drivers(
    processes: Any, tmp_path: Path, body: str, timeout_s: float, message: str
) -> None:
    """Drivers that crash, hang, flood, answer nonsense or claim everything.

    Only the driver that hangs has a short timeout, so that a slow machine changes no result.
    """
    file = tmp_path / "driver.py"
    file.write_text(body, encoding="utf-8")
    line = f"{shlex.quote(sys.executable)} {shlex.quote(str(file))}"
    done = processes.run("driver-check", line, "--timeout", f"{timeout_s}")
    assert done.returncode == 1, done.stdout + done.stderr
    assert message in done.stdout
    assert "Traceback" not in done.stderr


def test_a_missing_driver(processes: Any) -> None:
    done = processes.run("driver-check", "/no/such/driver")
    assert done.returncode == 1
    assert "cannot be started: No such file or directory" in done.stdout
    done = processes.run("driver-check", "")
    assert done.returncode == 1
    assert "no program is named" in done.stdout
