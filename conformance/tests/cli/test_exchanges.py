"""`scaraspec exchanges`: the dialogue in a capture as text and as tables."""

import csv
import json
import struct
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq  # type: ignore[import-untyped]  # it ships no types
import pytest
from click.testing import CliRunner, Result

from scaraspec.cli.main import group
from scaraspec.tables.schema import TABLES, columns

EMPTY_PCAP = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)


@pytest.fixture
def field(fixtures_dir: Path) -> Path:
    return fixtures_dir / "captures" / "field"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(group, ["exchanges", *map(str, arguments)])


def lines_of(result: Result) -> list[str]:
    assert result.exit_code == 0, result.output
    return result.stdout.splitlines()


def json_of(result: Result) -> list[dict[str, object]]:
    return [json.loads(line) for line in lines_of(result)]


def test_the_dialogue(field: Path) -> None:
    """The day, then lines with time, connection, side, request, replies and duration."""
    shown = lines_of(run(field / "plant-a-morning-shift.pcapng"))
    assert shown[0] == "2026-11-20 (UTC)"
    assert "22:58:37.676468  1  client      login (password) → ok (0.1 ms)" in shown
    assert (
        "22:58:37.681349  1  client      run_program pick.rob → accepted → done (2.02 s)" in shown
    )
    assert any(line.endswith("reset → refused 01 running a program (0.1 ms)") for line in shown)


def test_findings_follow_what_they_are_about(field: Path) -> None:
    shown = lines_of(run(field / "complaint-3.pcapng", "--no-queries"))
    position = shown.index(
        "22:59:01.590319  1  client      download of big.bin complete: 76800 bytes"
    )
    assert shown[position + 1].startswith("    fail 5.2/12: the download of big.bin differs")
    assert not any("upload_chunk" in line for line in shown)


def test_filters(field: Path) -> None:
    """Each filter leaves what it names; together they leave what all of them name."""
    shift = field / "plant-a-morning-shift.pcapng"
    commands = json_of(run(shift, "--json", "--command", "jog,reset"))
    assert {row["command"] for row in commands if row["table"] == "exchanges"} == {"jog", "reset"}
    second = json_of(run(shift, "--json", "--connection", "2"))
    assert {row["connection"] for row in second if row["table"] != "files"} == {"2"}
    since, until = "2026-11-20T22:58:40.237", "2026-11-20T22:58:40.879"
    between = json_of(run(shift, "--json", "--since", since, "--until", until))
    times = [f"{row['time']}" for row in between if row["table"] == "exchanges"]
    assert times
    assert all(since <= time < f"{until}Z" for time in times)


def test_tables_in_every_format(field: Path, tmp_path: Path) -> None:
    """JSON, CSV and Parquet have the same rows and the columns of the schema."""
    capture, folder = field / "complaint-1.pcapng", tmp_path / "tables"
    rows = json_of(run(capture, "--json", "--frames"))
    assert run(capture, "--csv", folder, "--parquet", folder, "--frames").exit_code == 0
    for name in TABLES:
        names = [column.name for column in columns(name)]
        parquet = pq.read_table(folder / f"{name}.parquet")
        with (folder / f"{name}.csv").open(encoding="utf-8-sig", newline="") as file:
            table = [*csv.DictReader(file)]
        assert parquet.column_names == names
        assert not table or [*table[0]] == names
        expected = [row for row in rows if row["table"] == name]
        assert parquet.num_rows == len(table) == len(expected)
        for row, stored in zip(expected, table, strict=True):
            assert [_cell(row[each]) for each in names] == [stored[each] for each in names]


def _cell(value: object) -> str:
    """A value of JSON as it is in CSV."""
    if isinstance(value, bool):
        return f"{value}".lower()
    return "" if value is None else f"{value}"


def test_latencies(field: Path) -> None:
    shown = lines_of(run(field / "plant-a-morning-shift.pcapng", "--latency"))
    assert shown[0].split() == ["command", "stage", "count", "p50", "p95", "p99", "max"]
    stages = [line.split()[1:4] for line in shown if line.startswith("run_program")]
    assert stages == [["first", "reply", "3"], ["final", "result", "2"]]


def test_an_incomplete_capture(field: Path) -> None:
    """The dialogue is shown, the losses are lines of it, and the exit status is 3."""
    result = run(field / "plant-a-torn.pcapng")
    assert result.exit_code == 3
    assert "8 bytes from the controller are missing: not captured" in result.stdout
    assert "not in the order of time" in result.stderr
    assert run(field / "plant-a-torn.pcapng", "--command", "run_program").exit_code == 3


def test_a_capture_without_traffic(tmp_path: Path) -> None:
    """Nothing was read, which is not success."""
    capture = tmp_path / "empty.pcap"
    capture.write_bytes(EMPTY_PCAP)
    result = run(capture)
    assert result.exit_code == 4
    assert "no TCP connection on port 8877" in result.stderr


def test_existing_files_stay(field: Path, tmp_path: Path, refused: Callable[..., str]) -> None:
    """A file of the user is not overwritten, and no other file is left."""
    (tmp_path / "sessions.csv").write_text("mine")
    message = refused("exchanges", str(field / "complaint-1.pcapng"), "--csv", str(tmp_path))
    assert message == f"scaraspec: {tmp_path / 'sessions.csv'} exists: name another folder\n"
    assert [file.name for file in tmp_path.glob("*.csv")] == ["sessions.csv"]
    assert (tmp_path / "sessions.csv").read_text() == "mine"


def test_a_folder_that_cannot_be_used(
    field: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    """The files in the other folder are removed: they would have no rows."""
    (tmp_path / "taken").touch()
    options = ("--csv", str(tmp_path / "csv"), "--parquet", str(tmp_path / "taken"))
    refused("exchanges", str(field / "complaint-1.pcapng"), *options)
    assert not list((tmp_path / "csv").iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--command", "fly"), "'fly' is not a command: see scaraspec call --help."),
        (
            ("--since", "noon"),
            "'noon' is not a time: write 2026-11-21T08:15:30.5, or Unix seconds.",
        ),
    ],
)
def test_invalid_options(field: Path, arguments: tuple[str, ...], message: str) -> None:
    result = run(field / "complaint-1.pcapng", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr


def test_only_recordings_can_be_followed(field: Path, refused: Callable[..., str]) -> None:
    message = refused("exchanges", str(field / "complaint-1.pcapng"), "--follow")
    assert message.endswith("is no MCAP recording: only a recording can be followed\n")
