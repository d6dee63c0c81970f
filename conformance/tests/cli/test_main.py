"""The command line as it is installed, in whatever folder somebody works."""

import subprocess
import sysconfig
from pathlib import Path

import pytest

LIMIT_S = 60


@pytest.mark.parametrize("words", ["demo --out out", "prove --only 4.8/2 --quick"])
def test_nothing_is_run_that_lies_where_somebody_works(tmp_path: Path, words: str) -> None:
    """A file may be called there like a module of Python, of a library, or like ours."""
    for name in ("multiprocessing", "rerun", "scaraspec", "signal", "types"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('run from here')")
    command = Path(sysconfig.get_path("scripts"), "scaraspec")
    done = subprocess.run(
        [command, *words.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "run from here" not in done.stderr
