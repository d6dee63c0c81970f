"""What `rerun_files` takes from the inside of the SDK is still there, and still does what it must.

These fail when rerun-sdk changes what it does not promise; each says what has changed.
"""

import gc
from pathlib import Path

import pytest
import rerun as rr
import rerun_bindings
from rerun.chunk import RrdReader

from scaraspec_recorder.drawing import blueprint, rerun_files
from scaraspec_recorder.drawing.optimizing import optimize
from scaraspec_recorder.drawing.rerun_files import _Layout
from scaraspec_recorder.keeping.leftovers import is_drawn

ROUNDS = 4


def threads() -> int:
    """How many threads of any library run here."""
    listed = Path("/proc/self/task")
    if not listed.exists():
        pytest.skip("only Linux lists the threads of all libraries")
    return len(list(listed.iterdir()))


def drawn(path: Path) -> None:
    """A file, begun and ended as a drawing is."""
    stream = rerun_files.begin("test", path, blueprint.layout())
    stream.log("value", rr.Scalars(1.0))
    stream.disconnect()
    del stream
    gc.collect()


def test_the_sdk_sends_a_layout_as_it_did(tmp_path: Path) -> None:
    """`_Layout` learns the stream of its own by which the SDK sends it, and the layout arrives."""
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
def test_a_footer_is_left_to_the_optimizing(tmp_path: Path, *, footer: bool) -> None:
    """The SDK keeps it in memory, for weeks perhaps; without one nothing else is missing."""
    path = tmp_path / "drawing.rrd"
    stream = rerun_files.begin("test", path, blueprint.layout(), footer=footer)
    stream.log("value", rr.Scalars(1.0))
    stream.disconnect()
    assert is_drawn(path) is footer
    assert optimize(path)
    assert is_drawn(path)
    assert len(RrdReader(path).blueprints()) == 1


def test_the_sdk_has_what_frees_closed_streams() -> None:
    """It is no part of its public interface."""
    assert callable(getattr(rerun_bindings, "flush_and_cleanup_orphaned_recordings", None)), (
        "rerun_bindings.flush_and_cleanup_orphaned_recordings is gone: "
        "find what frees the threads of closed streams now, or whether that is still needed"
    )


def test_nothing_is_left_of_closed_streams(tmp_path: Path) -> None:
    """Each stream and each layout's has threads; after the release there are none."""
    running = []
    for number in range(ROUNDS):
        drawn(tmp_path / f"{number}.rrd")
        rerun_files.release()
        running.append(threads())
    assert running[-1] <= running[0], f"rerun-sdk keeps threads of closed streams: {running}"


def test_the_release_is_still_needed(tmp_path: Path) -> None:
    """Else this room can go: the SDK would free closed streams by itself."""
    before = threads()
    for number in range(ROUNDS):
        drawn(tmp_path / f"{number}.rrd")
    kept = threads() - before
    rerun_files.release()
    assert kept >= ROUNDS, "rerun-sdk frees closed streams by itself now: remove `release`"
    assert threads() <= before + 1
