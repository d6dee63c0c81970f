"""The oldest complete recordings go first, nothing goes unsaid, and nothing else goes."""

import json
import logging
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scaraspec_recorder.keeping.contents import FILE_NAME, Contents
from scaraspec_recorder.keeping.retention import Keep, Retention, parse_keep
from scaraspec_recorder.keeping.tally import Entry
from scaraspec_recorder.quantities import SECOND_NS, Limits, QuantityError, parse_limits

HOUR_NS = 3600 * SECOND_NS
NOW_NS = 1_795_215_517 * SECOND_NS
MB = 1_000_000


class Disk:
    """A folder with recordings in it, and a disk that is as full as it is told."""

    def __init__(self, folder: Path) -> None:
        self.contents = Contents(folder)
        self.contents.save()
        self.free_bytes = 0

    def add(self, name: str, *, age_h: int, size_mb: int = 1, trigger: str = "") -> None:
        """A recording of two files that ended so long ago."""
        end_ns = NOW_NS - age_h * HOUR_NS
        files = (f"{name}.mcap", f"{name}.rrd")
        for file in files:
            (self.contents.folder / file).touch()
        begin_ns = end_ns - HOUR_NS
        self.contents.add(Entry(files[0], files, size_mb * MB, begin_ns, end_ns, trigger=trigger))

    def enforce(self, keep: str = "", *, min_free_mb: int = 0, written_mb: int = 0) -> bool:
        limits = parse_keep(keep) if keep else Keep()
        retention = Retention(self.contents, limits, min_free_mb * MB, self._free)
        return retention.enforce(NOW_NS, written_mb * MB)

    def _free(self) -> int:
        return self.free_bytes

    @property
    def left(self) -> list[str]:
        """The recordings that are left, whole ones only."""
        folder = self.contents.folder
        left = sorted(path.stem for path in folder.glob("*.mcap"))
        assert left == sorted(path.stem for path in folder.glob("*.rrd"))
        assert left == sorted(Path(name).stem for name in self.contents.entries)
        return left

    @property
    def removed(self) -> list[tuple[str, str]]:
        """What the table of contents says of removals."""
        table = (self.contents.folder / FILE_NAME).read_text().splitlines()
        lines = [json.loads(line) for line in table]
        return [(line["removed"], line["reason"]) for line in lines if "removed" in line]


@pytest.fixture
def disk(tmp_path: Path) -> Disk:
    """Three recordings of 1 MB and an incident, one each of four days, the incident the oldest."""
    disk = Disk(tmp_path)
    disk.add("b", age_h=48)
    disk.add("a", age_h=72)
    disk.add("c", age_h=24)
    disk.add("incident", age_h=96, trigger="code:12")
    return disk


def test_nothing_goes_where_nothing_is_said(disk: Disk) -> None:
    """By default all is kept."""
    assert disk.enforce()
    assert disk.left == ["a", "b", "c", "incident"]


def test_what_is_too_old_goes(disk: Disk, caplog: pytest.LogCaptureFixture) -> None:
    """By its end; it is logged, and noted in the table of contents. An incident stays."""
    caplog.set_level(logging.INFO)
    disk.enforce("2d")
    assert disk.left == ["b", "c", "incident"]
    assert disk.removed == [("a.mcap", "older than 2 days")]
    assert [record.message for record in caplog.records] == ["removed a.mcap: older than 2 days"]


def test_the_oldest_go_until_the_rest_is_small_enough(disk: Disk) -> None:
    """What is being written counts, and does not go."""
    disk.enforce("3MB")
    assert disk.left == ["a", "b", "c", "incident"]
    disk.enforce("3MB", written_mb=2)
    assert disk.left == ["c", "incident"]
    assert disk.removed == [("a.mcap", "more than 3 MB"), ("b.mcap", "more than 3 MB")]
    disk.enforce("3MB", written_mb=9)
    assert disk.left == ["incident"]


