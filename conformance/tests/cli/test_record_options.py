"""The options of `scaraspec record`."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log
from mcap.reader import make_reader

from scaraspec.client import Client
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.readings import DEFAULT
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.monitoring.health import health_problems
from scaraspec_recorder.sources.capture import open_capture
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk
from scaraspec_recorder.spool.locks import spool_folder
from scaraspec_recorder.spool.spool import READER_LOCK, lock

LOCAL = ("--listen", "127.0.0.1:0")
DEADLINE_S = 60


def marks(path: Path) -> list[str]:
    """The marks that triggers have written into the log of a recording."""
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(topics=["/log"])
        lines = [Log.FromString(message.data) for _, _, message in found]
    return [line.message for line in lines if line.name == "trigger"]


def written(folder: Path) -> list[Path]:
    """The recordings in a folder.

    A writer that is killed early leaves an empty file.
    """
    return [path for path in folder.glob("*.mcap") if path.stat().st_size]


def url_in(line: str) -> str:
    """The address for clients, from a line like ``recording 127.0.0.1:40001 to …``."""
    assert line.startswith("recording 127.0.0.1:"), line
    return f"tcp://{line.split()[1]}"


def ask(url: str) -> None:
    """A login and a query, with a timeout for slow machines."""
    dialect = DEFAULT.replace(reply_timeout=f"{DEADLINE_S}")
    with Client(url, password="password", dialect=dialect) as robot:
        robot.get_status()


def end(recorder: Any, number: int = signal.SIGTERM) -> str:
    """End a recorder; return the rest of its output."""
    recorder.send_signal(number)
    return recorder.communicate(timeout=DEADLINE_S)[0]


@pytest.fixture
def controller(processes: Any) -> str:
    """A virtual controller's URL."""
    return "tcp://{}:{}".format(*processes.controller())


def test_help_fits_a_screen(processes: Any) -> None:
    """All options, under headings, with an example at the end."""
    lines = processes.run("record", "--help").stdout.splitlines()
    assert 24 <= len(lines) <= 44
    assert max(map(len, lines)) <= 80
    assert lines[-1].startswith("  Example: scaraspec record tcp://")


@pytest.mark.usefixtures("viewer")
def test_a_file_for_each_connection(processes: Any, controller: str, tmp_path: Path) -> None:
    """Each file has the time and the robot in its name, is complete, and is in the index."""
    recorder = processes.start(
        "record", controller, *LOCAL, "--out", str(tmp_path), "--rotate", "connection"
    )
    url = url_in(recorder.stdout.readline())
    ask(url)
    ask(url)
    printed = end(recorder)
    assert recorder.returncode == 0, printed
    files = sorted(tmp_path.glob("*_127.0.0.1*.mcap"))
    assert 1 <= len(files) <= 2  # two sessions within one tick share a file
    entries = [json.loads(line) for line in (tmp_path / "contents.jsonl").read_text().splitlines()]
    assert {entry["name"] for entry in entries} == {file.name for file in files}
    assert sum(entry["connections"] for entry in entries) == 2
    for file in files:
        assert file.with_suffix(".rrd").exists()
        assert processes.run("audit", str(file)).returncode == 0


@pytest.mark.usefixtures("viewer")
def test_without_rrd_files(processes: Any, controller: str, tmp_path: Path) -> None:
    """`convert` can write them later."""
    recorder = processes.start("record", controller, *LOCAL, "--out", str(tmp_path), "--no-rrd")
    ask(url_in(recorder.stdout.readline()))
    assert "files: capture.mcap\n" in end(recorder)
    assert [path.name for path in tmp_path.iterdir()] == ["capture.mcap"]


