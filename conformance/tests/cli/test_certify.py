"""`scaraspec certify controller` with good, bad and hostile subjects."""

import itertools
import os
import signal
import socket
import stat
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from scaraspec.cli.certify.running import end_on_signals
from scaraspec.client import Client
from scaraspec.judge.verdicts import Reason
from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Results
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.engine.plan import item_of

ALL = ("--allow", "state,motion,destructive")


@pytest.fixture
def hostile() -> Iterator[Callable[[Callable[[socket.socket], None]], str]]:
    """Start a server that handles every connection with the given function; return its URL."""
    listeners = []

    def serve(listener: socket.socket, treat: Callable[[socket.socket], None]) -> None:
        with suppress(OSError):
            while True:
                connection, _ = listener.accept()
                threading.Thread(target=one, args=(connection, treat), daemon=True).start()

    def one(connection: socket.socket, treat: Callable[[socket.socket], None]) -> None:
        with closing(connection), suppress(OSError):
            treat(connection)

    def make(treat: Callable[[socket.socket], None]) -> str:
        listener = socket.create_server(("127.0.0.1", 0))
        listeners.append(listener)
        threading.Thread(target=serve, args=(listener, treat), daemon=True).start()
        return f"tcp://127.0.0.1:{listener.getsockname()[1]}"

    yield make
    for listener in listeners:
        listener.close()


@pytest.mark.usefixtures("viewer")
def test_a_conforming_controller(processes: Any, tmp_path: Path) -> None:
    """Conformant; all announced files are written, and the plan is printed first."""
    host, port = processes.controller()
    url, out = f"tcp://{host}:{port}", tmp_path / "out"
    done = processes.run(
        "certify", "controller", url, "--only", "4.6,4.20", *ALL, "--out", str(out)
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "cases will run" in done.stdout.splitlines()[0]
    results = Results.read(out / "results.json")
    assert results.verdict.value == "conformant"
    assert {path.name for path in out.iterdir()} == {
        "results.json",
        "report.html",
        "junit.xml",
        "ctrf.json",
        "capture.mcap",
        "capture.rrd",
    }
    suite = ET.parse(out / "junit.xml").getroot()
    assert int(suite.get("tests", "0")) == len(results.cases)


def test_a_faulty_controller(processes: Any, tmp_path: Path) -> None:
    """Nonconformant; the case states expected and observed, and the reproduction command."""
    host, port = processes.controller("--mutant", "status-of-one-digit")
    out = tmp_path / "out"
    done = processes.run(
        "certify", "controller", f"tcp://{host}:{port}", "--only", "4.8/2", "--out", str(out)
    )
    assert done.returncode == 1, done.stdout + done.stderr
    failed = [c for c in Results.read(out / "results.json").cases if c.verdict.value == "fail"]
    assert {case.requirements for case in failed} >= {("4.8/2",)}
    case = next(case for case in failed if case.id.startswith("4.8/2"))
    assert case.expected
    assert case.observed
    assert case.wire
    assert case.replay.endswith("--only case:4.8/2")


def test_read_only_by_default(processes: Any, tmp_path: Path) -> None:
    """Without --allow only queries are sent, and the skipped cases are reported."""
    host, port = processes.controller()
    out = tmp_path / "out"
    done = processes.run(
        *("certify", "controller", f"tcp://{host}:{port}", "--out", str(out)),
        *("--only", "4.1,4.3,4.5,4.9,4.11,4.15,4.28,4.32,5.2,5.3,6.5", "--patience", "1"),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "skipped: it has a hazard that is not allowed: --allow" in done.stdout
    sent = {command.name for command in Results.read(out / "results.json").session.exchanges}
    harmless = {c.name for c in COMMANDS if c.hazard is Hazard.READ_ONLY} | {"login"}
    assert sent <= harmless


def test_a_plan_sends_nothing(processes: Any) -> None:
    """--dry-run needs no controller."""
    done = processes.run("certify", "controller", *ALL, "--dry-run")
    assert done.returncode == 0
    assert "MOVE the arm" in done.stdout
    assert "stop what the robot is doing" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no controller"),
        (("http://x",), "http"),
        (("tcp://127.0.0.1:1", "--allow", "everything"), "everything"),
        (("tcp://127.0.0.1:1", "--only", "9.99"), "9.99"),
        (("tcp://127.0.0.1:1", "--reply-timeout", "1000h"), "reply_timeout"),
        (("tcp://127.0.0.1:1", "--ics", "/nowhere.toml"), "/nowhere.toml"),
    ],
)
def test_usage(refused: Callable[..., str], arguments: tuple[str, ...], message: str) -> None:
    """User errors are reported."""
    assert message in refused("certify", "controller", *arguments)


