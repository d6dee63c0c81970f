"""`scaraspec record` and files of other programs, access rights, faults of the disk."""

import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from scaraspec.traffic.wire import Kind
from scaraspec_recorder.sources.capture import open_capture
from scaraspec_recorder.spool.locks import spool_folder
from scaraspec_recorder.spool.spool import read_checkpoint

pytestmark = pytest.mark.usefixtures("viewer")

LOCAL = ("--listen", "127.0.0.1:0")
NOWHERE = "tcp://127.0.0.1:9"
DEADLINE_S = 60


def end(recorder: Any, number: int = signal.SIGTERM) -> str:
    """End a recorder; return the rest of its output."""
    recorder.send_signal(number)
    return str(recorder.communicate(timeout=DEADLINE_S)[0])


def acknowledged_bytes(out: Path) -> int:
    """The number of a client's bytes that the writer process has made durable."""
    progress = read_checkpoint(spool_folder(out)).get("state", {}).get("progress", {})
    return int(progress.get("a2c", {}).get("recorded_bytes", 0))


@pytest.mark.parametrize("options", [(), ("--keep", "1h")])
def test_foreign_files_are_kept(processes: Any, tmp_path: Path, options: tuple[str, ...]) -> None:
    """Whatever their names are, and even if they are old, empty or links."""
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


@pytest.mark.parametrize(
    ("options", "modes"), [((), (0o600, 0o700)), (("--file-mode", "640"), (0o640, 0o750))]
)
def test_access_rights(
    processes: Any, tmp_path: Path, options: tuple[str, ...], modes: tuple[int, int]
) -> None:
    """Only the user can read recordings; --file-mode changes that."""
    out = tmp_path / "out"
    options = (*options, "--rotate", "1h", "--out", str(out))
    recorder = processes.start("record", NOWHERE, *LOCAL, *options)
    host, _, port = recorder.stdout.readline().split()[1].rpartition(":")
    with suppress(ConnectionError), socket.create_connection((host, int(port))) as client:
        client.recv(1)
    end(recorder)
    assert len(list(out.iterdir())) == 3
    assert {path.stat().st_mode & 0o777 for path in out.iterdir()} == {modes[0]}
    assert out.stat().st_mode & 0o777 == modes[1]


def test_a_folder_that_cannot_be_written(refused: Callable[..., str], tmp_path: Path) -> None:
    """The recorder does not start."""
    (tmp_path / "file").touch()
    for out in (tmp_path / "file", tmp_path / "file" / "folder"):
        message = refused("record", NOWHERE, *LOCAL, "--out", str(out))
        assert f"{out} is not a folder: name another one with --out" in message
    # Even root cannot create a file there.
    message = refused("record", NOWHERE, *LOCAL, "--out", "/proc")
    assert "cannot record 127.0.0.1:0 to /proc: " in message


_WITHOUT_MEMORY = """
from scaraspec.cli import record
from scaraspec.cli.main import main

def fail(*_):
    raise MemoryError

record._missing = fail  # called when the recording has begun
main()
"""


def test_a_lack_of_memory(tmp_path: Path) -> None:
    """The recorder ends with one sentence, its counts and exit status 3."""
    command = (sys.executable, "-c", _WITHOUT_MEMORY, "record", NOWHERE, *LOCAL)
    done = subprocess.run(
        [*command, "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 3
    assert done.stderr == "scaraspec: there is not enough memory\n"
    assert "from the client: 0 bytes received and forwarded" in done.stdout


@pytest.mark.parametrize("mode", ["400", "rw", "777", "60"])
def test_unusable_access_rights(refused: Callable[..., str], mode: str) -> None:
    """The recorder must be able to read and write its files."""
    assert f"--file-mode: '{mode}' is not" in refused(
        "record", NOWHERE, *LOCAL, "--file-mode", mode
    )


@pytest.mark.parametrize("options", [(), ("--rotate", "1h")])
def test_a_folder_removed_while_recording(
    processes: Any, tmp_path: Path, options: tuple[str, ...]
) -> None:
    """It is reported, the recording continues with a gap, and every byte is counted."""
    out = tmp_path / "out"
    with socket.create_server(("127.0.0.1", 0)) as robot:
        url = "tcp://{}:{}".format(*robot.getsockname())
        recorder = processes.start("record", url, *LOCAL, "--out", str(out), *options)
        host, _, port = recorder.stdout.readline().split()[1].rpartition(":")
        with socket.create_connection((host, int(port))) as client:
            reached, _ = robot.accept()
            with reached:
                client.sendall(b"before")
                assert reached.recv(6, socket.MSG_WAITALL) == b"before"
                while not acknowledged_bytes(out):
                    assert recorder.poll() is None
                shutil.rmtree(out)
                assert any("was removed while it was written" in line for line in recorder.stdout)
                client.sendall(b"after")
                assert reached.recv(5, socket.MSG_WAITALL) == b"after"
                summary = end(recorder)
    assert recorder.returncode == 3
    assert "from the client: 11 bytes received and forwarded = 5 recorded + 6 in 1 gaps" in summary
    (capture,) = out.glob("*.mcap")
    events = list(open_capture(capture, port=None))
    gaps = [(event.offset_bytes, event.length_bytes) for event in events if event.kind is Kind.GAP]
    assert gaps == [(0, 6)]
    assert [event.data for event in events if event.data] == [b"after"]
