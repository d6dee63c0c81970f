"""`scaraspec record` beside files of other programs, users and faults of the disk."""

import signal
from pathlib import Path
from typing import Any

import pytest

LOCAL = ("--listen", "127.0.0.1:0")
NOWHERE = "tcp://127.0.0.1:9"
DEADLINE_S = 60


def end(recorder: Any, number: int = signal.SIGTERM) -> str:
    """End a recorder; return the rest of its output."""
    recorder.send_signal(number)
    return str(recorder.communicate(timeout=DEADLINE_S)[0])


@pytest.mark.parametrize("options", [(), ("--keep", "1h")])
def test_foreign_files_are_kept(processes: Any, tmp_path: Path, options: tuple[str, ...]) -> None:
    """Whatever their names are, and although they are old, empty or links."""
    contents = {
        "empty.mcap": "",
        ".x.rrd.new": "mine",
        ".x.mcap.recovered": "mine",
        "2020-01-01T00-00-00Z_mine.mcap": "mine",
    }
    for name, content in contents.items():
        (tmp_path / name).write_text(content)
    link = tmp_path / "2020-01-02T00-00-00Z_mine.mcap"
    link.symlink_to("empty.mcap")
    recorder = processes.start("record", NOWHERE, *LOCAL, "--out", str(tmp_path), *options)
    recorder.stdout.readline()
    end(recorder)
    assert recorder.returncode == 0
    assert {name: (tmp_path / name).read_text() for name in contents} == contents
    assert link.is_symlink()
