"""`scaraspec recover`: repair the files of a killed recorder, and report what was lost."""

from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

pytestmark = pytest.mark.usefixtures("viewer")


@pytest.fixture
def recording(processes: Any, fixtures_dir: Path, tmp_path: Path) -> Path:
    """A recording without its .rrd file."""
    source = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    path = tmp_path / "capture.mcap"
    assert processes.run("convert", str(source), str(path)).returncode == 0
    return path


def test_a_truncated_recording(processes: Any, recording: Path) -> None:
    """It reports kept and lost data and writes the .rrd; a second repair finds nothing to do."""
    recording.write_bytes(recording.read_bytes()[:-100])
    done = processes.run("recover", str(recording))
    assert done.returncode == 3, done.stderr
    first, *notes = done.stdout.splitlines()
    assert first.startswith(f"{recording}: repaired, ")
    assert "events, the last of 20" in first
    assert "was not closed" in notes[0]
    assert notes[-1] == f"  {recording.with_suffix('.rrd')} written again"
    again = processes.run("recover", str(recording))
    assert again.returncode == 0
    complete, note = again.stdout.splitlines()
    assert complete == first.replace("repaired", "whole")
    assert note.startswith("  the file was repaired earlier: the file was not closed")
    judged = processes.run("audit", str(recording))
    assert judged.returncode == 3 or "nonconformant" in judged.stdout
    assert "the file was repaired earlier" in judged.stderr


def test_a_damaged_recording_is_kept(processes: Any, fixtures_dir: Path, tmp_path: Path) -> None:
    """The repaired file has all messages; programs that read it later report the repair."""
    path = tmp_path / "capture.mcap"
    damaged = (fixtures_dir / "captures" / "cases" / "one-flipped-bit.mcap").read_bytes()
    path.write_bytes(damaged)
    done = processes.run("recover", str(path))
    assert done.returncode == 3, done.stderr
    assert f"the damaged file is kept as {path}.damaged" in done.stdout
    assert (tmp_path / "capture.mcap.damaged").read_bytes() == damaged
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary
    assert summary.statistics
    assert summary.statistics.message_count == 15005
    assert processes.run("recover", str(path)).returncode == 0
    judged = processes.run("audit", str(path))
    assert (judged.returncode, "was repaired earlier" in judged.stderr) == (3, True)


@pytest.mark.parametrize("name", ["lz4-compressed", "sequence-always-zero"])
def test_a_recording_of_another_writer(
    processes: Any, fixtures_dir: Path, tmp_path: Path, name: str
) -> None:
    """It needs no repair and is not changed."""
    path = tmp_path / "capture.mcap"
    content = (fixtures_dir / "captures" / "cases" / f"{name}.mcap").read_bytes()
    path.write_bytes(content)
    done = processes.run("recover", str(path))
    assert done.returncode == 0, done.stdout
    assert path.read_bytes() == content


@pytest.mark.parametrize("cut", [0, -40])
def test_a_truncated_rrd_file(processes: Any, recording: Path, cut: int) -> None:
    """A .rrd file that is missing or cut off is written again, which is not reported as a loss."""
    drawn = recording.with_suffix(".rrd")
    assert processes.run("recover", str(recording)).returncode == 0
    drawn.write_bytes(drawn.read_bytes()[:cut])
    done = processes.run("recover", str(recording))
    assert done.returncode == 0
    assert "written again" in done.stdout
    assert b"RRF2FOOT" in drawn.read_bytes()[-12:]
    assert sorted(path.name for path in recording.parent.iterdir()) == ["capture.mcap", drawn.name]


def test_a_truncated_rrd_file_without_its_recording(processes: Any, recording: Path) -> None:
    """What it contains remains, and the rest is reported as lost. A complete one is not changed."""
    drawn = recording.with_suffix(".rrd")
    processes.run("recover", str(recording))
    recording.unlink()
    whole = drawn.read_bytes()
    drawn.write_bytes(whole[: len(whole) // 2])
    done = processes.run("recover", str(drawn))
    assert (done.returncode, done.stderr) == (3, "")
    assert done.stdout == f"{drawn}: repaired, what followed its last part is lost\n"
    repaired = drawn.read_bytes()
    assert b"RRF2FOOT" in repaired[-12:]
    done = processes.run("recover", str(drawn))
    assert (done.returncode, done.stdout) == (0, f"{drawn}: whole\n")
    assert drawn.read_bytes() == repaired


def test_an_rrd_file_of_another_program(processes: Any, tmp_path: Path) -> None:
    """It is refused and not changed."""
    drawn = tmp_path / "other.rrd"
    drawn.write_bytes(b"RRF2 of another program")
    done = processes.run("recover", str(drawn))
    assert done.returncode == 3
    assert f"{drawn} is not an MCAP file" in done.stderr
    assert drawn.read_bytes() == b"RRF2 of another program"


def test_an_unrepairable_file_does_not_stop_the_others(processes: Any, recording: Path) -> None:
    """One sentence reports it, the others are repaired, and the exit status is 3."""
    empty = recording.with_name("empty.mcap")
    empty.touch()
    done = processes.run("recover", str(empty), str(recording))
    assert done.returncode == 3
    assert done.stderr == f"scaraspec: {empty} is empty: nothing was recorded\n"
    assert done.stdout.startswith(f"{recording}: whole")


def test_a_recording_in_progress_is_not_repaired(processes: Any, recording: Path) -> None:
    """A recording in progress is not repaired, because that would replace the recorder's file."""
    recorder = processes.start(
        *("record", "tcp://127.0.0.1:9", "--listen", "127.0.0.1:0"),
        *("--out", str(recording.parent)),
    )
    recorder.stdout.readline()
    done = processes.run("recover", str(recording))
    assert done.returncode == 2
    assert "a recorder writes into" in done.stderr
    recorder.terminate()
    recorder.communicate(timeout=60)


def test_a_missing_file(processes: Any, tmp_path: Path) -> None:
    """A name without a file is a usage error."""
    done = processes.run("recover", str(tmp_path / "none.mcap"))
    assert done.returncode == 2
    assert "is not a file" in done.stderr


def test_audit_checks_the_byte_counts(processes: Any, recording: Path, fixtures_dir: Path) -> None:
    """A file whose bytes differ from its own byte counts is not whole."""
    source = fixtures_dir / "captures" / "field" / "plant-a-morning-shift.pcapng"
    shift = recording.with_name("shift.mcap")
    processes.run("convert", str(source), str(shift))
    data = shift.read_bytes()
    found = data.index(b"sha256_recorded") + len(b"sha256_recorded") + 4
    other = b"f" if data[found : found + 1] == b"0" else b"0"
    shift.write_bytes(data[:found] + other + data[found + 1 :])
    done = processes.run("audit", str(shift))
    assert done.returncode == 3
    assert "1 streams are not what the file's own accounts say" in done.stderr
    assert done.stdout.startswith("no violation found in what was recorded (the file is not whole)")
