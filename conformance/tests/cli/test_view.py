"""`scaraspec view`: what the viewer receives."""

import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import rerun_cli  # type: ignore[import-untyped] # it ships no types
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from scaraspec_recorder.sources.capture import open_capture

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="a script takes the place of the viewer"),
    pytest.mark.usefixtures("viewer"),
]


@pytest.fixture
def shown(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Replace the viewer by a function that records its arguments and copies its input."""
    folder = tmp_path_factory.mktemp("viewer")
    viewer = folder / "viewer"
    viewer.write_text(f'#!/bin/sh\necho "$@" > {folder}/called\nfor last; do :; done\n'
                      f'cp "$last" {folder}/drawn\n')  # fmt: skip
    viewer.chmod(0o755)
    monkeypatch.setenv("RERUN_CLI_PATH", str(viewer))
    return folder


def viewed(shown: Path) -> str:
    """Return the complete file that the viewer was called with."""
    called = (shown / "called").read_text().split()
    assert called[:3] == ["--bind", "127.0.0.1", "--port"]
    assert b"RRF2FOOT" in (shown / "drawn").read_bytes()[-12:]
    return called[-1]


def test_a_packet_capture_is_drawn_temporarily(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """No file is left beside the capture or elsewhere."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    done = processes.run("view", str(source))
    assert done.returncode == 0, done.stderr
    assert not Path(viewed(shown)).exists()
    assert not source.with_suffix(".rrd").exists()
    assert not list(tmp_path.iterdir())


def test_a_recording_is_drawn_beside_it(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """The .rrd is written beside it once; the second time it exists."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    recording = tmp_path / "a.mcap"
    processes.run("convert", str(source), str(recording))
    assert processes.run("view", str(recording)).returncode == 0
    drawn = recording.with_suffix(".rrd")
    assert viewed(shown) == str(drawn)
    stamp = drawn.stat().st_mtime_ns
    again = processes.run("view", str(recording))
    assert (again.returncode, again.stderr) == (0, "")
    assert processes.run("view", str(drawn)).returncode == 0
    assert (viewed(shown), drawn.stat().st_mtime_ns) == (str(drawn), stamp)


def test_the_capture_of_a_certification_shows_the_case(
    processes: Any, shown: Path, tmp_path: Path
) -> None:
    """A lane shows the case that runs; the files of the run are not changed."""
    host, port = processes.controller()
    out = tmp_path / "out"
    url = f"tcp://{host}:{port}"
    done = processes.run("certify", "controller", url, "--only", "4.7", "--out", f"{out}")
    assert done.returncode == 0, done.stderr
    before = {path: path.read_bytes() for path in out.iterdir()}
    assert processes.run("view", f"{out / 'capture.mcap'}").returncode == 0
    assert not Path(viewed(shown)).exists()
    assert {path: path.read_bytes() for path in out.iterdir()} == before
    lane = [
        chunk.to_record_batch()
        for chunk in RrdReader(shown / "drawn").stream().to_chunks()
        if chunk.entity_path == "/state/case" and not chunk.is_static
    ]
    cases = [case for batch in lane for (case,) in batch.column("StateChange:state").to_pylist()]
    assert [case for case in cases if case] == ["4.7/2", "4.7/4"]
    assert cases[-1] == ""


def test_a_truncated_recording_is_not_changed(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """The .rrd is written elsewhere, missing data is reported, and the exit status is 3."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    recording = tmp_path / "a.mcap"
    processes.run("convert", str(source), str(recording))
    truncated = recording.read_bytes()[:-100]
    recording.write_bytes(truncated)
    done = processes.run("view", str(recording))
    assert done.returncode == 3
    assert "torn or damaged" in done.stderr
    assert viewed(shown) != str(recording.with_suffix(".rrd"))
    assert recording.read_bytes() == truncated
    assert list(tmp_path.iterdir()) == [recording]


def test_a_recording_in_progress(
    processes: Any, fixtures_dir: Path, shown: Path, tmp_path: Path
) -> None:
    """The .rrd is written elsewhere, up to the latest data; the recording is not changed."""
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
    assert viewed(shown) != str(recording.with_suffix(".rrd"))
    assert recording.read_bytes() == before
    recorder.terminate()
    recorder.communicate(timeout=60)


@pytest.mark.parametrize("options", [(), ("--finding", "1")])
def test_a_viewer_without_a_screen(
    processes: Any, fixtures_dir: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...]
) -> None:
    """Without a screen the viewer ends immediately: one sentence, exit status 3."""
    monkeypatch.setenv("RERUN_CLI_PATH", "/bin/false")
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    done = processes.run("view", str(source), *options)
    assert done.returncode == 3
    assert done.stderr == "scaraspec: the Rerun viewer did not start: is there a screen?\n"


def test_a_file_that_is_not_a_capture(processes: Any, tmp_path: Path) -> None:
    """The message is one sentence, and the exit status is 2."""
    done = processes.run("view", str(tmp_path / "none.mcap"))
    assert done.returncode == 2
    assert "No such file" in done.stderr


@pytest.mark.viewer
def test_a_time(
    processes: Any, fixtures_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A real viewer without a screen goes to this time on its clock timeline."""
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
    assert can_go_to(tmp_path / "called", at_ns)
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 0


def can_go_to(called: Path, at_ns: int) -> bool:
    """Whether the viewer can be set to a time."""
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


def test_a_viewer_without_a_time_option(processes: Any, fixtures_dir: Path, shown: Path) -> None:
    """It shows the recording, and a message asks the user to go to the time."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    done = processes.run("view", str(source), "--at", "2026-01-01T00:00:01.5")
    assert done.returncode == 0, done.stderr
    assert "move to the time by hand" in done.stderr
    assert viewed(shown)


def test_no_time(processes: Any) -> None:
    done = processes.run("view", "capture.mcap", "--at", "noon")
    assert done.returncode == 2
    assert "'noon' is not a time" in done.stderr


def test_a_finding_that_does_not_exist(processes: Any, fixtures_dir: Path, shown: Path) -> None:
    """The number is that of the list that audit prints."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    done = processes.run("view", f"{source}", "--finding", "9")
    assert done.returncode == 2
    assert "has no finding 9 with a time: see scaraspec audit" in done.stderr
    assert not (shown / "called").exists()


def test_without_the_extra(fixtures_dir: Path) -> None:
    """A light installation has neither the viewer nor numpy; the message names the extra."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    code = (
        "import sys; sys.modules['numpy'] = sys.modules['rerun'] = None;"
        f"sys.argv = ['scaraspec', 'view', {str(source)!r}];"
        "from scaraspec.cli import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert (
        done.stderr == "scaraspec: the viewer needs the extra view: pip install 'scaraspec[view]'\n"
    )
