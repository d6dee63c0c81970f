"""The forecast of disk space, from the growth of the files."""

from pathlib import Path

import pytest

from scaraspec_recorder.recordings.forecast import AFTER_NS, Forecast
from scaraspec_recorder.units import Limits, parse_limits

NOW_NS = 1_795_708_800 * 10**9  # 2026-11-26T16:00:00Z, a Thursday
NO_LIMIT = Limits()


class Folder:
    """A folder of recordings, and a clock."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.now_ns = 0

    def write(self, name: str, size_bytes: int) -> None:
        with (self.path / name).open("wb") as file:
            file.truncate(size_bytes)

    def forecast(self, keep: Limits, free_bytes: int) -> Forecast:
        return Forecast(self.path, keep, lambda: free_bytes, lambda: self.now_ns)


@pytest.mark.parametrize(
    ("keep", "free_bytes", "expected"),
    [
        (parse_limits("30d,20GB"), 10**12, "20 GB of --keep are reached on Saturday, 2026-11-28"),
        (NO_LIMIT, 3_600_000_000, "the disk is full on Friday, 2026-11-27"),
        (parse_limits("20GB"), 3_600_000_000, "the disk is full on Friday, 2026-11-27"),
        (parse_limits("1d"), 10**12, ""),
        (NO_LIMIT, 10**15, ""),
    ],
)
def test_the_forecast(tmp_path: Path, keep: Limits, free_bytes: int, expected: str) -> None:
    """Once, after ten minutes: the rate with and without .rrd, and the first limit."""
    folder = Folder(tmp_path)
    folder.write("2026-11-20T23-59-59Z_line-3.mcap", 5_000_000_000)
    folder.write("of-others.mcap", 7_000_000_000)
    forecast = folder.forecast(keep, free_bytes)
    folder.write("2026-11-26T16-00-00Z_line-3.mcap", 26_000_000)
    folder.write("2026-11-26T16-00-00Z_line-3.rrd", 24_000_000)
    folder.now_ns = AFTER_NS - 1
    assert not forecast.text(NOW_NS)
    folder.now_ns = AFTER_NS
    text = "7.2 GB a day, 3.7 GB with --no-rrd"
    assert forecast.text(NOW_NS) == (f"{text}; {expected}" if expected else text)
    assert not forecast.text(NOW_NS)


def test_the_forecast_of_an_idle_link(tmp_path: Path) -> None:
    """No limit is ever reached."""
    folder = Folder(tmp_path)
    forecast = folder.forecast(parse_limits("20GB"), 10**12)
    folder.now_ns = AFTER_NS
    assert forecast.text(NOW_NS) == "0 bytes a day"
