"""Forms of the output lines of a driver."""

import shlex
import sys
from contextlib import closing

from scaraspec.suite.client.harness.driver import Driver

BODY = r"""
import json, sys
number = json.loads(input())["id"]
answer = json.dumps({"ok": True, "id": number, "took_ms": 3}).encode()
sys.stderr.write("a log\n")
sys.stdout.buffer.write(b"\xef\xbb\xbf" + answer + b"\r\n\r\n \n")
sys.stdout.flush()
input()
"""


def test_lines() -> None:
    """A byte order mark, Windows line ends, blank lines and extra fields are accepted."""
    line = shlex.join((sys.executable, "-c", BODY))
    with closing(Driver(line)) as driver:
        assert driver.wait(driver.begin("get_status"), 10).ok
        assert not driver.unmatched_lines
