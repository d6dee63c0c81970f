"""The private functions of the SDK that `rerun_files` uses still exist and work.

These tests fail when rerun-sdk changes what is not documented; each states what has changed.
"""

import subprocess
import sys
from pathlib import Path

import pytest
import rerun as rr
import rerun_bindings
from rerun.chunk import RrdReader

from scaraspec_recorder.recordings.recovery import has_complete_rrd
from scaraspec_recorder.sinks.rerun import blueprint, rerun_files
from scaraspec_recorder.sinks.rerun.optimizer import optimize
from scaraspec_recorder.sinks.rerun.rerun_files import _Layout

ROUNDS = 4


def threads() -> int:
    """Return the number of threads of any library."""
    listed = Path("/proc/self/task")
    if not listed.exists():
        pytest.skip("only Linux lists the threads of all libraries")
    return len(list(listed.iterdir()))


def write_rrd(path: Path) -> None:
    """Write a file as a sink does."""
    file = rerun_files.RerunFile("test", path, blueprint.layout())
    file.stream.log("value", rr.Scalars(1.0))
    file.close()


def test_the_sdk_sends_the_layout(tmp_path: Path) -> None:
    """`_Layout` learns the SDK's own stream for the layout, and the layout arrives."""
    path, layout = tmp_path / "drawing.rrd", _Layout(blueprint.layout())
    stream = rr.RecordingStream("test")
    stream.save(path, default_blueprint=layout)  # type: ignore[arg-type]  # it has what is asked of one
    learnt = layout._stream
    assert isinstance(learnt, rr.RecordingStream), (
        "rerun-sdk sends layouts in another way than by to_blueprint() and _log_to_stream(): "
        "the stream that it sends them by is leaked for each file"
    )
    assert learnt is not stream
    layout.end()
    stream.disconnect()
    assert len(RrdReader(path).blueprints()) == 1, "rerun-sdk does not take `_Layout` for a layout"


@pytest.mark.parametrize("footer", [True, False])
def test_a_file_without_footer(tmp_path: Path, *, footer: bool) -> None:
    """The SDK keeps the footer in memory; without it nothing else is missing."""
    path = tmp_path / "drawing.rrd"
    file = rerun_files.RerunFile("test", path, blueprint.layout(), footer=footer)
    file.stream.log("value", rr.Scalars(1.0))
    file.close()
    assert has_complete_rrd(path) is footer
    assert optimize(path)
    assert has_complete_rrd(path)
    assert len(RrdReader(path).blueprints()) == 1


def test_the_sdk_can_release_closed_streams() -> None:
    """The function is not in its public interface."""
    assert callable(getattr(rerun_bindings, "flush_and_cleanup_orphaned_recordings", None)), (
        "rerun_bindings.flush_and_cleanup_orphaned_recordings is gone: "
        "find what frees the threads of closed streams now, or whether that is still needed"
    )


def test_closed_streams_have_no_threads(tmp_path: Path) -> None:
    """Each stream and its layout have threads; after the release there are none."""
    running = []
    for number in range(ROUNDS):
        write_rrd(tmp_path / f"{number}.rrd")
        running.append(threads())
    assert running[-1] <= running[0], f"rerun-sdk keeps threads of closed streams: {running}"


def test_the_release_is_still_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If this fails, the SDK releases closed streams itself and our code can be removed."""
    before = threads()
    with monkeypatch.context() as without:
        without.setattr(rerun_files, "release", lambda: None)
        for number in range(ROUNDS):
            write_rrd(tmp_path / f"{number}.rrd")
    kept = threads() - before
    rerun_files.release()
    assert kept >= ROUNDS, "rerun-sdk frees closed streams by itself now: remove `release`"
    assert threads() <= before + 1


REFUSED = """
import resource, sys
from os import urandom
from pathlib import Path
import rerun as rr
from scaraspec_recorder.sinks.rerun import blueprint
from scaraspec_recorder.sinks.rerun.rerun_files import RerunFile
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
for number in range(10):
    file = RerunFile("test", Path(sys.argv[1]) / f"{number}.rrd", blueprint.layout())
    why = ""
    while not why:
        file.stream.log("value", rr.TextLog(urandom(1000).hex()))
        try:
            file.flush()
        except OSError as error:
            why = error.strerror
    file.stream.log("value", rr.TextLog(urandom(200_000).hex()))  # waits for the end of the process
    print(why)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="nothing there refuses a file its growth")
def test_a_write_error_does_not_block(tmp_path: Path) -> None:
    """The error has the reason of the system; the SDK alone would mostly wait forever."""
    done = subprocess.run(
        [sys.executable, "-c", REFUSED, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "File too large\n" * 10), done.stderr
    assert {path.stat().st_size for path in tmp_path.iterdir()} == {100_000}
