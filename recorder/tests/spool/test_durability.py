"""What a power failure may cost: the spool and the files are written through in order."""

import os
from pathlib import Path

import pytest

from scaraspec.protocol.direction import A2C
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.sinks.sink import TICK_NS
from scaraspec_recorder.sinks.sink_runner import SinkRunner
from scaraspec_recorder.spool import locks
from scaraspec_recorder.spool.durability import BOUND_S, SpoolSync
from scaraspec_recorder.spool.locks import spool_folder
from scaraspec_recorder.spool.records import stream_number
from scaraspec_recorder.spool.spool import SpoolReader, SpoolWriter

STREAM = stream_number(1, A2C)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="folders cannot be opened")


class Device:
    """Records which files are written through, by name, and how large they were."""

    def __init__(self, folder: Path) -> None:
        self.steps: list[tuple[str, int]] = []
        self.error: OSError | None = None
        self._folder = folder

    def fsync(self, descriptor: int) -> None:
        if self.error:
            raise self.error
        found = os.fstat(descriptor)
        for path in (self._folder, *self._folder.rglob("*")):
            if path.stat().st_ino == found.st_ino:
                self.steps.append((path.name, found.st_size if path.is_file() else 0))

    def taken(self) -> list[str]:
        names, self.steps = [name for name, _ in self.steps], []
        return names


@pytest.fixture
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Device:
    made = Device(tmp_path)
    monkeypatch.setattr(os, "fsync", made.fsync)
    return made


def spool_writer(folder: Path) -> SpoolWriter:
    return SpoolWriter(folder, lambda _delay, _callback: None)


def test_only_what_has_grown_is_written_through(tmp_path: Path, device: Device) -> None:
    """And the folders when there is a new segment."""
    spool = tmp_path / ".spool"
    sync = SpoolSync(spool)
    writer = spool_writer(spool)
    writer.flush()
    sync.sync()
    assert device.taken() == ["1.spool", ".spool", tmp_path.name]
    sync.sync()
    assert device.taken() == []
    writer.append(Kind.OPENED, STREAM, 1, 0)
    writer.flush()
    sync.sync()
    assert device.taken() == ["1.spool"]


def test_a_slow_or_failing_disk_is_reported(
    tmp_path: Path, device: Device, caplog: pytest.LogCaptureFixture
) -> None:
    """Once a minute."""
    now_s = [0.0]
    spool = tmp_path / ".spool"
    sync = SpoolSync(spool, lambda: now_s[0])
    spool_writer(spool).flush()
    for pause_s in (0.5, BOUND_S + 1, BOUND_S + 1):
        now_s[0] += pause_s
        sync.sync()
    assert caplog.messages == ["a power failure would cost more than 1 s: the disk needed 2.0 s"]
    now_s[0] += 60
    device.error = OSError(5, "Input/output error")
    spool_writer(spool).flush()
    sync.sync()
    assert caplog.messages[1].endswith(": [Errno 5] Input/output error")


def test_files_are_written_through_before_the_spool_is_removed(
    tmp_path: Path, device: Device
) -> None:
    """A segment is removed only if the capture and the position are on the device."""
    spool, now_ns = tmp_path / ".spool", [1_000]
    writer = spool_writer(spool)
    writer.append(Kind.OPENED, STREAM, 1, 0)
    writer.close()
    reader = SpoolReader(spool, durable=True)
    sink = (lambda folder: capture_sink(folder, draw=False),)
    runner = SinkRunner(reader, tmp_path, sink, now_ns=lambda: now_ns[0], durable=True)
    now_ns[0] += TICK_NS
    runner.step()
    spool_writer(spool).close()  # a second segment: the first can be removed
    now_ns[0] += TICK_NS
    device.taken()
    while runner.step():
        pass
    runner.finish()
    order = ["capture.mcap", tmp_path.name, "checkpoint.json.new", ".spool"]
    assert device.steps[0][1] > 0
    assert device.taken()[-4:] == order
    assert [path.name for path in spool.glob("*.spool")] == ["2.spool"]
    reader.close()


def test_a_durable_spool_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Data in memory, of an earlier recorder, is not forgotten."""
    monkeypatch.setattr(locks, "_MEMORY", tmp_path)
    out = tmp_path / "out"
    in_memory = spool_folder(out, 1)
    assert in_memory.parent == tmp_path
    spool_writer(in_memory).flush()
    with pytest.raises(OSError, match="start once without --durable"):
        spool_folder(out, 1, durable=True)
    (in_memory / "1.spool").unlink()
    assert spool_folder(out, 1, durable=True) == out / ".spool"
