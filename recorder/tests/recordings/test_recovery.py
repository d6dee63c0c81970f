"""Repair of the recording of an earlier recorder without rotation, before the next one writes."""

import errno
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings import recovery
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.recordings.recovery import sink_after_repair
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sinks.sink import OutputFolder, Sink
from scaraspec_recorder.sources.mcap_reader import read_mcap


def make(folder: OutputFolder) -> Sink:
    return capture_sink(folder, draw=False)


@pytest.fixture
def unfinished(tmp_path: Path, shift: list[WireEvent]) -> Path:
    """Return a recording that was not closed."""
    path = tmp_path / "capture.mcap"
    sink = McapSink(path.open("wb"))
    for event in shift:
        sink.write(event)
    sink.close({})
    path.write_bytes(path.read_bytes()[:-9])
    return path


@pytest.mark.parametrize(
    ("content", "reported"),
    [(b"", True), (b"RRF2 of scaraspec, torn", True), (b"of another program", False)],
)
def test_an_incomplete_rrd_file_is_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, content: bytes, *, reported: bool
) -> None:
    """Beside a good recording; the recording remains."""
    make(OutputFolder(tmp_path, [])).close()
    (tmp_path / "capture.rrd").write_bytes(content)
    sink_after_repair(OutputFolder(tmp_path, []), make=make).close()
    capture = tmp_path / "capture.mcap"
    expected = f"capture.rrd is incomplete: scaraspec recover {capture} writes it again"
    assert [line.endswith(expected) for line in caplog.messages] == [True] * reported


def test_an_incomplete_rrd_file_without_its_recording_is_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """One of another program is not."""
    drawn = tmp_path / "earlier.rrd"
    drawn.write_bytes(b"RRF2 of scaraspec, torn")
    (tmp_path / "other.rrd").write_bytes(b"RRF2 of another program")
    sink_after_repair(OutputFolder(tmp_path, []), make=make).close()
    expected = f"its .mcap file is missing: scaraspec recover {drawn} repairs it"
    assert [line.endswith(expected) for line in caplog.messages] == [True]


def test_the_start_waits_for_disk_space(
    unfinished: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Without space nothing can be repaired or recorded."""
    with monkeypatch.context() as full:

        def refuse(_: Path) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        full.setattr(recovery, "repair", refuse)
        full.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=0))
        with pytest.raises(OSError, match="No space left"):
            sink_after_repair(OutputFolder(unfinished.parent, []), make=make)
        assert [path.name for path in unfinished.parent.iterdir()] == [unfinished.name]
        full.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=10**6))
        sink_after_repair(OutputFolder(unfinished.parent, []), make=make).close()
        assert caplog.messages == ["not repaired: [Errno 28] No space left on device"]
    sink_after_repair(OutputFolder(unfinished.parent, []), make=make).close()
    assert caplog.messages[1].startswith(f"repaired {unfinished}: the file was not closed")
    assert list(read_mcap(unfinished))