def test_an_unreachable_robot_is_reported(processes: Any, tmp_path: Path) -> None:
    """Failed connections to the robot are shown on the terminal, not only in the file."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # the port is not in use
        robot = "tcp://{}:{}".format(*taken.getsockname())
        recorder = processes.start("record", robot, *LOCAL, "--out", str(tmp_path))
        host, port = url_in(recorder.stdout.readline()).removeprefix("tcp://").split(":")
        with socket.create_connection((host, int(port)), DEADLINE_S):
            printed = recorder.stdout.readline()
    assert printed == "127.0.0.1: the robot cannot be reached: Connection refused\n"
    end(recorder)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse at once")
def test_a_robot_that_does_not_answer(processes: Any, tmp_path: Path) -> None:
    """The pending connection is shown, and the bytes of the client are counted."""
    with ExitStack() as stack:
        silent = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        for _ in range(2):  # its queue is full, and it ignores the next clients
            waiting = stack.enter_context(socket.socket())
            waiting.settimeout(0)
            waiting.connect_ex(silent.getsockname())
        robot = "tcp://{}:{}".format(*silent.getsockname())
        recorder = processes.start("record", robot, *LOCAL, "--out", str(tmp_path))
        host, port = url_in(recorder.stdout.readline()).removeprefix("tcp://").split(":")
        client = stack.enter_context(socket.create_connection((host, int(port)), DEADLINE_S))
        client.sendall(b"hello")
        assert recorder.stdout.readline() == "127.0.0.1: connecting to the robot …\n"
        assert "5 bytes received and not forwarded" in end(recorder)


def test_a_trigger_marks_the_recording(processes: Any, controller: str, tmp_path: Path) -> None:
    """Its time is in the log of the recording and on the terminal."""
    recorder = processes.start(
        *("record", controller, *LOCAL, "--out", str(tmp_path), "--trigger", "disconnect")
    )
    ask(url_in(recorder.stdout.readline()))
    printed = end(recorder)
    assert recorder.returncode == 0, printed
    assert "UTC: connection 1 closed\n" in printed
    assert marks(tmp_path / "capture.mcap") == ["disconnect: connection 1 closed"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX system")
def test_a_durable_recording(processes: Any, controller: str, tmp_path: Path) -> None:
    """Its spool is beside the files, and is removed at the end."""
    recorder = processes.start("record", controller, *LOCAL, "--out", str(tmp_path), "--durable")
    url = url_in(recorder.stdout.readline())
    assert (tmp_path / ".spool").is_dir()
    ask(url)
    told = end(recorder)
    assert recorder.returncode == 0, told
    assert not (tmp_path / ".spool").exists()
    assert list(open_capture(tmp_path / "capture.mcap", port=None))


@pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="needs Unix sockets")
def test_a_service(
    processes: Any, controller: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It reports that it is ready, alive and stopping. A health check succeeds while it runs."""
    address, out = str(tmp_path / "notify"), str(tmp_path / "out")
    monkeypatch.setenv("NOTIFY_SOCKET", address)
    assert processes.run("record", "--check", out).returncode == 3
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.settimeout(DEADLINE_S)
        manager.bind(address)
        recorder = processes.start("record", controller, *LOCAL, "--out", out)
        url = url_in(recorder.stdout.readline())
        states = [manager.recv(100) for _ in range(4)]
        assert states.count(b"READY=1") == 1
        assert states.count(b"WATCHDOG=1") == 3
        ask(url)
        until_s = time.monotonic() + DEADLINE_S
        while health_problems(Path(out)):  # its writing process starts
            assert time.monotonic() < until_s
        checked = processes.run("record", "--check", out)
        assert (checked.returncode, checked.stdout) == (0, f"a recorder writes into {out}\n")
        recorder.send_signal(signal.SIGTERM)
        while manager.recv(100) != b"STOPPING=1":
            pass
        recorder.communicate(timeout=DEADLINE_S)
    assert processes.run("record", "--check", out).returncode == 3


@pytest.mark.parametrize("rotate", [(), ("--rotate", "1h", "--keep", "30d", "--protect", "5m")])
def test_a_trigger_runs_a_command(
    processes: Any, controller: str, tmp_path: Path, rotate: tuple[str, ...]
) -> None:
    """It gets the facts of the trigger, and its file exists."""
    script = tmp_path / "report.py"
    script.write_text(
        "import os, pathlib\n"
        "assert pathlib.Path(os.environ['SCARASPEC_FILE']).stat().st_size\n"
        "report = pathlib.Path(__file__).with_suffix('.txt')\n"
        "report.write_text('{SCARASPEC_TRIGGER} {SCARASPEC_REASON}'.format_map(os.environ))\n"
    )
    recorder = processes.start(
        *("record", controller, *LOCAL, "--out", str(tmp_path / "out"), *rotate),
        *("--trigger", "disconnect", "--on-trigger", f"{sys.executable} -S {script}"),
    )
    ask(url_in(recorder.stdout.readline()))
    assert "failed" not in end(recorder)
    assert script.with_suffix(".txt").read_text() == "disconnect connection 1 closed"


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGUSR1")
def test_sigusr1_writes_a_mark(processes: Any, controller: str, tmp_path: Path) -> None:
    """SIGUSR1 goes to the process that the user started; early or late, no mark is lost."""
    recorder = processes.start(
        *("record", controller, *LOCAL, "--out", str(tmp_path)),
        *("--trigger", "signal", "--rotate", "1h"),
    )
    url = url_in(recorder.stdout.readline())
    recorder.send_signal(signal.SIGUSR1)  # the writing process has hardly started
    first = next(line for line in recorder.stdout if "requested by SIGUSR1" in line)
    ask(url)
    printed = end(recorder)
    assert recorder.returncode == 0, printed
    assert first.startswith("trigger signal at ")
    assert first.endswith(" UTC: requested by SIGUSR1\n")
    (path,) = tmp_path.glob("*.mcap")
    assert marks(path) == ["signal: requested by SIGUSR1"]
    assert sum(len(event.data) for event in open_capture(path, port=None)) > 20


