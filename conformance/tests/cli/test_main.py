"""The installed command in different working directories."""

import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from wording import ROOT

from scaraspec.cli.main import COMMANDS

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="a viewer would find a screen")

LIMIT_S = 60
CAPTURE = ROOT / "fixtures/captures/field/complaint-1.pcapng"
SUBCOMMANDS = (
    *("archive build", "archive query", "archive report"),
    *("certify client", "certify controller"),
    *("ics check", "ics new"),
    *("program check", "program convert", "program show"),
)
SLOW = {
    *("hypothesis", "pytest", "jinja2", "google.protobuf", "lz4"),  # of every installation
    *("duckdb", "fsspec", "numpy", "pyarrow", "rerun", "scapy", "serial"),  # of an extra
    *("scaraspec.api.auditing", "scaraspec.api.certify", "scaraspec.api.proving"),
    *("scaraspec.judge.judge", "scaraspec.suite.engine.run", "scaraspec.mutants.client"),
    *("scaraspec.mutants.kill_matrix", "scaraspec_recorder.sinks.mcap.mcap_sink"),
    "scaraspec_recorder.sources.mcap_reader",
}
"""Modules that take long to import."""
MAX_MODULES = 500
"""The help of `record` imports 391, that of `frame` 182; a run of `certify` more than 800."""
COMMAND = Path(sysconfig.get_path("scripts"), "scaraspec")


@pytest.mark.runs
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


def imported(*arguments: str) -> set[str]:
    """The modules that a command imports."""
    script = (
        "import atexit, sys\n"
        "atexit.register(lambda: print('modules:', *sys.modules, file=sys.stderr))\n"
        "from scaraspec.cli import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    return set(done.stderr.rpartition("modules: ")[2].split())


@pytest.mark.parametrize("command", [*COMMANDS, *SUBCOMMANDS])
def test_help_imports_nothing_that_is_slow(command: str) -> None:
    """The help and the completion of a command need only its options."""
    module = f"scaraspec.cli.{command.split(maxsplit=1)[0].replace('-', '_')}"
    loaded = imported(*command.split(), "--help")
    assert module in loaded
    assert not loaded & SLOW
    assert len(loaded) <= MAX_MODULES


@pytest.mark.parametrize("command", ["audit", "exchanges"])
def test_commands_that_run_no_case_import_no_pytest(command: str) -> None:
    """They start in half of the time."""
    loaded = imported(command, str(CAPTURE))
    assert "scaraspec.api.auditing" in loaded
    assert not loaded & {"pytest", "hypothesis"}
