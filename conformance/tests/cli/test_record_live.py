"""`scaraspec record --live` with a viewer without a screen, which saves what it receives."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from scaraspec.client import Client
from scaraspec.protocol.readings import DEFAULT
from scaraspec_recorder.sources.capture import open_capture

chunks = pytest.importorskip("rerun.chunk")

DEADLINE_S = 60
SESSIONS = 3

PROGRAM = """
import sys
from scaraspec.cli import main, viewer
viewer._OPTIONS = ("--save", sys.argv.pop(1))
main()
"""

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc"),
    pytest.mark.usefixtures("viewer"),
]


def until(condition: Callable[[], Any]) -> Any:
    """Wait for a change by another process."""
    until_s = time.monotonic() + DEADLINE_S
    while not (found := condition()):
        assert time.monotonic() < until_s, "waited in vain"
        select.select([], [], [], 0.02)
    return found


def below(pid: int) -> list[int]:
    """The child processes of a process, and their children."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [each for child in map(int, children) for each in (child, *below(child))]


def is_viewer(pid: int) -> bool:
    """Whether this is the viewer itself, which a Python program starts."""
    try:
        return Path(f"/proc/{pid}/comm").read_text().strip() == "rerun"
    except OSError:
        return False


class Session:
    """A recorder with a viewer, started as from a terminal."""

    def __init__(self, controller: tuple[str, int], folder: Path) -> None:
        self.out, self.shown = folder / "out", folder / "shown.rrd"
        options = ("--listen", "127.0.0.1:0", "--out", str(self.out), "--live")
        arguments = ("record", "tcp://{}:{}".format(*controller), *options)
        self.recorder = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(self.shown), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        assert self.recorder.stdout
        self._url = next(
            f"tcp://{line.split()[1]}" for line in self.recorder.stdout if "recording" in line
        )
        self.viewer = next(pid for pid in below(self.recorder.pid) if is_viewer(pid))

    def ask(self) -> None:
        """Run a session of a client."""
        dialect = DEFAULT.replace(reply_timeout=f"{DEADLINE_S}")
        with Client(self._url, password="password", dialect=dialect) as robot:
            robot.get_joint_angles()
            robot.get_status()

    def end(self) -> str:
        """Send Ctrl-C to the process group, as a terminal does; return the output."""
        os.killpg(self.recorder.pid, signal.SIGINT)
        printed, _ = self.recorder.communicate(timeout=DEADLINE_S)
        return printed

    def recorded(self) -> int:
        """The number of bytes in the capture."""
        return sum(len(e.data) for e in open_capture(self.out / "capture.mcap", port=None))

    def drawn(self) -> set[str]:
        """The entities that the viewer received."""
        with pytest.warns(match="no footer"):  # the viewer writes no such entity
            reader = chunks.RrdReader(self.shown)
        return {chunk.entity_path for chunk in reader.stream().to_chunks()}

    def close(self) -> None:
        """End all processes."""
        for pid in (self.viewer, self.recorder.pid):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        self.recorder.communicate()


@pytest.fixture
def session(processes: Any, tmp_path: Path) -> Iterator[Session]:
    session = Session(processes.controller(), tmp_path)
    yield session
    session.close()


def test_traffic_is_drawn_live(session: Session) -> None:
    """Traffic is drawn while it passes; the viewer stays open when the recording ends."""
    session.ask()
    until(lambda: session.shown.exists() and session.shown.stat().st_size > 100_000)
    printed = session.end()
    assert session.recorder.returncode == 0, printed
    assert is_viewer(session.viewer)
    os.kill(session.viewer, signal.SIGINT)
    until(lambda: not is_viewer(session.viewer))
    expected = {"/joint/wrist", "/state/robot", "/state/link", "/latency/queries", "/log/exchanges"}
    assert expected <= session.drawn()
    assert session.recorded() > 0


def test_a_stopped_viewer_delays_nothing(session: Session) -> None:
    """The viewer process is stopped: clients are served, everything is recorded, and the recorder
    ends quickly."""
    os.kill(session.viewer, signal.SIGSTOP)
    for _ in range(SESSIONS):
        session.ask()
    printed = session.end()
    assert session.recorder.returncode == 0, printed
    assert f"\n{SESSIONS} connections" in printed
    size_bytes = int(printed.partition("from the client: ")[2].partition(" ")[0])
    assert f"{size_bytes} bytes received and forwarded = {size_bytes} recorded + 0" in printed
    assert "the viewer does not show the end of the recording" in printed
