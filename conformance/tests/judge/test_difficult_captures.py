"""Captures over difficult links, with lost packets, and damaged ones."""

import subprocess
import sys
from pathlib import Path

import damaged_captures
import pytest
from difficult_captures import LINKS, LOSSES, SOURCE, read, write
from lost_packets import CAPTURES, LEAST_SHARE, main, total_of

from scaraspec.api import audit
from scaraspec.judge.verdicts import Conclusion


@pytest.mark.parametrize("name", LINKS)
def test_a_difficult_link(tmp_path: Path, name: str) -> None:
    """Nothing is missing, and nothing is wrong."""
    file = tmp_path / "a.pcap"
    write(file, LINKS[name](read(SOURCE)))
    results, _ = audit(file)
    assert results.verdict is Conclusion.NO_VIOLATION
    assert results.judged >= 200


@pytest.mark.parametrize("name", LOSSES)
def test_losses(tmp_path: Path, name: str) -> None:
    """No violation is found in what was recorded; each loss is listed."""
    file = tmp_path / "a.pcap"
    write(file, LOSSES[name](read(SOURCE)))
    results, _ = audit(file)
    assert results.verdict.exit_status == 3
    assert results.label.startswith("no violation found in what was recorded (")
    assert results.session
    assert results.session.losses


def test_missing_packets() -> None:
    """Wherever a capture is cut, nothing else fails; most other failures are still given."""
    total = total_of([CAPTURES], seeds=2)
    assert total.variants > 150
    assert not total.false
    assert total.share_kept >= LEAST_SHARE


@pytest.mark.runs
def test_missing_packets_at_many_places() -> None:
    """The same with twenty cuts, and in the captures with one fault."""
    assert main([]) == 0


@pytest.mark.runs
def test_damaged_files() -> None:
    """Changed bytes cause no traceback; `make test-captures` tries more.

    A process of its own: the memory of this one is that of all its tests.
    """
    subprocess.run([sys.executable, damaged_captures.__file__, "--count", "200"], check=True)
