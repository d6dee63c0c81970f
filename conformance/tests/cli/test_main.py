"""The installed command line, in any working folder."""

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
        # There is no screen: the viewer is started, and ends.
        (("demo --out out", 0), ("view out/capture.mcap", 3)),
        (("prove --only 4.8/2 --quick", 0),),
    ],
)
def test_nothing_is_run_that_lies_where_somebody_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: tuple[tuple[str, int], ...]
) -> None:
    """A file may be called there like a module of Python, of a library, or like ours."""
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
