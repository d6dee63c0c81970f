"""`scaraspec demo`, run once, and `scaraspec audit` of its files."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from scaraspec.protocol.commands import COMMANDS

RERUN = str(Path(sys.executable).with_name("rerun"))


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder that a demo wrote, and its output."""
    out = tmp_path_factory.mktemp("demo") / "out"
    done = subprocess.run(
        [sys.executable, "-m", "scaraspec", "demo", "--out", str(out)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out, done.stdout


def rerun(*arguments: str | Path) -> str:
    """The output of the viewer's own command, which must succeed."""
    done = subprocess.run(
        [RERUN, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_summary(demo: tuple[Path, str]) -> None:
    """The summary has the verdict and the next commands."""
    out, printed = demo
    assert printed.startswith("client → recording proxy tcp://127.0.0.1:")
    assert "no violation found" in printed
    assert f"scaraspec audit {out}/capture.mcap" in printed


def test_results(demo: tuple[Path, str]) -> None:
    """results.json has no failure, and the session with its runs and transfers."""
    results = json.loads((demo[0] / "results.json").read_text(encoding="utf-8"))
    assert results["schema"] == "scaraspec.results/2"
    assert results["verdict"] == "no-violation-found"
    assert results["counts"]["fail"] == results["counts"]["inconclusive"] == 0
    assert len(results["session"]["transfers"]) == 3
    assert (
        {"get_status", "run_program", "emergency_stop", "upload_chunk", "download_chunk"}
        <= {command["name"] for command in results["session"]["exchanges"]}
        <= {command.name for command in COMMANDS}
    )


def test_report(demo: tuple[Path, str]) -> None:
    """report.html is one complete page about this capture, without the password."""
    page = (demo[0] / "report.html").read_text(encoding="utf-8")
    assert page.rstrip().endswith("</html>")
    assert "capture.mcap" in page
    assert "70 61 73 73 77 6F 72 64" not in page


def test_the_viewer_accepts_the_captures(demo: tuple[Path, str]) -> None:
    """`rerun mcap info` and `rerun rrd verify` accept the two captures."""
    assert "/exchanges" in rerun("mcap", "info", demo[0] / "capture.mcap")
    rerun("rrd", "verify", demo[0] / "capture.rrd")


def test_audit_agrees(demo: tuple[Path, str], processes: Any, tmp_path: Path) -> None:
    """An audit of the capture's raw bytes gives the same cases."""
    again = tmp_path / "again.json"
    capture = demo[0] / "capture.mcap"
    done = processes.run("audit", str(capture), "--json", str(again))
    assert done.returncode == 0, done.stderr
    assert json.loads(again.read_text()) == json.loads((demo[0] / "results.json").read_text())


def test_nothing_is_overwritten(demo: tuple[Path, str], processes: Any) -> None:
    """A second demo into the same folder is refused in one sentence."""
    done = processes.run("demo", "--out", str(demo[0]))
    assert done.returncode == 2
    assert "contains capture.mcap of an earlier run" in done.stderr


def test_a_truncated_capture_is_judged(
    demo: tuple[Path, str], processes: Any, tmp_path: Path
) -> None:
    """An incomplete file is judged up to its end; what is missing is reported."""
    truncated = tmp_path / "torn.mcap"
    complete = (demo[0] / "capture.mcap").read_bytes()
    truncated.write_bytes(complete[: len(complete) * 3 // 4])
    done = processes.run("audit", str(truncated))
    assert done.returncode in (0, 3), done.stdout
    assert "was not closed" in done.stderr


@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("plant-a-morning-shift", 0),
        ("plant-b-other-dialect", 0),
        ("plant-c-serial-bridge-bytewise", 0),
        ("plant-a-torn", 3),
        ("complaint-1", 1),
        ("complaint-2", 1),
        ("complaint-3", 1),
        ("complaint-4", 1),
    ],
)
def test_audit_of_field_captures(
    processes: Any, fixtures_dir: Path, tmp_path: Path, name: str, status: int
) -> None:
    """Conforming plants are conformant, complaints are explained, what is uncertain is
    inconclusive."""
    capture = fixtures_dir / "captures" / "field" / f"{name}.pcapng"
    report = tmp_path / "report.html"
    done = processes.run("audit", str(capture), "--html", str(report))
    assert done.returncode == status, done.stdout
    assert report.exists()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda _: None, "No such file"),
        (lambda path: path.write_bytes(b""), "empty"),
        (lambda path: path.write_bytes(b"no capture"), "neither"),
        (lambda path: path.mkdir(), "has no capture"),
    ],
)
def test_audit_of_a_file_that_is_not_a_capture(
    processes: Any, tmp_path: Path, make: Any, message: str
) -> None:
    """A file that is not a capture gives one sentence and exit status 2."""
    path = tmp_path / "file"
    make(path)
    done = processes.run("audit", str(path))
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_an_empty_capture_has_exit_status_4(processes: Any, tmp_path: Path) -> None:
    """A recording without traffic has exit status 4."""
    out = tmp_path / "idle"
    recorder = processes.start(
        "record", "tcp://127.0.0.1:9", "--listen", "127.0.0.1:0", "--out", str(out)
    )
    recorder.stdout.readline()
    recorder.terminate()
    recorder.communicate(timeout=60)
    assert processes.run("audit", str(out / "capture.mcap")).returncode == 4
