"""A disk that fills up, is read-only, or refuses: traffic is unharmed, and the books are right.

The disks are small file systems in memory, which only this process and what it starts can see. To
make them takes root, or a user namespace: see `make test-net`.
"""

import ctypes
import os
import re
import resource
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sources.mcap_reader import McapSummary, read_records

DISK_BYTES = 16 << 20
FULL = "No space left on device"

_CLONE_NEWNS = 0x20000
_MS_RDONLY, _MS_REMOUNT, _MS_REC, _MS_PRIVATE = 0x1, 0x20, 0x4000, 0x40000
_libc = ctypes.CDLL(None, use_errno=True)


def _mount(kind: str, where: Path, flags: int, options: str = "") -> None:
    arguments = (kind.encode(), str(where).encode(), kind.encode(), flags, options.encode())
    if _libc.mount(*arguments):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), str(where))


class Disk:
    """A small file system where the recorder writes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._ballast = folder / "ballast"
        if _libc.unshare(_CLONE_NEWNS):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        _mount("none", Path("/"), _MS_REC | _MS_PRIVATE)
        _mount("tmpfs", folder, 0, f"size={DISK_BYTES}")

    def fill(self) -> None:
        """Leave no room."""
        with self._ballast.open("ab", buffering=0) as file, suppress(OSError):
            while True:
                file.write(bytes(4096))

    def clear(self) -> None:
        """Leave room again."""
        self._ballast.unlink()

    def allow_writing(self, *, allowed: bool) -> None:
        flags = _MS_REMOUNT | (0 if allowed else _MS_RDONLY)
        _mount("tmpfs", self.folder, flags, f"size={DISK_BYTES}")


@pytest.fixture
def disk(plant: Any) -> Disk:
    return Disk(plant.out)


def unharmed(plant: Any) -> bool:
    """Whether no client was ever cut off, and no answer was missing or wrong."""
    return [len(talker.sessions) for talker in plant.talkers] == [1] * len(plant.talkers)


def told(plant: Any) -> list[tuple[int, int, int]]:
    """Received, recorded and missing bytes of each direction, as the recorder says at its end."""
    words = r"(\d+) bytes received and forwarded = (\d+) recorded \+ (\d+) in \d+ gaps"
    found = re.findall(words, plant.log.read_text())
    return [(int(received), int(recorded), int(lost)) for received, recorded, lost in found]


def interruptions(out: Path) -> list[str]:
    """What files say of themselves, in their order; each is whole."""
    found = []
    for file in sorted(out.glob("*.mcap"), key=lambda file: file.stat().st_mtime_ns):
        summary = McapSummary()
        for _ in read_records(file, summary):
            pass
        assert summary.whole, f"{file}: {summary.notes}"
        with file.open("rb") as opened:
            told = {each.name: each.metadata for each in make_reader(opened).iter_metadata()}
        found.append(told["session"].get("interrupted", ""))
    return found


def books_are_right(plant: Any, recorded: Callable[[Path], Any]) -> int:
    """Hold the files against what clients know; return how many bytes are accounted as lost."""
    found = recorded(plant.out)
    for session in plant.sessions:
        for way, passed in session.bytes.items():
            assert len(found[session.client][way].data) == len(passed)
            assert found[session.client][way].holds(passed)
    received = [sum(len(s.bytes[way]) for s in plant.sessions) for way in Direction]
    lost = [
        sum(end - begin for s in plant.sessions for begin, end in found[s.client][way].lost)
        for way in Direction
    ]
    assert told(plant) == [(a, a - b, b) for a, b in zip(received, lost, strict=True)]
    return sum(lost)


@pytest.mark.network
@pytest.mark.parametrize("options", [(), ("--rotate", "1h")])
def test_a_disk_that_fills_up(
    plant: Any, disk: Disk, recorded: Callable[[Path], Any], options: tuple[str, ...]
) -> None:
    """The link goes on, the recording goes on when there is room, and nothing is missing in it."""
    plant.recorder.start(*options)
    plant.talk(2)
    plant.until_written()
    disk.fill()
    plant.until_said("writing is stalled, ", " waiting: ", FULL)
    plant.until_answered(500)
    disk.clear()
    plant.until_said("writing continues")
    plant.until_answered(500)
    plant.quiet()
    assert plant.recorder.end() == 0
    assert unharmed(plant)
    assert plant.log.read_text().count("writing is interrupted: ") == 1
    assert "writing continues: nothing was written since 20" in plant.log.read_text()
    before, after = interruptions(disk.folder)
    assert not before
    assert after.startswith("nothing was written since 20")
    assert FULL in after
    assert books_are_right(plant, recorded) == 0


@pytest.mark.network
def test_a_disk_that_fills_up_with_the_spool_on_it(
    plant: Any, disk: Disk, recorded: Callable[[Path], Any]
) -> None:
    """Where memory has no room for a spool, recording is lost, and every byte of that is told."""
    (disk.folder / ".spool").mkdir(mode=0o700)
    plant.recorder.start()
    plant.talk(2)
    plant.until_written()
    disk.fill()
    plant.until_answered(500)
    disk.clear()
    plant.until_said("gaps so far")
    plant.until_answered(500)
    plant.quiet()
    assert plant.recorder.end() == 3
    assert unharmed(plant)
    assert books_are_right(plant, recorded) > 0


@pytest.mark.network
def test_a_disk_that_is_read_only(plant: Any, disk: Disk, recorded: Callable[[Path], Any]) -> None:
    """The link works from the beginning; recording begins when it can, with the beginning."""
    disk.allow_writing(allowed=False)
    plant.recorder.start()
    plant.talk(2)
    plant.until_said("writing is stalled, ", " waiting: Read-only file system")
    plant.until_answered(200)
    disk.allow_writing(allowed=True)
    plant.until_said("writing continues")
    plant.quiet()
    assert plant.recorder.end() == 0
    assert unharmed(plant)
    (only,) = interruptions(disk.folder)
    assert only.endswith(" UTC: Read-only file system")
    assert books_are_right(plant, recorded) == 0


@pytest.mark.network
@pytest.mark.parametrize("torn", [True, False])
def test_recovering_on_a_full_disk(tmp_path: Path, shift: list[WireEvent], *, torn: bool) -> None:
    """A torn file that cannot be repaired stays as it was; a whole one just stays undrawn."""
    disk = Disk(tmp_path)
    capture = tmp_path / "capture.mcap"
    sink = McapSink(capture.open("wb"))
    for event in shift:
        sink.write(event)
    sink.close({})
    if torn:
        capture.write_bytes(capture.read_bytes()[:-100])
    before = capture.read_bytes()
    disk.fill()
    done = subprocess.run(
        [sys.executable, "-m", "scaraspec", "recover", capture],
        capture_output=True,
        text=True,
        check=False,
    )
    if torn:
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


def test_writes_that_the_system_refuses(plant: Any, recorded: Callable[[Path], Any]) -> None:
    """Any error of a write ends the file, which is mended and left; the next one goes on."""
    plant.recorder.start()
    plant.talk(2)
    plant.until_written()
    size_bytes = (plant.out / "capture.mcap").stat().st_size + 1000
    resource.prlimit(plant.recorder.child("writer"), resource.RLIMIT_FSIZE, (size_bytes,) * 2)
    plant.until_said("writing is interrupted: ")
    plant.until_said("writing continues")
    plant.until_answered(100)
    plant.quiet()
    assert plant.recorder.end() == 0
    assert unharmed(plant)
    before, after = interruptions(plant.out)
    assert not before
    assert after.endswith(" UTC: File too large")
    assert "file_sink" not in plant.log.read_text(), "what is said once is said again by rerun"
    assert books_are_right(plant, recorded) == 0
