"""Retention removes the oldest complete recordings and notes each removal."""

import errno
import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.recording_stats import RecordingSummary
from scaraspec_recorder.recordings.retention import Retention
from scaraspec_recorder.sinks.clock_watch import ClockWatch
from scaraspec_recorder.sinks.file_names import INDEX_NAME
from scaraspec_recorder.units import SECOND_NS, Limits, parse_limits

HOUR_NS = 3600 * SECOND_NS
NOW_NS = 1_795_215_517 * SECOND_NS
MB = 1_000_000


class Disk:
    """A folder with recordings on a disk with a given free space."""

    def __init__(self, folder: Path) -> None:
        self.index = RecordingIndex(folder)
        self.index.save()
        self.free_bytes = self.protect_ns = 0
        self.archived: tuple[str, ...] | None = None

    def add(self, name: str, *, age_h: int, size_mb: int = 1, marked: bool = False) -> None:
        """Add a recording of two files that ended at this age."""
        end_ns = NOW_NS - age_h * HOUR_NS
        files = (f"{name}.mcap", f"{name}.rrd")
        for file in files:
            (self.index.folder / file).touch()
        begin_ns = end_ns - HOUR_NS
        mark_ns = end_ns - 60 * SECOND_NS if marked else 0
        entry = RecordingSummary(files[0], files, size_mb * MB, begin_ns, end_ns)
        self.index.add(replace(entry, first_mark_ns=mark_ns, last_mark_ns=mark_ns))

    def enforce(self, keep: str = "", *, min_free_mb: int = 0, written_mb: int = 0) -> bool:
        limits = parse_limits(keep) if keep else Limits()
        archived = self.archived
        retention = Retention(
            self.index,
            limits,
            min_free_mb * MB,
            self._free,
            protect_ns=self.protect_ns,
            archived=None if archived is None else lambda: archived,
        )
        return retention.enforce(NOW_NS, written_mb * MB)

    def _free(self) -> int:
        return self.free_bytes

    @property
    def remaining(self) -> list[str]:
        """Return the complete remaining recordings."""
        folder = self.index.folder
        remaining = sorted(path.stem for path in folder.glob("*.mcap"))
        assert remaining == sorted(path.stem for path in folder.glob("*.rrd"))
        assert remaining == sorted(Path(name).stem for name in self.index.entries)
        return remaining

    @property
    def removed(self) -> list[tuple[str, str]]:
        """Return the removals in the index."""
        table = (self.index.folder / INDEX_NAME).read_text().splitlines()
        lines = [json.loads(line) for line in table]
        return [(line["removed"], line["reason"]) for line in lines if "removed" in line]


@pytest.fixture
def disk(tmp_path: Path) -> Disk:
    """Create three recordings of 1 MB, one for each of three days."""
    disk = Disk(tmp_path)
    disk.add("b", age_h=48)
    disk.add("a", age_h=72)
    disk.add("c", age_h=24)
    return disk


def test_recordings_near_a_mark_are_protected(disk: Disk) -> None:
    """The marked one and its neighbours are kept until the disk has no other recording."""
    disk.add("d", age_h=120)
    disk.add("e", age_h=119, marked=True)
    disk.add("f", age_h=118)
    disk.protect_ns = 5 * 60 * SECOND_NS
    assert disk.enforce("1h,1MB")
    assert disk.remaining == ["e", "f"]  # d ends 59 min before the mark
    disk.add("g", age_h=1)
    assert not disk.enforce(min_free_mb=5)
    assert [name for name, _ in disk.removed[-3:]] == ["g.mcap", "e.mcap", "f.mcap"]


def test_a_mark_in_the_open_file_protects_its_neighbours(disk: Disk) -> None:
    """It is not in the index yet."""
    disk.protect_ns = 24 * HOUR_NS
    retention = Retention(disk.index, parse_limits("1h"), 0, lambda: 0, protect_ns=disk.protect_ns)
    retention.enforce(NOW_NS, 0, [(NOW_NS, NOW_NS), (0, 0)])
    assert disk.remaining == ["c"]


