"""`scaraspec convert`: a capture in another format, and back."""

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fault_captures import write

from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sources.capture import open_capture
from scaraspec_recorder.sources.mcap_reader import read_mcap

SHIFT = "plant-a-morning-shift"


@pytest.fixture
def field(fixtures_dir: Path) -> Path:
    """Captures from the field."""
    return fixtures_dir / "captures" / "field"


def streams(file: Path) -> dict[tuple[str, Any], bytes]:
    """The bytes of each connection and direction, with their times."""
    found: dict[tuple[str, Any], bytes] = defaultdict(bytes)
    for event in open_capture(file, port=None):
        if event.kind is Kind.BYTES:
            found[event.connection, event.direction] += event.data
    return found


def test_packets_become_a_recording_and_packets_again(
    processes: Any, field: Path, tmp_path: Path
) -> None:
    """pcapng to MCAP to pcapng: the same bytes in each stream, and the same findings."""
    source, recording = field / f"{SHIFT}.pcapng", tmp_path / "a.mcap"
    packets = tmp_path / "b.pcapng"
    for arguments in ((source, recording), (recording, packets)):
        done = processes.run("convert", *map(str, arguments))
        assert (done.returncode, done.stderr) == (0, "")
    assert streams(source) == streams(recording) == streams(packets)
    assert processes.run("audit", str(packets)).returncode == 0


def test_session_metadata_is_kept(processes: Any, field: Path, tmp_path: Path) -> None:
    """MCAP to MCAP keeps the metadata about link and subject."""
    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    known = {"subject": "client", "subject.time_scale": "2", "link": "serial"}
    decoder = Decoder([McapSink(source.open("wb"), known)], Judge())
    for event in open_capture(field / f"{SHIFT}.pcapng", port=None):
        decoder.write(event)
    decoder.close()
    assert processes.run("convert", f"{source}", f"{target}").returncode == 0
    assert read_mcap(target).session == read_mcap(source).session
    assert known.items() <= read_mcap(target).session.items()


@pytest.mark.usefixtures("viewer")
def test_a_picture(processes: Any, field: Path, tmp_path: Path) -> None:
    """pcapng to rrd gives a complete file for the viewer."""
    drawn = tmp_path / "a.rrd"
    assert processes.run("convert", str(field / f"{SHIFT}.pcapng"), str(drawn)).returncode == 0
    assert b"RRF2FOOT" in drawn.read_bytes()[-12:]


def test_a_truncated_file_is_converted(processes: Any, field: Path, tmp_path: Path) -> None:
    """A file that is cut off is converted up to the cut, with a notice and exit status 3."""
    complete, truncated = tmp_path / "whole.mcap", tmp_path / "torn.mcap"
    processes.run("convert", str(field / f"{SHIFT}.pcapng"), str(complete))
    truncated.write_bytes(complete.read_bytes()[:-100])
    done = processes.run("convert", str(truncated), str(tmp_path / "c.pcapng"))
    assert done.returncode == 3
    assert "was not closed" in done.stderr
    assert (tmp_path / "c.pcapng").exists()


def test_packets_in_another_order(processes: Any, fixtures_dir: Path, tmp_path: Path) -> None:
    """No bytes are missing, so that the result is complete."""
    source = fixtures_dir / "captures" / "cases" / "two-packets-swapped.pcap"
    done = processes.run("convert", f"{source}", f"{tmp_path / 'a.mcap'}")
    assert (done.returncode, "not in the order of time: 1" in done.stderr) == (0, True)


@pytest.mark.parametrize(
    ("source", "target", "message"),
    [
        (f"{SHIFT}.pcapng", "there.mcap", "exists"),
        (f"{SHIFT}.pcapng", "out.pcap", "has no known suffix"),
        (f"{SHIFT}.pcapng", "none/out.mcap", "cannot be written"),
        ("none.pcapng", "out.mcap", "No such file"),
    ],
)
def test_usage(  # noqa: PLR0913, PLR0917 - three fixtures and three parameters
    refused: Callable[..., str], field: Path, tmp_path: Path, source: str, target: str, message: str
) -> None:
    """Usage errors are reported; no file is overwritten or left over."""
    (tmp_path / "there.mcap").write_text("mine")
    assert message in refused("convert", str(field / source), str(tmp_path / target))
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize(
    ("size_bytes", "name"),
    [(10, f"{SHIFT}.pcapng"), (3000, f"{SHIFT}.pcapng"), (1 << 20, "plant-a-torn.pcapng")],
)
def test_what_is_incomplete_is_so_for_every_command(
    processes: Any, field: Path, tmp_path: Path, size_bytes: int, name: str
) -> None:
    """A torn file, and a whole one in which packets are missing."""
    file = tmp_path / "a.pcapng"
    file.write_bytes((field / name).read_bytes()[:size_bytes])
    statuses = [
        processes.run(*line.split()).returncode
        for line in (f"audit {file}", f"convert {file} {tmp_path}/b.mcap", f"exchanges {file}")
    ]
    assert statuses == [3, 3, 3]


def test_the_replay_of_an_incomplete_capture(
    processes: Any, fixtures_dir: Path, tmp_path: Path
) -> None:
    """All replies are as recorded, but the rest of the file is missing."""
    whole = (fixtures_dir / "captures" / "cases" / "reply-then-reset.pcap").read_bytes()
    host, port = processes.controller()
    statuses = []
    for name, content in (("whole", whole), ("torn", whole[:-5])):
        file = tmp_path / f"{name}.pcap"
        file.write_bytes(content)
        statuses.append(processes.run("replay", f"{file}", f"tcp://{host}:{port}").returncode)
    assert statuses == [0, 3]


@pytest.mark.parametrize("suffix", ["mcap", "pcapng"])
def test_an_excerpt_for_others(processes: Any, field: Path, tmp_path: Path, suffix: str) -> None:
    """It holds a span of time; earlier bytes are a gap, and passwords are masked."""
    source, target = field / f"{SHIFT}.pcapng", tmp_path / f"a.{suffix}"
    span = ("--since", "2026-11-20T22:58:38", "--until", "2026-11-20T22:58:41.6")
    assert processes.run("convert", f"{source}", f"{target}", *span, "--redact").returncode == 0
    done = processes.run("exchanges", f"{target}")
    assert done.returncode == 3
    lines = done.stdout.splitlines()
    assert "127.0.0.1:51124 → 127.0.0.1:8877" in lines[1]
    assert "get_running_program" in lines[3]
    assert "connection 3 half-closed" in lines[-1]
    assert b"password" not in b"".join(streams(target).values())
    audited = processes.run("audit", f"{target}")
    assert (audited.returncode, "fail" in audited.stdout) == (3, False)


def test_masked_passwords_cause_no_failure(processes: Any, tmp_path: Path) -> None:
    """A refused password of the same length looks like the accepted one."""
    source, target = tmp_path / "a.pcapng", tmp_path / "b.pcapng"
    session = "> login right\n< login 1\n> login wrong\n< login 0\n> login right\n< login 1"
    write(session, source)
    assert processes.run("convert", f"{source}", f"{target}", "--redact").returncode == 0
    assert processes.run("audit", f"{target}").returncode == 0


def test_an_empty_excerpt(processes: Any, field: Path, tmp_path: Path) -> None:
    """Nothing is written."""
    source, target = field / f"{SHIFT}.pcapng", tmp_path / "a.mcap"
    done = processes.run("convert", f"{source}", f"{target}", "--since", "2027-01-01T00:00")
    assert (done.returncode, target.exists()) == (2, False)
    assert "has no traffic in this time" in done.stderr
