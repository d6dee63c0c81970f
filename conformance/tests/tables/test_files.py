"""Files of tables."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import pytest

from scaraspec.tables.files import TableFolder, json_line, table_folders, utc_text
from scaraspec.tables.schema import LossRow

LOSS = LossRow(
    file="a.mcap",
    connection="1",
    time_ns=1_700_000_000_123_456_789,
    direction="C2A",
    offset_bytes=7,
    length_bytes=None,
    reason="the disk was full",
)


def test_times_have_nanoseconds() -> None:
    assert utc_text(LOSS.time_ns) == "2023-11-14T22:13:20.123456789Z"
    assert utc_text(-1) == "1969-12-31T23:59:59.999999999Z"


def test_json_names_the_table() -> None:
    assert json_line(LOSS) == (
        '{"table": "losses", "file": "a.mcap", "connection": "1", '
        '"time": "2023-11-14T22:13:20.123456789Z", "direction": "C2A", "offset_bytes": 7, '
        '"length_bytes": null, "reason": "the disk was full"}'
    )


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@x", "\tx"])
def test_no_text_is_a_formula_in_a_spreadsheet(tmp_path: Path, text: str) -> None:
    with table_folders([(tmp_path, "csv")], ["losses"]) as (tables,):
        tables.add(replace(LOSS, reason=text))
    with (tmp_path / "losses.csv").open(encoding="utf-8-sig", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["reason"] == f"'{text}"
    assert row["length_bytes"] == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_full_disk_is_reported_with_the_file(tmp_path: Path, suffix: str) -> None:
    """The file is replaced by a device that is always full, as when the disk fills up."""
    path = tmp_path / f"losses.{suffix}"
    tables = TableFolder(tmp_path, suffix, ("losses",))
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, tables._tables["losses"].file.fileno())
    os.close(full)
    tables.add(LOSS)
    with pytest.raises(OSError, match="No space left") as raised:
        tables.close()
    assert raised.value.filename == str(path)