def test_without_limits_all_is_kept(disk: Disk) -> None:
    """All recordings are kept by default."""
    assert disk.enforce()
    assert disk.remaining == ["a", "b", "c"]


def test_old_recordings_are_removed(disk: Disk, caplog: pytest.LogCaptureFixture) -> None:
    """The end of the recording counts; the removal is in the log and in the index."""
    disk.enforce("2d")
    assert disk.remaining == ["b", "c"]
    assert disk.removed == [("a.mcap", "older than 2 d")]
    folder = disk.index.folder
    assert caplog.messages == [
        f"removed {folder / name}: older than 2 d" for name in ("a.mcap", "a.rrd")
    ]


def test_a_symbolic_link_is_not_removed(disk: Disk, caplog: pytest.LogCaptureFixture) -> None:
    """Someone has replaced a recording by it."""
    link = disk.index.folder / "a.mcap"
    link.unlink()
    link.symlink_to("b.mcap")
    disk.enforce("2d")
    assert link.is_symlink()
    assert list(disk.index.entries) == ["b.mcap", "c.mcap"]
    assert caplog.messages[0] == f"{link} is not removed: it is a symbolic link"


def test_a_file_that_another_program_has_open(
    disk: Disk, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """On Windows it cannot be removed: the next one is, and it is removed later."""
    unlink = Path.unlink

    def refused(path: Path, *, missing_ok: bool = False) -> None:
        if path.stem == "oldest":
            raise PermissionError(errno.EACCES, "it is used by another process", f"{path}")
        unlink(path, missing_ok=missing_ok)

    for name, age_h in (("oldest", 9), ("old", 8), ("new", 1)):
        disk.add(name, age_h=age_h, size_mb=10)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", refused)
        for _ in range(2):
            assert disk.enforce("20MB")
    assert disk.remaining == ["new", "oldest"]
    assert "oldest.mcap cannot be removed now: it is used by another process" in caplog.text
    assert disk.enforce("10MB")
    assert disk.remaining == ["new"]


def test_the_oldest_are_removed_until_the_size_fits(disk: Disk) -> None:
    """The current recording counts and is not removed."""
    disk.enforce("3MB")
    assert disk.remaining == ["a", "b", "c"]
    disk.enforce("3MB", written_mb=2)
    assert disk.remaining == ["c"]
    assert disk.removed == [("a.mcap", "more than 3 MB"), ("b.mcap", "more than 3 MB")]
    disk.enforce("3MB", written_mb=9)
    assert disk.remaining == []


def test_the_oldest_are_removed_until_the_disk_has_space(disk: Disk) -> None:
    """By their sizes: a file system may free the space later."""
    disk.free_bytes = 3 * MB
    assert disk.enforce(min_free_mb=5)
    assert disk.remaining == ["c"]
    assert disk.removed == [
        ("a.mcap", "less than 5 MB free on the disk"),
        ("b.mcap", "less than 5 MB free on the disk"),
    ]


def test_a_disk_filled_by_other_files(disk: Disk) -> None:
    """The result is False if no more recordings can be removed."""
    assert not disk.enforce(min_free_mb=9)
    assert disk.remaining == []
    disk.free_bytes = 9 * MB
    assert disk.enforce(min_free_mb=9)


def test_a_missing_file_is_ignored(disk: Disk) -> None:
    """Another process has removed it."""
    for path in disk.index.folder.glob("a.*"):
        path.unlink()
    disk.enforce("2d")
    assert disk.remaining == ["b", "c"]


@pytest.mark.parametrize("hours", [24, -24])
def test_after_a_step_of_the_clock_only_sizes_count(disk: Disk, hours: int) -> None:
    """The ages of all recordings are unknown."""
    elapsed_ns = 5 * HOUR_NS
    wall_ns = [NOW_NS]
    clock = ClockWatch(lambda: wall_ns[0], lambda: elapsed_ns, lambda: elapsed_ns)
    retention = Retention(disk.index, parse_limits("4d,2MB"), 0, lambda: 0, clock)
    wall_ns[0] += hours * HOUR_NS
    for _ in range(2):
        retention.enforce(wall_ns[0])
    assert disk.removed == [("a.mcap", "more than 2 MB")]


@pytest.mark.parametrize("noticed", [True, False])
def test_another_process_knows_of_a_step(disk: Disk, *, noticed: bool) -> None:
    """Whether the process before noticed the step, or had ended."""
    wall_ns = [NOW_NS]
    clocks = (lambda: wall_ns[0], lambda: 5 * HOUR_NS, lambda: 5 * HOUR_NS)
    first = ClockWatch(*clocks)
    wall_ns[0] += 24 * HOUR_NS
    if noticed:
        first.step_ns()
        wall_ns[0] += HOUR_NS // 2
    second = ClockWatch(*clocks, before=first.state)
    Retention(disk.index, parse_limits("1h"), 0, lambda: 0, second).enforce(wall_ns[0])
    assert disk.remaining == ["a", "b", "c"]


def test_a_recording_from_before_the_clock_was_set(tmp_path: Path) -> None:
    """Its age is unknown, also to a recorder that starts later."""
    disk = Disk(tmp_path)
    disk.add("a", age_h=NOW_NS // HOUR_NS - 2)
    disk.enforce("1d")
    assert disk.remaining == ["a"]


def test_a_clock_set_back_removes_nothing_by_age(tmp_path: Path) -> None:
    """A recording that ended in the future is not old."""
    disk = Disk(tmp_path)
    disk.add("future", age_h=-9999)
    disk.enforce("1h")
    assert disk.remaining == ["future"]


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.integers(0, 99), st.integers(0, 9)), max_size=8),
    st.integers(0, 30),
)
def test_the_newest_that_fit_are_kept(
    tmp_path_factory: pytest.TempPathFactory, files: list[tuple[int, int]], keep_mb: int
) -> None:
    """No kept recording is older than a removed one, and no more than necessary are removed."""
    disk = Disk(tmp_path_factory.mktemp("disk"))
    for number, (age_h, size_mb) in enumerate(files):
        disk.add(f"{number}", age_h=age_h, size_mb=size_mb)
    recordings = dict(disk.index.entries)
    disk.enforce(f"{max(keep_mb, 1)}MB")
    remaining = list(disk.index.entries.values())
    gone = [recordings[name] for name, _ in disk.removed]
    assert len(remaining) + len(gone) == len(recordings)
    size = sum(entry.size_bytes for entry in remaining)
    assert size <= max(keep_mb, 1) * MB
    if gone:
        assert all(e.begin_ns >= gone[-1].begin_ns for e in remaining)
        assert size + gone[-1].size_bytes > max(keep_mb, 1) * MB


def test_recordings_that_are_not_archived_are_kept(disk: Disk) -> None:
    """Limits of age and size remove only what is archived."""
    disk.archived = ("b.mcap",)
    disk.enforce("1h,0.5MB")
    assert disk.remaining == ["a", "c"]


def test_a_full_disk_removes_recordings_that_are_not_archived(
    disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    """After all others, also after those near a mark; the log and the index say so."""
    disk.protect_ns = SECOND_NS
    disk.add("d", age_h=1, marked=True)
    disk.archived = ("d.mcap",)
    assert disk.enforce(min_free_mb=2)
    assert disk.remaining == ["b", "c"]
    least = "less than 2 MB free on the disk"
    assert disk.removed == [("d.mcap", least), ("a.mcap", f"{least}, although not archived")]
    assert f"a.mcap: {least}, although not archived" in caplog.text
