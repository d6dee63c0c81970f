"""A full or read-only disk, or write errors: the traffic is unaffected, and every loss is counted.

The disks are small file systems in memory, visible only to this process and its children. They need
root or a user namespace: see `make test-net`.
"""

import re
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from disk import Disk
from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sources.mcap_records import McapSummary, read_records

FULL = "No space left on device"


@pytest.fixture
def disk(plant: Any) -> Disk:
    return Disk(plant.out)


def unaffected(plant: Any) -> bool:
    """Return whether no client was disconnected, and no reply was missing or wrong."""
    return [len(talker.sessions) for talker in plant.talkers] == [1] * len(plant.talkers)


def reported_bytes(plant: Any) -> list[tuple[int, int, int]]:
    """Return received, recorded and missing bytes of each direction, reported at the end."""
    words = r"(\d+) bytes received and forwarded = (\d+) recorded \+ (\d+) in \d+ gaps"
    found = re.findall(words, plant.log.read_text())
    return [(int(received), int(recorded), int(lost)) for received, recorded, lost in found]


def interruptions(out: Path) -> list[str]:
    """Return the notes of interruptions in the files, in order; each file is complete."""
    found = []
    for file in sorted(out.glob("*.mcap"), key=lambda file: file.stat().st_mtime_ns):
        summary = McapSummary()
        for _ in read_records(file, summary):
            pass
        assert summary.whole, f"{file}: {summary.notes}"
        with file.open("rb") as opened:
            reported_bytes = {
                each.name: each.metadata for each in make_reader(opened).iter_metadata()
            }
        found.append(reported_bytes["session"].get("interrupted", ""))
    return found


def check_accounts(plant: Any, recorded: Callable[[Path], Any]) -> int:
    """Compare the files with the bytes of the clients; return the number of lost bytes."""
    found = recorded(plant.out)
    for session in plant.sessions:
        for way, passed in session.bytes.items():
            assert len(found[session.client][way].data) == len(passed)
            assert found[session.client][way].matches(passed)
    received = [sum(len(s.bytes[way]) for s in plant.sessions) for way in Direction]
    lost = [
        sum(end - begin for s in plant.sessions for begin, end in found[s.client][way].lost)
        for way in Direction
    ]
    assert reported_bytes(plant) == [(a, a - b, b) for a, b in zip(received, lost, strict=True)]
    return sum(lost)


@pytest.mark.network
@pytest.mark.parametrize("options", [(), ("--rotate", "1h")])
def test_a_full_disk(
    plant: Any, disk: Disk, recorded: Callable[[Path], Any], options: tuple[str, ...]
) -> None:
    """The link continues, the recording continues when there is space, and no bytes are missing."""
    plant.recorder.start(*options)
    plant.talk(2)
    plant.wait_for_recording()
    disk.fill()
    plant.wait_for_output("writing is stalled, ", " waiting: ", FULL)
    plant.wait_for_replies(500)
    disk.clear()
    plant.wait_for_output("writing continues")
    plant.wait_for_replies(500)
    plant.stop_clients()
    assert plant.recorder.end() == 0
    assert unaffected(plant)
    assert plant.log.read_text().count("writing is interrupted: ") == 1
    assert "writing continues: nothing was written since 20" in plant.log.read_text()
    before, after = interruptions(disk.folder)
    assert not before
    assert after.startswith("nothing was written since 20")
    assert FULL in after
    assert check_accounts(plant, recorded) == 0


@pytest.mark.network
def test_a_full_disk_with_the_spool(
    plant: Any, disk: Disk, recorded: Callable[[Path], Any]
) -> None:
    """If memory has no space for the spool, bytes are lost, and every one is counted."""
    (disk.folder / ".spool").mkdir(mode=0o700)
    plant.recorder.start()
    plant.talk(2)
    plant.wait_for_recording()
    disk.fill()
    plant.wait_for_replies(500)
    disk.clear()
    plant.wait_for_output("gaps so far")
    plant.wait_for_replies(500)
    plant.stop_clients()
    assert plant.recorder.end() == 3
    assert unaffected(plant)
    assert check_accounts(plant, recorded) > 0


@pytest.mark.network
def test_a_read_only_disk(tmp_path: Path) -> None:
    """The recorder refuses it at the start."""
    disk = Disk(tmp_path)
    disk.allow_writing(allowed=False)
    record = ("record", "tcp://127.0.0.1:1", "--listen", "127.0.0.1:0", "--out", disk.folder)
    done = subprocess.run(
        [sys.executable, "-m", "scaraspec", *record], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.endswith(f" to {disk.folder}: Read-only file system\n")


@pytest.mark.network
@pytest.mark.parametrize("truncated", [True, False])
def test_recovering_on_a_full_disk(
    tmp_path: Path, shift: list[WireEvent], *, truncated: bool
) -> None:
    """A truncated file that cannot be repaired is unchanged; a complete one gets no .rrd file."""
    disk = Disk(tmp_path)
    capture = tmp_path / "capture.mcap"
    sink = McapSink(capture.open("wb"))
    for event in shift:
        sink.write(event)
    sink.close({})
    if truncated:
        capture.write_bytes(capture.read_bytes()[:-100])
    before = capture.read_bytes()
    disk.fill()
    done = subprocess.run(
        [sys.executable, "-m", "scaraspec", "recover", capture],
        capture_output=True,
        text=True,
        check=False,
    )
    if truncated:
        assert done.returncode == 2
        why = f"{FULL}; free some disk space"
        assert (
            done.stderr == f"scaraspec: {capture} cannot be repaired and was not changed: {why}\n"
        )
    else:
        assert done.returncode == 0
        drawn = capture.with_suffix(".rrd")
        assert done.stdout.splitlines()[1].startswith(f"  {drawn} was not written: ")
        assert "Traceback" not in done.stderr
    assert capture.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"capture.mcap", "ballast"}


def test_write_errors(plant: Any, recorded: Callable[[Path], Any]) -> None:
    """A write error ends the file, which is repaired; the next file continues."""
    plant.recorder.start()
    plant.talk(2)
    plant.wait_for_recording()
    size_bytes = (plant.out / "capture.mcap").stat().st_size + 1000
    resource.prlimit(plant.recorder.child("writer"), resource.RLIMIT_FSIZE, (size_bytes,) * 2)
    plant.wait_for_output("writing is interrupted: ")
    plant.wait_for_output("writing continues")
    plant.wait_for_replies(100)
    plant.stop_clients()
    assert plant.recorder.end() == 0
    assert unaffected(plant)
    before, after = interruptions(plant.out)
    assert not before
    assert after.endswith(" UTC: File too large")
    assert "file_sink" not in plant.log.read_text(), "what is said once is said again by rerun"
    assert check_accounts(plant, recorded) == 0
