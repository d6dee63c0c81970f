"""The output cannot be written, or a signal ends the command: nothing else is lost."""

import os
import pty
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from scaraspec.cli import requirements
from scaraspec.cli.main import COMMANDS, main
from scaraspec.client import Client, ClientError
from scaraspec.report.model import Results

SCARASPEC = [sys.executable, "-m", "scaraspec"]
LIMIT_S = 60


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_stops_reading(
    processes: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unbuffered: str
) -> None:
    """After `| head` the report is still written, and the exit status is that of the results."""
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    host, port = processes.controller("--mutant", "status-of-one-digit")
    words = ("certify", "controller", f"tcp://{host}:{port}", "--only", "4.8")
    assert _unread(*words, "--out", str(tmp_path / "out")) == 1
    assert Results.read(tmp_path / "out" / "results.json").verdict.value == "nonconformant"


@pytest.mark.parametrize("command", COMMANDS)
def test_a_closed_output(command: str) -> None:
    """It is as an output whose reader has left: a status of 1 would say nonconformant."""
    words = ["sh", "-c", 'exec "$@" >&-', "sh", *SCARASPEC, command, "--help"]
    done = subprocess.run(words, stderr=subprocess.PIPE, text=True, timeout=LIMIT_S, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_closed_output_and_a_verdict(processes: Any, tmp_path: Path) -> None:
    """No file gets the descriptor of the output; the status is that of the results."""
    host, port = processes.controller("--mutant", "status-of-one-digit")
    words = ("certify", "controller", f"tcp://{host}:{port}", "--only", "4.8")
    closing = ("sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", *SCARASPEC, *words)
    done = subprocess.run([*closing, "--out", str(tmp_path)], timeout=LIMIT_S, check=False)
    assert done.returncode == 1
    assert Results.read(tmp_path / "results.json").verdict.value == "nonconformant"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_while_the_command_is_imported(number: signal.Signals) -> None:
    """It is not lost, also for the first process of a container, which has no default action."""
    script = (
        "import builtins, os\n"
        "from scaraspec.cli import main\n"
        "imported = builtins.__import__\n"
        "def importing(name, *arguments):\n"
        "    if name == 'scaraspec.cli.main':\n"
        f"        os.kill(os.getpid(), {number.value})\n"
        "    return imported(name, *arguments)\n"
        "builtins.__import__ = importing\n"
        "main()\n"
    )
    words = [sys.executable, "-c", script]
    done = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert (done.returncode, done.stderr) == (3, "scaraspec: interrupted\n")


def test_unread_output_of_a_short_command() -> None:
    """Status 1 would mean nonconformant."""
    assert _unread("requirements") == 0


def _unread(*words: str) -> int:
    """The exit status of a command whose output is not read."""
    with subprocess.Popen([*SCARASPEC, *words], stdout=subprocess.PIPE) as run:
        assert run.stdout
        run.stdout.close()
        return run.wait(LIMIT_S)


def test_a_terminal_with_a_limited_encoding(
    processes: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As for files on Windows: characters outside the encoding are escaped, and the status is the
    same."""
    host, port = processes.controller("--mutant", "status-of-one-digit")
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    words = ("certify", "controller", f"tcp://{host}:{port}", "--only", "4.8")
    done = subprocess.run(
        [*SCARASPEC, *words], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 1
    assert "fail \\xb7 4.8/" in done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(("words", "status"), [("requirements", 3), ("frame zz", 2)])
def test_a_full_disk(words: str, status: int) -> None:
    """If output cannot be written, status 0 becomes 3; any other status is the same."""
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*SCARASPEC, *words.split()],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    assert done.returncode == status
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("why", "printed"),
    [
        (KeyboardInterrupt(), "scaraspec: interrupted\n"),
        (OSError(30, "Read-only file system"), "scaraspec: [Errno 30] Read-only file system\n"),
        (
            KeyError("x"),
            "KeyError: 'x'\nscaraspec: this is a defect of scaraspec; please report it\n",
        ),
    ],
)
def test_exit_status_of_an_interrupted_command(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    why: BaseException,
    printed: str,
) -> None:
    """Status 1 would mean nonconformant. Only a defect prints a traceback."""

    def fail(**_: object) -> None:
        raise why

    monkeypatch.setattr(requirements.command, "callback", fail)
    monkeypatch.setattr(sys, "argv", ["scaraspec", "requirements"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 3
    reported = capsys.readouterr().err
    assert reported.endswith(printed)
    assert reported == printed or isinstance(why, KeyError)


def test_a_lost_terminal(processes: Any, tmp_path: Path) -> None:
    """As with a remote shell: the files of the suite are deleted, and everything is reported."""
    host, port = processes.controller()
    url, out = f"tcp://{host}:{port}", tmp_path / "out"
    near, far = pty.openpty()
    with Client(url, password="password") as robot:
        before = robot.list_programs()
        words = ("certify", "controller", url, "--allow", "state,motion", "--only", "5", "--yes")
        run = subprocess.Popen(
            [*SCARASPEC, *words, "--out", str(out)], stdin=far, stdout=far, stderr=far
        )
        os.close(far)
        try:
            while robot.list_programs() == before:
                assert run.poll() is None
            os.close(near)
            run.send_signal(signal.SIGHUP)
            assert run.wait(LIMIT_S) == 3
        finally:
            run.kill()
            run.wait()
        assert robot.list_programs() == before
    assert not [*(tmp_path / "state").glob("*.journal")]
    assert "run.interrupted" in {case.id for case in Results.read(out / "results.json").cases}


def test_a_recording_with_a_lost_terminal(processes: Any, tmp_path: Path) -> None:
    host, port = processes.controller()
    recorder = processes.start(
        "record", f"tcp://{host}:{port}", "--listen", "127.0.0.1:0", "--out", str(tmp_path)
    )
    recorder.stdout.readline()
    recorder.send_signal(signal.SIGHUP)
    printed, _ = recorder.communicate(timeout=LIMIT_S)
    assert recorder.returncode == 0, printed
    assert (tmp_path / "capture.mcap").read_bytes().endswith(b"\x89MCAP0\r\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_child_processes_end_with_the_command(
    processes: Any, tmp_path: Path, number: signal.Signals
) -> None:
    """Each signal also ends child processes, such as the controller of the demo."""
    demo = processes.start("demo", "--out", str(tmp_path / "out"))
    printed = demo.stdout.readline()
    url = printed.split()[-1]
    demo.send_signal(number)
    printed, _ = demo.communicate(timeout=LIMIT_S)
    assert demo.returncode == 3
    assert printed.endswith("scaraspec: interrupted\n")
    with pytest.raises(ClientError, match="Connection refused"):
        Client(url, password="password").connect()


def test_an_ignored_sighup_stays_ignored() -> None:
    """SIGHUP is ignored, as under nohup."""
    words = [*SCARASPEC, "controller", "--listen", "127.0.0.1:0"]
    ignoring = ["sh", "-c", 'trap "" HUP; exec "$@"', "sh", *words]
    with subprocess.Popen(ignoring, stdout=subprocess.PIPE, text=True) as serving:
        assert serving.stdout
        url = serving.stdout.readline().split()[-1]
        serving.send_signal(signal.SIGHUP)
        with Client(url, password="password") as robot:
            assert robot.get_status()
        serving.terminate()
        assert serving.wait(LIMIT_S) == 0