@pytest.mark.parametrize("more", [(), ("--exhaustive",), ("--only", "4.5/6")])
def test_slow_cases_in_the_plan(processes: Any, more: tuple[str, ...]) -> None:
    """Slow cases are skipped with a notice, unless all cases or their names are selected."""
    done = processes.run("certify", "controller", "--dry-run", *more, *ALL)
    assert done.returncode == 0, done.stdout + done.stderr
    assert ("skipped: it is slow" in done.stdout) is (not more)


def test_wait_for_the_controller(processes: Any) -> None:
    """A controller that starts later is certified; without the option the run ends immediately."""
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        address = f"127.0.0.1:{listener.getsockname()[1]}"
    command = ("certify", "controller", f"tcp://{address}", "--only", "4.8/2")
    assert processes.run(*command).returncode == 3
    waiting = processes.start(*command, "--wait-for", "1m")
    processes.start("controller", "--listen", address)
    output, _ = waiting.communicate(60)
    assert waiting.wait() == 0, output


def test_fail_fast(processes: Any) -> None:
    """After the first failed case, the others do not run."""
    host, port = processes.controller("--mutant", "status-in-words")
    done = processes.run(
        *("certify", "controller", f"tcp://{host}:{port}", "--only", "4.8", "--fail-fast")
    )
    assert done.returncode == 1
    assert "a case has failed, and --fail-fast ends the run" in done.stdout


def test_a_hook_that_cannot_be_started(refused: Callable[..., str], tmp_path: Path) -> None:
    """One sentence names the file, the hook and the program; no connection is opened."""
    ics = tmp_path / "ics.toml"
    ics.write_text("[hooks]\nrestart = 'no-such-program now'\n", encoding="utf-8")
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        listener.settimeout(0)
        url = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        message = refused("certify", "controller", url, "--ics", str(ics), "--only", "4.8/2")
        assert message == (
            f"scaraspec: {ics}: the program no-such-program of the hook restart does not exist or "
            "is not executable\n"
        )
        with pytest.raises(BlockingIOError):
            listener.accept()