@pytest.mark.skipif(sys.platform != "linux", reason="finds the writing process by /proc")
def test_sigusr1_while_the_writing_process_restarts(
    processes: Any, controller: str, tmp_path: Path
) -> None:
    """The mark is written by the restarted writing process, into its own file."""
    recorder = processes.start(
        *("record", controller, *LOCAL, "--out", str(tmp_path), "--trigger", "signal")
    )
    ask(url_in(recorder.stdout.readline()))
    os.kill(child_of(recorder.pid, "writer"), signal.SIGKILL)
    recorder.send_signal(signal.SIGUSR1)
    assert any("requested by SIGUSR1" in line for line in recorder.stdout)
    end(recorder)
    found = [mark for path in written(tmp_path) for mark in marks(path)]
    assert found == ["signal: requested by SIGUSR1"]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems stamp nothing")
def test_the_kernels_time_is_recorded(processes: Any, controller: str, tmp_path: Path) -> None:
    """The raw chunks have the times at which the system received and forwarded them."""
    recorder = processes.start(
        *("record", controller, *LOCAL, "--out", str(tmp_path), "--timestamps", "kernel")
    )
    ask(url_in(recorder.stdout.readline()))
    end(recorder)
    events = list(open_capture(tmp_path / "capture.mcap", port=None))
    passages = [event for event in events if isinstance(event, ForwardedChunk)]
    assert len(passages) == sum(event.kind is Kind.BYTES for event in events)
    assert all(event.time_ns <= event.forwarded_ns for event in passages)
    assert any(event.kernel_time for event in passages)


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGUSR1")
def test_an_unused_signal_is_ignored(processes: Any, controller: str, tmp_path: Path) -> None:
    """The default action of the signal would kill the recorder."""
    recorder = processes.start("record", controller, *LOCAL, "--out", str(tmp_path))
    url = url_in(recorder.stdout.readline())
    recorder.send_signal(signal.SIGUSR1)
    assert any(line.startswith("SIGUSR1 has no effect: ") for line in recorder.stdout)
    ask(url)
    end(recorder)
    assert recorder.returncode == 0


def test_several_robots_and_their_metrics(processes: Any, controller: str, tmp_path: Path) -> None:
    """Each robot has its own listener, folder and metrics."""
    config = tmp_path / "lines.toml"
    config.write_text(
        f'out = "{tmp_path}"\n'
        f'[robots.left]\nurl = "{controller}"\nlisten = "127.0.0.1:0"\n'
        f'[robots.right]\nurl = "{controller}"\nlisten = "localhost:0"\n'
    )
    recorder = processes.start("record", "--config", str(config), "--metrics", "127.0.0.1:0")
    metrics = recorder.stdout.readline().split()[-1]
    begun = sorted(recorder.stdout.readline() for _ in "ab")
    urls = {line.split(" in ")[1].split(";")[0].rpartition("/")[2]: line for line in begun}
    ask(url_in(urls["left"]))
    expected = 'scaraspec_connections_total{robot="left"} 1.0'
    until_s = time.monotonic() + DEADLINE_S
    while expected not in (seen := urllib.request.urlopen(metrics, timeout=30).read().decode()):
        assert time.monotonic() < until_s, seen
    assert 'scaraspec_connections_total{robot="right"} 0.0' in seen
    printed = end(recorder)
    assert recorder.returncode == 0, printed
    assert "left:\nfrom the client: " in printed
    assert list(open_capture(tmp_path / "left" / "capture.mcap", port=None))
    assert not list(open_capture(tmp_path / "right" / "capture.mcap", port=None))


