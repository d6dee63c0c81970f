"""`scaraspec compare` with two captures."""

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from traffic_notation import script

from scaraspec.cli.main import group
from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink

__all__ = ["script"]

SESSION = """
    login
    > get_version
    < get_version 1.0.0
    > get_motor_temperatures
    < get_motor_temperatures 30|30|30|30
    > get_time
    < get_time 20261126080000
    > run_program a.rob
    < run_program 1
    > get_status
    < get_status 01
    <90 run_program 11
    > get_tool_coordinates
    < get_tool_coordinates 200|300|324|34.6|34.5|0
    > reset
    < reset 0|11
"""


SECTION_HEADER_BYTES = 164
"""The first block of the pcapng captures, before any packet."""


@pytest.fixture
def compared(tmp_path: Path, script: Callable[[str], list[WireEvent]]) -> Callable[..., Result]:
    """Compare the session with one in which some lines are replaced."""

    def write(name: str, session: str) -> Path:
        path = tmp_path / name
        decoder = Decoder([McapSink(path.open("wb"))], Judge())
        for event in script(session):
            decoder.write(event)
        decoder.close()
        return path

    def run(*replaced: tuple[str, str]) -> Result:
        session = SESSION
        for old, new in replaced:
            assert old in session
            session = session.replace(old, new)
        before, after = write("before.mcap", SESSION), write("after.mcap", session)
        page = tmp_path / "page.md"
        return CliRunner().invoke(
            group, ["compare", f"{before}", f"{after}", "--summary", f"{page}"]
        )

    return run


@pytest.mark.parametrize(
    "replaced",
    [
        ("20261126080000", "20261127091500"),
        ("temperatures 30|30|30|30", "temperatures 33|28|30|31"),
        ("200|300|324|34.6|34.5|0", "200.1|300|324|34.6|34.5|0"),
        ("    > get_status\n    < get_status 01\n", ""),
        ("    < get_version 1.0.0\n", "    < get_version 1.0.0\n    +20\n"),
    ],
)
def test_equal_behaviour(compared: Callable[..., Result], replaced: tuple[str, str]) -> None:
    """Times, temperatures and poses within their tolerance, and the number of queries."""
    result = compared(replaced)
    assert result.exit_code == 0, result.output
    assert "no difference" in result.output


@pytest.mark.parametrize(
    ("replaced", "line"),
    [
        (
            ("reset 0|11", "reset 1\n    <90 reset 11"),
            "answered differently · reset · refused 11 ",
        ),
        (
            ("<90 run_program 11", "<90 run_program 00|12"),
            "accepted → done -> accepted → failed 12",
        ),
        (("temperatures 30|", "temperatures 36|"), "replies · get_motor_temperatures · "),
        (("version 1.0.0", "version 1.0.1"), "replies · get_version · 1.0.0 -> 1.0.1"),
        (("    > reset\n    < reset 0|11\n", ""), "request · reset · refused 11"),
        (("200|300|324", "200|300|325"), "replies · get_tool_coordinates · "),
        (
            ("<90 run_program 11", "<90 run_program 11\n    <90 run_program 11"),
            "new failure · 3/18",
        ),
    ],
)
def test_differences(
    compared: Callable[..., Result], tmp_path: Path, replaced: tuple[str, str], line: str
) -> None:
    result = compared(replaced)
    assert result.exit_code == 1, result.output
    assert line in result.output
    assert "the behaviour differs" in result.output
    assert (tmp_path / "page.md").read_text("utf-8").startswith("### scaraspec: comparison\n")


def test_latencies_are_side_by_side(compared: Callable[..., Result]) -> None:
    result = compared()
    assert "latency · get_version · p50 1 ms, p99 1 ms, 1 times -> p50 1 ms" in result.output


def test_a_loss_is_no_difference(fixtures_dir: Path) -> None:
    """Requests that were captured are compared; replies beside a loss are not."""
    field = fixtures_dir / "captures" / "field"
    files = [str(field / f"plant-a-{name}.pcapng") for name in ("morning-shift", "torn")]
    result = CliRunner().invoke(group, ["compare", *files])
    assert "answered differently" not in result.output
    assert "request · shutdown" not in result.output


@pytest.mark.parametrize(
    ("kept", "status", "line"),
    [
        (slice(-1), 3, "no difference in what was recorded"),
        (slice(SECTION_HEADER_BYTES), 4, "no traffic to compare"),
    ],
)
def test_what_was_not_recorded(
    fixtures_dir: Path, tmp_path: Path, kept: slice, status: int, line: str
) -> None:
    """Equal captures that are incomplete or empty are no proof of equal behaviour."""
    whole = fixtures_dir / "captures" / "field" / "plant-a-morning-shift.pcapng"
    path, page = tmp_path / "part.pcapng", tmp_path / "page.md"
    path.write_bytes(whole.read_bytes()[kept])
    result = CliRunner().invoke(group, ["compare", f"{path}", f"{path}", "--summary", f"{page}"])
    assert result.exit_code == status, result.output
    assert line in result.output
    assert f"\n{line.capitalize()}.\n" in page.read_text("utf-8")


def test_other_files(fixtures_dir: Path, tmp_path: Path, refused: Callable[..., str]) -> None:
    capture = fixtures_dir / "captures" / "field" / "complaint-1.pcapng"
    text = tmp_path / "notes.txt"
    text.write_text("no capture")
    assert "is not a capture" in refused("compare", str(capture), str(text))
