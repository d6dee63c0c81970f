"""Rows of captures, through the Python interface."""

from pathlib import Path

import pytest

from scaraspec.api import open_capture
from scaraspec.api.captures import Capture


@pytest.fixture
def capture(fixtures_dir: Path) -> Capture:
    return open_capture(fixtures_dir / "captures" / "field" / "complaint-3.pcapng")


def test_exchanges(capture: Capture) -> None:
    login, name, *_ = capture.exchanges()
    assert (login.number, login.command, login.arguments) == (1, "login", "(password)")
    assert (name.command, name.reply, name.accepted, name.code) == ("upload_name", "ok", True, None)
    assert name.latency_s
    assert 0 < name.latency_s < 0.001


def test_transfers_and_findings(capture: Capture) -> None:
    """The capture of a file that comes back damaged."""
    upload, download = capture.transfers()
    assert (upload.upload, download.upload, upload.size_bytes) == (True, False, 76800)
    (finding,) = capture.findings()
    assert (finding.requirement, finding.verdict, finding.side) == ("5.2/12", "fail", "controller")
    assert finding.connection == "1"


def test_losses(fixtures_dir: Path) -> None:
    """The length of a loss is None if it is not known."""
    truncated = open_capture(fixtures_dir / "captures" / "field" / "plant-a-torn.pcapng")
    lengths = [loss.length_bytes for loss in truncated.losses()]
    assert None in lengths
    assert 8 in lengths
    assert truncated.notes == ("packets not in the order of time: 2",)


def test_arrow_table(capture: Capture) -> None:
    table = capture.table("exchanges")
    assert table.num_rows == 771
    assert f"{table.schema.field('time').type}" == "timestamp[ns, tz=UTC]"
    assert table.schema.metadata[b"schema"] == b"scaraspec.tables/1"


def test_a_recording_in_progress(fixtures_dir: Path, tmp_path: Path) -> None:
    """It is read on while it grows, and has the same exchanges as the whole file."""
    source = fixtures_dir / "captures" / "cases" / "lz4-compressed.mcap"
    content = source.read_bytes()
    growing = tmp_path / "growing.mcap"
    growing.write_bytes(content[:4000])
    parts = [content[4000:9000], content[9000:]]

    def wait() -> bool:
        if not parts:
            return False
        with growing.open("ab") as file:
            file.write(parts.pop(0))
        return True

    followed = [*open_capture(growing, wait=wait).exchanges()]
    whole = [*open_capture(source).exchanges()]
    assert [row.number for row in followed] == [row.number for row in whole]
    assert not parts