def test_files_of_a_killed_recorder_are_repaired(
    processes: Any, controller: str, tmp_path: Path
) -> None:
    """At the next start, with a notice; the new recording has its own file."""
    arguments = ("record", controller, *LOCAL, "--out", str(tmp_path))
    recorder = processes.start(*arguments)
    ask(url_in(recorder.stdout.readline()))
    end(recorder)
    truncated = tmp_path / "capture.mcap"
    truncated.write_bytes(truncated.read_bytes()[:-100])
    recorder = processes.start(*arguments)
    printed = recorder.stdout.readline() + recorder.stdout.readline() + end(recorder)
    assert f"repaired {truncated}: the file was not closed" in printed
    assert "files: capture-2.mcap" in printed
    assert processes.run("recover", str(truncated)).returncode == 0


def test_a_second_signal_ends_the_waiting(processes: Any, controller: str, tmp_path: Path) -> None:
    """A hanging sink does not block the user; the rest is reported, and written by the next
    recorder."""
    arguments = ("record", controller, *LOCAL, "--out", str(tmp_path))
    recorder = processes.start(*arguments)
    ask(url_in(recorder.stdout.readline()))
    # The tap may keep bytes for 20 ms before it writes them.
    wait_for_spooled(tmp_path, b"\xcc\x09\x0200\xaa")
    with hanging_writer(recorder.pid, tmp_path):
        recorder.send_signal(signal.SIGINT)
        assert any(line.startswith("stopping: ") for line in recorder.stdout)
        writer = os.pidfd_open(child_of(recorder.pid, "writer"))
        recorder.send_signal(signal.SIGINT)
        assert select.select([writer], [], [], DEADLINE_S)[0]
        os.close(writer)
    printed, _ = recorder.communicate(timeout=DEADLINE_S)
    assert recorder.returncode == 3
    assert "is incomplete" in printed
    assert "Traceback" not in printed
    recorder = processes.start(*arguments)
    recorder.stdout.readline()
    printed = end(recorder)
    assert "files: capture" in printed
    recorded = [e for file in written(tmp_path) for e in open_capture(file, port=None)]
    assert sum(len(event.data) for event in recorded) > 20


def test_sighup_comes_twice(processes: Any, controller: str, tmp_path: Path) -> None:
    """SIGHUP comes from the system and from the shell: the rest is still written."""
    recorder = processes.start("record", controller, *LOCAL, "--out", str(tmp_path))
    ask(url_in(recorder.stdout.readline()))
    with hanging_writer(recorder.pid, tmp_path):
        recorder.send_signal(signal.SIGHUP)
        assert any(line.startswith("stopping: ") for line in recorder.stdout)
        recorder.send_signal(signal.SIGHUP)
    printed, _ = recorder.communicate(timeout=DEADLINE_S)
    assert recorder.returncode == 0, printed


@contextmanager
def hanging_writer(pid: int, out_dir: Path) -> Iterator[None]:
    """Let the writer process wait for a lock. A suspended one would be continued."""
    os.kill(child_of(pid, "writer"), signal.SIGKILL)
    held = lock(spool_folder(out_dir) / READER_LOCK, wait=True)
    try:
        yield
    finally:
        os.close(held)


def wait_for_spooled(out_dir: Path, data: bytes) -> None:
    """Wait until the bytes are in the spool, where they survive the end of the tap."""
    until_s = time.monotonic() + DEADLINE_S
    while not any(data in part.read_bytes() for part in spool_folder(out_dir).glob("*.spool")):
        assert time.monotonic() < until_s, "nothing of it was spooled"


def child_of(pid: int, name: str) -> int:
    """Return the child process with this name, as soon as it exists."""
    until_s = time.monotonic() + DEADLINE_S
    while not (found := [c for c in children(pid) if name_of(c) == f"scara-{name}"]):
        assert time.monotonic() < until_s, f"there is no {name}"
    return found[0]


def children(pid: int) -> list[int]:
    """The child processes of a process."""
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(child) for child in found.split()]


