"""`scaraspec audit` of several captures, of a rotated recording, and of a part of a capture."""

import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from traffic_notation import script

from scaraspec.api import auditing
from scaraspec.api.audits import find_captures
from scaraspec.cli.main import group
from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Finding
from scaraspec.report.model import Results
from scaraspec.traffic.events import TrafficEvent
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sinks.open_connections import OpenConnections

__all__ = ["script"]

SET_THEN_GET = """
    login
    > set_default_program a.rob
    < set_default_program 1
    > get_default_program
    < get_default_program b.rob
"""
"""Another default program is reported than the one that was set, which violates 4.13/3."""


@pytest.fixture
def field(fixtures_dir: Path) -> Path:
    return fixtures_dir / "captures" / "field"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(group, ["audit", *map(str, arguments)])


def write(path: Path, events: Iterable[WireEvent]) -> None:
    decoder = Decoder([McapSink(path.open("wb"))], Judge())
    for event in events:
        decoder.write(event)
    decoder.close()


@pytest.fixture
def rotated(tmp_path: Path, script: Callable[[str], list[WireEvent]]) -> Path:
    """A folder with a recording in two files, as rotation writes them."""
    events, connections = script(SET_THEN_GET), OpenConnections()
    middle = len(events) // 2
    for event in events[:middle]:
        connections.update(event)
    again = connections.reopening_events(events[middle].time_ns)
    write(tmp_path / "2026-11-20T08-00-00Z_line-3.mcap", events[:middle])
    write(tmp_path / "2026-11-20T09-00-00Z_line-3.mcap", [*again, *events[middle:]])
    return tmp_path


def test_captures_are_listed_with_the_gravest_first(field: Path) -> None:
    result = run(field)
    *lines, total = result.stdout.splitlines()
    assert [line.partition(" · ")[0] for line in lines] == [
        *["nonconformant"] * 4,
        "inconclusive",
        *["no violation found"] * 3,
    ]
    assert "complaint-3.pcapng · 1 fail, 56 pass · 5.2/12: the download of big.bin" in result.stdout
    assert total == "8 captures: 4 nonconformant, 1 inconclusive, 3 no violation found"
    assert result.exit_code == 1
    assert "plant-a-torn.pcapng: packets not in the order of time: 2\n" in result.stderr


def test_a_file_that_cannot_be_read_is_listed(field: Path, tmp_path: Path) -> None:
    """The other captures are judged, and the exit status is 3."""
    shutil.copy(field / "plant-a-morning-shift.pcapng", tmp_path)
    (tmp_path / "torn.mcap").write_bytes(b"\x89MCAP0\r\n")
    result = run(tmp_path)
    first, second, total = result.stdout.splitlines()
    assert first.startswith(f"not judged · {tmp_path / 'torn.mcap'} · ")
    assert second.startswith("no violation found · ")
    assert total == "2 captures: 1 not judged, 1 no violation found"
    assert result.exit_code == 3


def test_patterns_and_compressed_files(field: Path, tmp_path: Path) -> None:
    """A pattern need not be expanded by the shell; other files of a folder are ignored."""
    assert len(find_captures([field / "complaint-*.pcapng"])) == 4
    for name in ("a.pcapng.gz", "b.PCAP", "c.rrd", "notes.txt", "d.mcap"):
        (tmp_path / name).touch()
    found = [file.name for (file,) in find_captures([tmp_path])]
    assert found == ["a.pcapng.gz", "b.PCAP", "d.mcap"]


def test_the_files_of_a_recording_are_judged_together(rotated: Path) -> None:
    """A violation of which each file has a half is found."""
    parts = sorted(rotated.glob("*.mcap"))
    assert find_captures([rotated]) == [tuple(parts)]
    assert [run(part).exit_code for part in parts] == [0, 0]
    result = run(rotated)
    assert result.exit_code == 1
    assert "4.13/3" in result.stdout
    assert f"{parts[0]} … {parts[1].name}" in result.stdout


def test_a_missing_file_of_a_recording(rotated: Path) -> None:
    """Files that do not continue each other are judged alone."""
    first, second = sorted(rotated.glob("*.mcap"))
    other = rotated / "2026-11-20T10-00-00Z_line-3.mcap"
    shutil.copy(first, other)
    assert find_captures([rotated]) == [(first, second), (other,)]


def test_a_part_of_a_capture(field: Path, tmp_path: Path) -> None:
    """Requirements, commands, connections and times limit what is judged."""
    capture, output = field / "complaint-3.pcapng", tmp_path / "results.json"

    def judged(*options: str) -> tuple[int, set[str]]:
        result = run(capture, *options, "--json", output)
        return result.exit_code, {case.id for case in Results.read(output).cases}

    everything = judged()[1]
    assert judged("--only", "5.2/12") == (1, {"5.2/12"})
    status, ids = judged("--command", "login")
    assert status == 0
    assert ids < everything
    assert judged("--until", "2026-11-20T22:59:01.59")[0] == 0
    assert judged("--since", "2026-11-20T22:59:01.59")[0] == 1
    assert judged("--connection", "2") == (4, set())


def test_the_printed_command_repeats_the_options(field: Path, tmp_path: Path) -> None:
    output = tmp_path / "results.json"
    since = "2026-11-20T22:59:01.590000000Z"
    options = ("--since", since, "--command", "download_name,upload_name", "--only", "5.2")
    run(field / "complaint-3.pcapng", *options, "--json", output)
    (case,) = [each for each in Results.read(output).cases if each.id == "5.2/12"]
    assert f"--only 5.2 --since {since} --command download_name,upload_name" in case.replay


def test_interrupted(field: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was found before Ctrl-C is printed, and the exit status is 3."""

    class Interrupted(Judge):
        def feed(self, event: WireEvent) -> Iterator[TrafficEvent | Finding]:
            if event.offset_bytes > 500:
                raise KeyboardInterrupt
            return super().feed(event)

    monkeypatch.setattr(auditing, "Judge", Interrupted)
    result = run(field / "plant-a-morning-shift.pcapng")
    assert result.stdout.startswith("Interrupted: the rest of the capture was not judged.\n")
    assert "requirements in scope judged" in result.stdout
    assert result.exit_code == 3


def test_one_output_file_for_several_captures(
    field: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    message = refused("audit", str(field), "--html", str(tmp_path / "report.html"))
    assert "--json and --html write the results of one capture, but there are 8" in message
    assert not (tmp_path / "report.html").exists()


def test_a_folder_without_captures(tmp_path: Path, refused: Callable[..., str]) -> None:
    assert "has no capture" in refused("audit", str(tmp_path))
    assert "has no capture" in refused("audit", str(tmp_path / "*.mcap"))
