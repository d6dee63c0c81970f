"""`scaraspec view`: what the viewer is given to show."""

import re
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import rerun_cli  # type: ignore[import-untyped] # it ships no types
from rerun.experimental import ViewerClient

from scaraspec_recorder.sources.capture import open_capture

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="a script takes the place of the viewer"),
    pytest.mark.usefixtures("viewer"),
]


@pytest.fixture
def shown(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A replacement of the viewer that records its arguments and copies its input."""
    folder = tmp_path_factory.mktemp("viewer")
    viewer = folder / "viewer"
    viewer.write_text(f'#!/bin/sh\necho "$@" > {folder}/called\nfor last; do :; done\n'
                      f'cp "$last" {folder}/drawn\n')  # fmt: skip
    viewer.chmod(0o755)
    monkeypatch.setenv("RERUN_CLI_PATH", str(viewer))
    return folder


def given(shown: Path) -> str:
    """The file that the viewer was called with; it was a whole drawing."""
    called = (shown / "called").read_text().split()
    assert called[:3] == ["--bind", "127.0.0.1", "--port"]
    assert b"RRF2FOOT" in (shown / "drawn").read_bytes()[-12:]
    return called[-1]


def test_packets_are_drawn_for_this_once(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """Nothing is left beside the capture, nor elsewhere."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    done = processes.run("view", str(source))
    assert done.returncode == 0, done.stderr
    assert not Path(given(shown)).exists()
    assert not source.with_suffix(".rrd").exists()
    assert not list(tmp_path.iterdir())


def test_a_recording_is_drawn_beside(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """The second time the .rrd exists."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    recording = tmp_path / "a.mcap"
    processes.run("convert", str(source), str(recording))
    assert processes.run("view", str(recording)).returncode == 0
    drawn = recording.with_suffix(".rrd")
    assert given(shown) == str(drawn)
    stamp = drawn.stat().st_mtime_ns
    again = processes.run("view", str(recording))
    assert (again.returncode, again.stderr) == (0, "")
    assert processes.run("view", str(drawn)).returncode == 0
    assert (given(shown), drawn.stat().st_mtime_ns) == (str(drawn), stamp)


def test_a_torn_recording_is_not_changed(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """It is drawn elsewhere, what is missing is reported, and the exit status is 3."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    recording = tmp_path / "a.mcap"
    processes.run("convert", str(source), str(recording))
    torn = recording.read_bytes()[:-100]
    recording.write_bytes(torn)
    done = processes.run("view", str(recording))
    assert done.returncode == 3
    assert "torn or damaged" in done.stderr
    assert given(shown) != str(recording.with_suffix(".rrd"))
    assert recording.read_bytes() == torn
    assert list(tmp_path.iterdir()) == [recording]


def test_a_recording_that_is_being_made(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """It is drawn elsewhere, as far as it has come, and not touched."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    recording = tmp_path / "a.mcap"
    processes.run("convert", str(source), str(recording))
    recorder = processes.start(
        *("record", "tcp://127.0.0.1:9", "--listen", "127.0.0.1:0", "--out", str(tmp_path))
    )
    recorder.stdout.readline()
    before = recording.read_bytes()
    done = processes.run("view", str(recording))
    assert done.returncode == 0
    assert "a recorder writes into" in done.stderr
    assert given(shown) != str(recording.with_suffix(".rrd"))
    assert recording.read_bytes() == before
    recorder.terminate()
    recorder.communicate(timeout=60)


def test_a_viewer_that_does_not_open(
    processes: Any, fixtures_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a screen it ends at once: one sentence, exit status 3."""
    monkeypatch.setenv("RERUN_CLI_PATH", "/bin/false")
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    done = processes.run("view", str(source))
    assert done.returncode == 3
    assert done.stderr == "scaraspec: the Rerun viewer did not start: is there a screen?\n"


def test_what_is_no_capture(processes: Any, tmp_path: Path) -> None:
    """It is one sentence and exit status 2."""
    done = processes.run("view", str(tmp_path / "none.mcap"))
    assert done.returncode == 2
    assert "No such file" in done.stderr


@pytest.mark.viewer
def test_a_moment(
    processes: Any, fixtures_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A real viewer, without a screen, stands there, on the timeline of the clock."""
    real = Path(rerun_cli.__file__).parent / "rerun"
    viewer = tmp_path / "viewer"
    viewer.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/called\nexec {real} --headless "$@"\n')
    viewer.chmod(0o755)
    monkeypatch.setenv("RERUN_CLI_PATH", str(viewer))
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    *_, last = open_capture(source, port=None)
    at_ns = last.time_ns - 1_000
    process = processes.start("view", str(source), "--at", f"{at_ns // 10**9}.{at_ns % 10**9:09}")
    assert process.stdout
    assert "in the viewer" in process.stdout.readline()
    assert stands_at(tmp_path / "called", at_ns)
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 0


def stands_at(called: Path, at_ns: int) -> bool:
    """Whether the viewer that was called gets to a moment."""
    deadline_s = time.monotonic() + 60
    while time.monotonic() < deadline_s:
        with suppress(Exception):
            port = re.search(r"--port (\d+)", called.read_text())
            assert port
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port[1]}/proxy")
            (recording,) = client.get_state().recordings
            if (recording.current_timeline, recording.current_time) == ("time", at_ns):
                return True
    return False


def test_a_viewer_that_cannot_be_led(processes: Any, fixtures_dir: Path, shown: Path) -> None:
    """It shows the recording all the same, and the moment is left to its user."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    done = processes.run("view", str(source), "--at", "2026-01-01T00:00:01.5")
    assert done.returncode == 0, done.stderr
    assert "move to the time by hand" in done.stderr
    assert given(shown)


def test_no_moment(processes: Any) -> None:
    done = processes.run("view", "capture.mcap", "--at", "noon")
    assert done.returncode == 2
    assert "'noon' is not a time" in done.stderr