def name_of(pid: int) -> str:
    """The name of a process in process lists."""
    return Path(f"/proc/{pid}/comm").read_text().strip()


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
def test_a_terminal_gets_a_dashboard(
    controller: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Connections, bytes and the file are updated."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "160")
    near, far = os.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "scaraspec", "record", controller, *LOCAL, "--out", str(tmp_path)],
        stdout=far,
    ) as recorder:
        os.close(far)
        try:
            screen = read_until(near, "press Ctrl-C to stop")
            ask(url_in(screen[screen.index("recording") :].splitlines()[0]))
            read_until(near, " 1 ")
            recorder.terminate()
            last = read_until(near, "files: capture.mcap")
            assert recorder.wait(DEADLINE_S) == 0
        finally:
            recorder.kill()
            os.close(near)
    assert "client/s" in last


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
def test_a_serial_line(processes: Any, tmp_path: Path) -> None:
    """A serial line is recorded like any other; the file states that it needs no login (L83)."""
    pytest.importorskip("serial")
    robot, line = os.openpty()
    recorder = processes.start(
        "record", f"serial://{os.ttyname(line)}", *LOCAL, "--out", str(tmp_path)
    )
    where = recorder.stdout.readline().split()[1].rpartition(":")
    question, answer = b"\xaa\x09\x00\xcc", b"\xcc\x09\x0200\xaa"
    with socket.create_connection((where[0], int(where[2])), DEADLINE_S) as client:
        client.sendall(question)
        assert read_bytes(robot, len(question)) == question
        os.write(robot, answer)
        assert client.recv(len(answer), socket.MSG_WAITALL) == answer
    end(recorder)
    for descriptor in (robot, line):
        os.close(descriptor)
    events = list(open_capture(tmp_path / "capture.mcap", port=None))
    found = {way: b"".join(e.data for e in events if e.direction is way) for way in (A2C, C2A)}
    assert found == {A2C: question, C2A: answer}
    assert processes.run("audit", str(tmp_path / "capture.mcap")).returncode == 0


def read_bytes(descriptor: int, size_bytes: int) -> bytes:
    """Read this number of bytes from a terminal."""
    found = b""
    while len(found) < size_bytes:
        assert select.select([descriptor], [], [], DEADLINE_S)[0], found
        found += os.read(descriptor, size_bytes - len(found))
    return found


def read_until(descriptor: int, text: str) -> str:
    """Read a terminal until this text."""
    shown = ""
    while text not in shown:
        assert select.select([descriptor], [], [], DEADLINE_S)[0], shown
        shown += os.read(descriptor, 65536).decode()
    return shown


@pytest.mark.parametrize(
    ("arguments", "expected_text"),
    [
        ((), "no controller"),
        (("tcp://127.0.0.1", "--config", "x.toml"), "cannot be combined"),
        (("--config", "x.toml", "--out", "x"), "--out cannot be combined with --config"),
        (("--config", "/nowhere.toml"), "/nowhere.toml cannot be read"),
        (("tcp://127.0.0.1", "--rotate", "soon"), "--rotate: 'soon'"),
        (("tcp://127.0.0.1", "--metrics", "192.0.2.7:9100"), "served only on this machine"),
        (("serial:///dev/ttyX", "--mode", "tproxy"), "needs TCP on both sides"),
        (("tcp://127.0.0.1", "--trigger", "bang"), "--trigger: 'bang' is not a trigger"),
        (("tcp://127.0.0.1", "--check", "x"), "--check cannot be combined"),
        (("tcp://127.0.0.1", "--on-trigger", "sh"), "--on-trigger has no effect without trigger"),
        (("tcp://127.0.0.1", "--on-trigger", "/nope"), "--on-trigger: '/nope': there is no such"),
        (("tcp://127.0.0.1", "--trigger", "gap", "--protect", "5m"), "without keep or min-free"),
        (("tcp://127.0.0.1", "--listen", "tcp://127.0.0.1"), "is not an address to listen on"),
        (("tcp://127.0.0.1", "--listen", "8877"), "8877 has no host: write HOST:PORT, as 127."),
        (("tcp://127.0.0.1", "--listen", ":8877"), ":8877 has no host: write HOST:PORT"),
        (
            ("tcp://127.0.0.1", "--listen", "127.0.0.1:0", "--listen", "serial:///dev/ttyX"),
            "cannot be combined with other addresses",
        ),
        (("tcp://127.0.0.1", "--inject", "/nowhere.toml"), "--inject: /nowhere.toml"),
        (("tcp://127.0.0.1", "--listen", "0.0.0.0:0", "--inject", "FAULTS"), "add --i-mean-it"),
    ],
)
def test_usage(
    refused: Callable[..., str], tmp_path: Path, arguments: tuple[str, ...], expected_text: str
) -> None:
    """User errors are reported, and nothing is created."""
    faults = tmp_path / "faults.toml"
    faults.write_text('[[rule]]\nfault = "drop"\n')
    viewed = [str(faults) if each == "FAULTS" else each for each in arguments]
    out = () if "--out" in viewed or "--config" in viewed else ("--out", str(tmp_path / "out"))
    assert expected_text in refused("record", *viewed, *out)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("listen", ["127.0.0.1", "0.0.0.0", "*"])