def test_the_oldest_go_until_enough_of_the_disk_is_free(disk: Disk) -> None:
    """As many as are needed, by their sizes: a file system may free them later."""
    disk.free_bytes = 3 * MB
    assert disk.enforce(min_free_mb=5)
    assert disk.left == ["c", "incident"]
    assert disk.removed == [
        ("a.mcap", "less than 5 MB free on the disk"),
        ("b.mcap", "less than 5 MB free on the disk"),
    ]


def test_a_disk_that_others_fill_is_told(disk: Disk) -> None:
    """Where all that may go has gone; an incident may not."""
    assert not disk.enforce(min_free_mb=9)
    assert disk.left == ["incident"]
    disk.free_bytes = 9 * MB
    assert disk.enforce(min_free_mb=9)


def test_incidents_go_by_limits_of_their_own(disk: Disk) -> None:
    """And recordings not by theirs."""
    disk.enforce("incidents:95h")
    assert disk.left == ["a", "b", "c"]
    assert disk.removed == [("incident.mcap", "older than 3.95833 days")]
    disk.add("other", age_h=1, size_mb=5, trigger="signal")
    disk.enforce("50h,incidents:4MB")
    assert disk.left == ["b", "c"]


def test_a_file_that_is_gone_already_is_no_trouble(disk: Disk) -> None:
    """Somebody was faster."""
    for path in disk.contents.folder.glob("a.*"):
        path.unlink()
    disk.enforce("2d")
    assert disk.left == ["b", "c", "incident"]


def test_a_clock_that_was_set_back_removes_nothing_by_age(tmp_path: Path) -> None:
    """What ended in the future is not old."""
    disk = Disk(tmp_path)
    disk.add("future", age_h=-9999)
    disk.enforce("1h")
    assert disk.left == ["future"]


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.integers(0, 99), st.integers(0, 9), st.booleans()), max_size=8),
    st.integers(0, 30),
)
def test_what_is_kept_is_the_youngest_that_fit(
    tmp_path_factory: pytest.TempPathFactory, files: list[tuple[int, int, bool]], keep_mb: int
) -> None:
    """Whatever lies there: nothing that is kept is older than what went, and no more went."""
    disk = Disk(tmp_path_factory.mktemp("disk"))
    for number, (age_h, size_mb, incident) in enumerate(files):
        disk.add(f"{number}", age_h=age_h, size_mb=size_mb, trigger="signal" if incident else "")
    recordings = {e.name: e for e in disk.contents.entries.values() if not e.trigger}
    disk.enforce(f"{max(keep_mb, 1)}MB")
    left = [e for e in disk.contents.entries.values() if not e.trigger]
    gone = [recordings[name] for name, _ in disk.removed]
    assert len(left) + len(gone) == len(recordings)
    size = sum(entry.size_bytes for entry in left)
    assert size <= max(keep_mb, 1) * MB
    if gone:
        assert all(e.begin_ns >= gone[-1].begin_ns for e in left)
        assert size + gone[-1].size_bytes > max(keep_mb, 1) * MB


def test_limits_are_read() -> None:
    """Of recordings, of incidents, or of both."""
    assert parse_keep("30d") == Keep(parse_limits("30d"))
    assert parse_keep("30d,20GB") == Keep(Limits(720 * HOUR_NS, 20_000 * MB))
    assert parse_keep("incidents:1GB") == Keep(incidents=Limits(size_bytes=1000 * MB))
    assert parse_keep("30d, incidents:90d,1GB") == Keep(
        parse_limits("30d"), Limits(90 * 24 * HOUR_NS, 1000 * MB)
    )


@pytest.mark.parametrize("text", ["", "for ever", "30d,", "incidents:", "30d incidents:", "30"])
def test_nonsense_is_one_sentence(text: str) -> None:
    """And not a recording removed by mistake."""
    with pytest.raises(QuantityError, match=r" is neither a duration such as 1h nor a size such"):
        parse_keep(text)
