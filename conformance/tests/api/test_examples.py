"""The examples of docs/python.md, executed in one folder and in their order."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

_PAGE = Path(__file__).parents[3] / "docs/python.md"
_EXAMPLES = re.findall(r"```python\n(.*?)```", _PAGE.read_text("utf-8"), re.DOTALL)
_TIMEOUT_S = 120


@pytest.fixture
def controller() -> Iterator[str]:
    """The address HOST:PORT of a virtual controller in another process."""
    command = [sys.executable, "-m", "scaraspec", "controller", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip().removeprefix("listening on tcp://")
        finally:
            process.terminate()


@pytest.mark.runs
def test_examples(controller: str, tmp_path: Path) -> None:
    outputs = []
    for number, text in enumerate(_EXAMPLES):
        script = tmp_path / f"example_{number}.py"
        script.write_text(text.replace("127.0.0.1:8877", controller), "utf-8")
        ran = subprocess.run(
            [sys.executable, "-W", "error", str(script)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
        assert (ran.returncode, ran.stderr) == (0, ""), ran
        outputs.append(ran.stdout)
    certified, attended, *outputs = outputs
    stated, specified, gated, verified, recorded, audited, read, replayed, proved = outputs
    assert certified.startswith("no-violation-found\n")
    assert "\n4.8/" in certified
    assert (tmp_path / "run-1/report.html").exists()
    assert attended.startswith("set digital input 1 to 1\n")
    assert "\n4.31/2.driven none the operator skipped the case " in attended
    assert stated.startswith("() ('")
    assert specified.count("\n") == 3
    assert gated == "CONFORMANT\n"
    assert verified == "it cannot be read: No such file or directory\n"
    assert recorded.endswith("no-violation-found\n")
    assert audited.startswith("no-violation-found Only the controller is judged.")
    assert "\nget_version  1.0.0 " in read
    assert read.endswith("['file', 'number', 'connection']\n")
    assert "get_version 1.0.0 -> 1.0.0" in replayed
    assert proved.startswith("{'faults': 1, 'killed': 1, ")