def test_its_own_address_as_target(processes: Any, tmp_path: Path, listen: str) -> None:
    """It is refused at the start, also if the recorder listens on all addresses."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    done = processes.run(
        *("record", f"tcp://127.0.0.1:{port}", "--listen", f"{listen}:{port}"),
        *("--out", str(tmp_path)),
    )
    assert done.returncode == 2
    assert "the target is the recorder's own address" in done.stderr


def test_several_addresses_of_both_kinds(processes: Any, controller: str, tmp_path: Path) -> None:
    """Clients connect by IPv4 and IPv6 to the same port of a host, and to further addresses."""
    recorder = processes.start(
        *("record", controller, "--listen", "*:0", *LOCAL, "--out", str(tmp_path))
    )
    line = recorder.stdout.readline()
    assert line.startswith("recording 0.0.0.0:"), line
    addresses = line.split(" to ")[0].removeprefix("recording ").split(" and ")
    port = addresses[0].rpartition(":")[2]
    assert addresses[1:-1] == ([f"[::]:{port}"] if socket.has_dualstack_ipv6() else [])
    for address in addresses:
        ask(f"tcp://{address}".replace("0.0.0.0", "127.0.0.1").replace("[::]", "[::1]"))
    assert f"{len(addresses)} connections" in end(recorder)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("serial:///dev/nope", *LOCAL), "waiting for /dev/nope, which does not exist"),
        (
            ("tcp://192.0.2.1", "--listen", "serial:///dev/nope"),
            "waiting for the client's line, which cannot be opened",
        ),
        pytest.param(
            ("tcp://192.0.2.1", "--mode", "redirect", *LOCAL),
            "waiting for clients that firewall rules redirect to port ",
            marks=pytest.mark.skipif(
                sys.platform != "linux" or os.geteuid() != 0, reason="needs root"
            ),
        ),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="names a device of POSIX")
def test_what_a_recorder_waits_for(
    processes: Any, tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    """What does not exist yet is reported at the start."""
    pytest.importorskip("serial")
    recorder = processes.start("record", *arguments, "--out", str(tmp_path))
    assert any(says in line for line in recorder.stdout)
    end(recorder)


@pytest.mark.skipif(sys.platform == "win32", reason="names of files are Unicode")
@pytest.mark.parametrize("names", [("线", "x"), ("line", "线")])
def test_a_name_that_the_system_cannot_encode(tmp_path: Path, names: tuple[str, str]) -> None:
    """A locale without these letters is reported as one sentence."""
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    robot, out = names
    config = tmp_path / "lines.toml"
    config.write_text(f'[robots."{robot}"]\nurl = "tcp://192.0.2.7"\nout = "{out}"\n', "utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "scaraspec", "record", "--config", str(config)],
        env={**os.environ, **locale},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 2
    assert "cannot be used in file names, whose encoding is " in done.stderr
    assert "Traceback" not in done.stderr


def test_an_address_in_use_ends_all_recorders(processes: Any, tmp_path: Path) -> None:
    """If one of several recorders cannot start, this is reported and the others end."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        config = tmp_path / "lines.toml"
        config.write_text(
            f'out = "{tmp_path}"\n'
            '[robots.left]\nurl = "tcp://127.0.0.1:9"\nlisten = "127.0.0.1:0"\n'
            f'[robots.right]\nurl = "tcp://127.0.0.1:9"\nlisten = "127.0.0.1:{port}"\n'
        )
        done = processes.run("record", "--config", str(config))
    assert done.returncode == 2
    assert f"cannot record 127.0.0.1:{port}" in done.stderr
    assert "Traceback" not in done.stderr
