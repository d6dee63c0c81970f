"""The oldest complete recordings go first, nothing goes unsaid, and nothing else goes."""

import json
import logging
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scaraspec_recorder.recordings.recording_index import FILE_NAME, RecordingIndex
from scaraspec_recorder.recordings.recording_stats import RecordingSummary
from scaraspec_recorder.recordings.retention import Retention
from scaraspec_recorder.units import SECOND_NS, Limits, parse_limits

HOUR_NS = 3600 * SECOND_NS
NOW_NS = 1_795_215_517 * SECOND_NS
MB = 1_000_000


class Disk:
    """A folder with recordings in it, and a disk that is as full as it is told."""

    def __init__(self, folder: Path) -> None:
        self.index = RecordingIndex(folder)
        self.index.save()
        self.free_bytes = 0

    def add(self, name: str, *, age_h: int, size_mb: int = 1) -> None:
        """A recording of two files that ended so long ago."""
        end_ns = NOW_NS - age_h * HOUR_NS
        files = (f"{name}.mcap", f"{name}.rrd")
        for file in files:
            (self.index.folder / file).touch()
        begin_ns = end_ns - HOUR_NS
        self.index.add(RecordingSummary(files[0], files, size_mb * MB, begin_ns, end_ns))

    def enforce(self, keep: str = "", *, min_free_mb: int = 0, written_mb: int = 0) -> bool:
        limits = parse_limits(keep) if keep else Limits()
        retention = Retention(self.index, limits, min_free_mb * MB, self._free)
        return retention.enforce(NOW_NS, written_mb * MB)

    def _free(self) -> int:
        return self.free_bytes

    @property
    def left(self) -> list[str]:
        """The recordings that are left, whole ones only."""
        folder = self.index.folder
        left = sorted(path.stem for path in folder.glob("*.mcap"))
        assert left == sorted(path.stem for path in folder.glob("*.rrd"))
        assert left == sorted(Path(name).stem for name in self.index.entries)
        return left

    @property
    def removed(self) -> list[tuple[str, str]]:
        """What the table of contents says of removals."""
        table = (self.index.folder / FILE_NAME).read_text().splitlines()
        lines = [json.loads(line) for line in table]
        return [(line["removed"], line["reason"]) for line in lines if "removed" in line]


@pytest.fixture
def disk(tmp_path: Path) -> Disk:
    """Three recordings of 1 MB, one each of three days."""
    disk = Disk(tmp_path)
    disk.add("b", age_h=48)
    disk.add("a", age_h=72)
    disk.add("c", age_h=24)
    return disk


def test_nothing_goes_where_nothing_is_said(disk: Disk) -> None:
    """By default all is kept."""
    assert disk.enforce()
    assert disk.left == ["a", "b", "c"]


def test_what_is_too_old_goes(disk: Disk, caplog: pytest.LogCaptureFixture) -> None:
    """By its end; it is logged, and noted in the table of contents."""
    caplog.set_level(logging.INFO)
    disk.enforce("2d")
    assert disk.left == ["b", "c"]
    assert disk.removed == [("a.mcap", "older than 2 days")]
    assert [record.message for record in caplog.records] == ["removed a.mcap: older than 2 days"]


def test_the_oldest_go_until_the_rest_is_small_enough(disk: Disk) -> None:
    """What is being written counts, and does not go."""
    disk.enforce("3MB")
    assert disk.left == ["a", "b", "c"]
    disk.enforce("3MB", written_mb=2)
    assert disk.left == ["c"]
    assert disk.removed == [("a.mcap", "more than 3 MB"), ("b.mcap", "more than 3 MB")]
    disk.enforce("3MB", written_mb=9)
    assert disk.left == []


def test_the_oldest_go_until_enough_of_the_disk_is_free(disk: Disk) -> None:
    """As many as are needed, by their sizes: a file system may free them later."""
    disk.free_bytes = 3 * MB
    assert disk.enforce(min_free_mb=5)
    assert disk.left == ["c"]
    assert disk.removed == [
        ("a.mcap", "less than 5 MB free on the disk"),
        ("b.mcap", "less than 5 MB free on the disk"),
    ]


def test_a_disk_that_others_fill_is_told(disk: Disk) -> None:
    """Where all that may go has gone."""
    assert not disk.enforce(min_free_mb=9)
    assert disk.left == []
    disk.free_bytes = 9 * MB
    assert disk.enforce(min_free_mb=9)


def test_a_file_that_is_gone_already_is_no_trouble(disk: Disk) -> None:
    """Somebody was faster."""
    for path in disk.index.folder.glob("a.*"):
        path.unlink()
    disk.enforce("2d")
    assert disk.left == ["b", "c"]


def test_a_clock_that_was_set_back_removes_nothing_by_age(tmp_path: Path) -> None:
    """What ended in the future is not old."""
    disk = Disk(tmp_path)
    disk.add("future", age_h=-9999)
    disk.enforce("1h")
    assert disk.left == ["future"]


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.integers(0, 99), st.integers(0, 9)), max_size=8),
    st.integers(0, 30),
)
def test_what_is_kept_is_the_youngest_that_fit(
    tmp_path_factory: pytest.TempPathFactory, files: list[tuple[int, int]], keep_mb: int
) -> None:
    """Whatever lies there: nothing that is kept is older than what went, and no more went."""
    disk = Disk(tmp_path_factory.mktemp("disk"))
    for number, (age_h, size_mb) in enumerate(files):
        disk.add(f"{number}", age_h=age_h, size_mb=size_mb)
    recordings = dict(disk.index.entries)
    disk.enforce(f"{max(keep_mb, 1)}MB")
    left = list(disk.index.entries.values())
    gone = [recordings[name] for name, _ in disk.removed]
    assert len(left) + len(gone) == len(recordings)
    size = sum(entry.size_bytes for entry in left)
    assert size <= max(keep_mb, 1) * MB
    if gone:
        assert all(e.begin_ns >= gone[-1].begin_ns for e in left)
        assert size + gone[-1].size_bytes > max(keep_mb, 1) * MB
