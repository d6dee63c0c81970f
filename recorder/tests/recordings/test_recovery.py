"""What a recorder without rotation left is repaired before the next one writes."""

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
def torn(tmp_path: Path, shift: list[WireEvent]) -> Path:
    """A recording that was not ended."""
    path = tmp_path / "capture.mcap"
    sink = McapSink(path.open("wb"))
    for event in shift:
        sink.write(event)
    sink.close({})
    path.write_bytes(path.read_bytes()[:-9])
    return path


def test_a_full_disk_is_waited_for(
    torn: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Nothing can be repaired, nor recorded; else the file would stay torn behind the recording."""
    with monkeypatch.context() as full:

        def refuse(_: Path) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        full.setattr(recovery, "repair", refuse)
        full.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=0))
        with pytest.raises(OSError, match="No space left"):
            sink_after_repair(OutputFolder(torn.parent, []), make=make)
        assert [path.name for path in torn.parent.iterdir()] == [torn.name]
        full.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=10**6))
        sink_after_repair(OutputFolder(torn.parent, []), make=make).close()
        assert caplog.messages == ["not repaired: [Errno 28] No space left on device"]
    sink_after_repair(OutputFolder(torn.parent, []), make=make).close()
    assert caplog.messages[1].startswith(f"repaired {torn}: the file was not closed")
    assert list(read_mcap(torn))
