"""The installed command in different working directories."""

import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="a viewer would find a screen")

LIMIT_S = 60
COMMAND = Path(sysconfig.get_path("scripts"), "scaraspec")


@pytest.mark.parametrize(
    "lines",
    [
        # Without a screen the viewer starts and ends.
        (("demo --out out", 0), ("view out/capture.mcap", 3)),
        (("prove --only 4.8/2 --quick", 0),),
    ],
)
def test_no_code_in_the_working_directory_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: tuple[tuple[str, int], ...]
) -> None:
    """Files in the working directory never replace modules of Python, of libraries or of
    scaraspec."""
    for screen in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(screen, raising=False)
    for name in ("multiprocessing", "rerun", "scaraspec", "signal", "types"):
        (tmp_path / f"{name}.py").write_text(f"open('run-{name}', 'w')\nraise SystemExit(1)\n")
    for words, status in lines:
        done = subprocess.run(
            [COMMAND, *words.split()],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
        assert done.returncode == status, done.stderr
    assert not list(tmp_path.glob("run-*"))


def test_commands_that_run_no_case_import_no_pytest() -> None:
    """They start in half of the time."""
    modules = "audit, compare, exchanges, gate, record"
    script = f"from scaraspec.cli import {modules}; import sys; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=LIMIT_S, check=True
    )
    loaded = set(done.stdout.split())
    assert "scaraspec.cli.gate" in loaded
    assert not loaded & {"pytest", "hypothesis"}