def test_hooks_that_are_missing(processes: Any, tmp_path: Path) -> None:
    """The plan and the notice name them; results.json has the reason code."""
    host, port = processes.controller()
    out = tmp_path / "out"
    done = processes.run(
        *("certify", "controller", f"tcp://{host}:{port}", *ALL, "--out", str(out)),
        *("--only", "case:6.6a/14.driven-inputs,4.8/2"),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "skipped: it needs set_input in [hooks] of the ICS" in done.stdout
    (notice,) = Results.read(out / "results.json").notices
    assert "which the ICS does not define (1: set_input)" in notice
    assert notice in done.stdout
    reasons = {case.id: case.reason for case in Results.read(out / "results.json").cases}
    assert reasons["6.6a/14.driven-inputs"] is Reason.HOOK


def test_a_fast_controller_whose_waits_are_too_long(processes: Any, tmp_path: Path) -> None:
    """The delays of a link do not hide an eighth of a second."""
    host, port = processes.controller("--time-scale", "8", "--mutant", "waits-at-least-one-second")
    (tmp_path / "fast.toml").write_text("[subject]\ntime_scale = 8\n")
    done = processes.run(
        *("certify", "controller", f"tcp://{host}:{port}", "--ics", str(tmp_path / "fast.toml")),
        *("--only", "case:6.5/20.none", "--allow", "state,motion", "--yes"),
    )
    assert done.returncode == 1, done.stdout + done.stderr
    assert "6.5/20.none: a wait of 0 s is too long" in done.stdout


def test_a_wrong_password_is_no_failure_of_the_subject(processes: Any) -> None:
    """The run is inconclusive, with one sentence about the password."""
    host, port = processes.controller("--password", "secret")
    done = processes.run("certify", "controller", f"tcp://{host}:{port}", "--only", "4.8")
    assert done.returncode == 3
    assert "the login was refused" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_password_from_the_environment(processes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """SCARASPEC_PASSWORD is used, so that the password need not be on the command line."""
    host, port = processes.controller("--password", "secret")
    monkeypatch.setenv("SCARASPEC_PASSWORD", "secret")
    done = processes.run("certify", "controller", f"tcp://{host}:{port}", "--only", "4.8/2")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "secret" not in done.stdout + done.stderr


def test_a_state_directory_that_cannot_be_used(processes: Any, tmp_path: Path) -> None:
    """Nothing is sent: one sentence names the directory and the option; exit status 2."""
    folder = tmp_path / "file" / "state"
    folder.parent.touch()
    url = "tcp://127.0.0.1:1"
    done = processes.run(
        *("certify", "controller", url, "--only", "4.8/2", "--state-dir", str(folder))
    )
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stderr == (
        f"scaraspec: the state directory {folder} cannot be used: Not a directory; "
        "name another one with --state-dir\n"
    )


def test_a_recovery_that_is_not_allowed(processes: Any, tmp_path: Path) -> None:
    """One line names the missing option, exit status 3; with that option the next run starts."""
    host, port = processes.controller()
    url = f"tcp://{host}:{port}"
    with Journal.of(url, tmp_path / "state") as journal:
        journal.begin("2026-01-01T00:00:00+00:00", {})
        journal.write("motion")  # the run was killed at that moment
    run = ("certify", "controller", url, "--only", "4.8/2")
    done = processes.run(*run)
    assert done.returncode == 3, done.stdout + done.stderr
    assert done.stderr == (
        "scaraspec: the run of 2026-01-01T00:00:00+00:00 was interrupted, and the robot may still "
        "be moving: allow the recovery with --allow motion\n"
    )
    done = processes.run(*run, "--allow", "motion")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "was interrupted: the controller refused the emergency stop" in done.stdout


@pytest.fixture
def null_modem() -> Iterator[tuple[str, str]]:
    """Two serial devices; each receives what is written to the other."""
    pairs = [os.openpty() for _ in range(2)]
    for _, line in pairs:
        tty.setraw(line)
    ends = [robot for robot, _ in pairs]

    def relay(source: int, target: int) -> None:
        with suppress(OSError):
            while data := os.read(source, 4096):
                os.write(target, data)

    for source, target in (ends, ends[::-1]):
        threading.Thread(target=relay, args=(source, target), daemon=True).start()
    first, second = (os.ttyname(line) for _, line in pairs)
    yield first, second
    for descriptor in itertools.chain(*pairs):
        os.close(descriptor)


@pytest.mark.skipif(sys.platform == "win32", reason="needs pseudo terminals")
def test_a_serial_line(processes: Any, null_modem: tuple[str, str]) -> None:
    """Conformant as over TCP, although a serial line has no end of a connection."""
    pytest.importorskip("serial")
    robot, own_files = null_modem
    processes.controller("--serial", robot, "--reading", "xfer_timeout=0.5")
    done = processes.run(
        *("certify", "controller", f"serial://{own_files}", "--only", "4.8/2,5.1/7", *ALL),
        *("--transfer-timeout", "0.5", "--examples", "3"),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "conformant: serial://" in done.stdout


def test_an_absent_subject(processes: Any, tmp_path: Path) -> None:
    """A closed port gives one sentence and exit status 3; no folder is left."""
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        port = listener.getsockname()[1]
    command = ("certify", "controller", f"tcp://127.0.0.1:{port}", "--only", "4.8")
    done = processes.run(*command, "--out", str(tmp_path / "out"))
    assert done.returncode == 3
    assert (done.stdout + done.stderr).count("could not be used at the start of the run") == 1
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def _hang(connection: socket.socket) -> None:
    while connection.recv(65536):
        pass


def _flood(connection: socket.socket) -> None:
    while True:
        connection.sendall(b"\xcc\x09\x0200\xaa" * 4096)


def _nonsense(connection: socket.socket) -> None:
    while connection.recv(65536):
        connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")


@pytest.mark.parametrize("treat", [lambda _: None, _hang, _flood, _nonsense])
def test_hostile_subjects(
    processes: Any, hostile: Any, treat: Callable[[socket.socket], None]
) -> None:
    """Subjects that close at once, hang, flood or answer nonsense: never a pass, and the run
    ends."""
    done = processes.run(
        "certify", "controller", hostile(treat), "--reply-timeout", "300ms", "--only", "4.8,3/32"
    )
    assert done.returncode in (1, 3), done.stdout + done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("files", "only", "signals"),
    [
        (1, (), [signal.SIGINT]),
        (5, ("--only", "5"), [signal.SIGINT]),
        (1, ("--only", "5"), [signal.SIGTERM, signal.SIGTERM]),  # timeout(1) does so, too
    ],
)
def test_interrupted(
    processes: Any, tmp_path: Path, files: int, only: tuple[str, ...], signals: list[signal.Signals]
) -> None:
    """If interrupted while a file of the suite is stored, the file is deleted and the run is
    inconclusive."""
    host, port = processes.controller()
    url, out = f"tcp://{host}:{port}", tmp_path / "out"
    with Client(url, password="password") as robot:
        seen = before = robot.list_programs()
        run = processes.start("certify", "controller", url, *ALL, *only, "--out", str(out))
        for _ in range(files):
            while (stored := robot.list_programs()) in (before, seen):
                with suppress(subprocess.TimeoutExpired):
                    run.wait(0.01)
                    pytest.fail(run.stdout.read())
            seen = stored
        state = tmp_path / "state"
        assert [stat.S_IMODE(file.stat().st_mode) for file in state.glob("*.journal")] == [0o600]
        for number in signals:
            run.send_signal(number)
        printed, _ = run.communicate(timeout=60)
        assert run.returncode == 3, printed
        assert not [*state.glob("*.journal")], printed
        assert robot.list_programs() == before, printed


@pytest.fixture
def handlers() -> Iterator[None]:
    """Restore the signal handlers."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("handlers")
def test_two_signals_at_once_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """timeout(1) signals a process and then its group; a user repeats a signal later."""
    times_s = iter((10.0, 10.001, 11.0))
    monkeypatch.setattr("time.monotonic", lambda: next(times_s))
    end_on_signals(Interruption())
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    signal.raise_signal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_the_verdict_on_a_full_disk(processes: Any, tmp_path: Path) -> None:
    """The verdict is on the terminal and in results.json; exit status 3."""
    host, port = processes.controller()
    limit = "import os, resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))"
    command = ("-m", "scaraspec", "certify", "controller", f"tcp://{host}:{port}")
    done = subprocess.run(
        [
            *(sys.executable, "-c", f"{limit}; os.execv(sys.executable, sys.argv[1:])"),
            *(sys.executable, *command, "--only", "4.7/2", "--out", str(tmp_path / "out")),
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 3, done.stdout + done.stderr
    assert "conformant: tcp://" in done.stdout
    assert "the recording is incomplete: File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert Results.read(tmp_path / "out/results.json").verdict.good


def test_coverage_can_be_required(processes: Any) -> None:
    """Without the option, a run that judged a part of its scope has exit status 0 and reports
    that."""
    host, port = processes.controller()
    command = ("certify", "controller", f"tcp://{host}:{port}", "--only", "4.7/2,4.35/5")
    done = processes.run(*command)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "no violation found (1 of 2 requirements judged)" in done.stdout
    assert "1 not judged: it has a hazard that is not allowed: --allow" in done.stdout
    required = processes.run(*command, "--require", "4.35/5")
    assert required.returncode == 3, required.stdout + required.stderr
    assert "required, but not judged: 4.35/5" in required.stdout
    share = processes.run(*command, "--require", "4.7/2", "--require-coverage", "95%")
    assert "1 of 2 requirements were judged, which is less than 95 %" in share.stdout
    assert share.returncode == 3


def test_the_reproduction_command_repeats_the_failure(processes: Any, tmp_path: Path) -> None:
    """It contains the case and every option, and gives the same fingerprint."""
    host, port = processes.controller("--mutant", "status-of-one-digit")
    url, out = f"tcp://{host}:{port}", tmp_path / "out"
    options = ("--patience", "2", "--examples", "5", "--allow", "state", "--reply-timeout", "1.5s")
    processes.run("certify", "controller", url, "--only", "4.8", *options, "--out", str(out))
    results = Results.read(out / "results.json")
    assert results.run
    assert results.run.settings["reply_timeout_s"] == "1.5"
    failed = [case for case in results.cases if case.verdict.value == "fail"]
    words = failed[0].replay.split()
    assert words[:4] == ["scaraspec", "certify", "controller", url]
    for name, value in zip(options[::2], options[1::2], strict=True):
        assert words[words.index(name) + 1].removesuffix(".0") == value
    assert words[-2:] == ["--only", item_of(failed[0].id.partition(".seen-")[0])]
    again = tmp_path / "again"
    processes.run(*words[1:], "--out", str(again))
    fingerprints = {case.fingerprint for case in Results.read(again / "results.json").cases}
    assert failed[0].fingerprint in fingerprints
