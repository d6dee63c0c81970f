"""`scaraspec audit` of the captures in `fixtures/captures/cases`, each with one situation."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from scaraspec.cli.main import group


@pytest.mark.parametrize(
    ("name", "options", "exit_status", "says"),
    [
        ("reply-then-reset.pcap", "", 0, "no violation found"),
        ("two-packets-swapped.pcap", "", 0, "no violation found"),
    ],
)
def test_a_case(fixtures_dir: Path, name: str, options: str, exit_status: int, says: str) -> None:
    """The exit status and the decisive sentence are what the situation demands."""
    file = fixtures_dir / "captures" / "cases" / name
    done = CliRunner().invoke(group, ["audit", f"{file}", *options.split()])
    assert done.exit_code == exit_status, done.output
    assert says in done.output
