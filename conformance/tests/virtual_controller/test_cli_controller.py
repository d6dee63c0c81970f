"""``scaraspec controller``: process, files, signals and messages."""

import contextlib
import os
import selectors
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from scaraspec.cli.main import main
from scaraspec.protocol.program_files import Program, build
from scaraspec.transports.connect import connect
from scaraspec.transports.link import Link

_COMMAND = [sys.executable, "-c", "from scaraspec.cli.main import main; main()", "controller"]
_SOON_S = 20.0

Start = Callable[..., subprocess.Popen[str]]
Run = Callable[..., tuple[object, str, str]]


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts the command on a free port, and kills remaining processes."""
    with contextlib.ExitStack() as stack:

        def start(*options: str) -> subprocess.Popen[str]:
            process = subprocess.Popen(
                [*_COMMAND, "--listen", "127.0.0.1:0", *options],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
            stack.enter_context(process)
            stack.callback(process.kill)
            return process

        yield start


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command in this process; return exit status, output and error output."""

    def run(*options: str) -> tuple[object, str, str]:
        monkeypatch.setattr(sys, "argv", ["scaraspec", "controller", *options])
        with pytest.raises(SystemExit) as exited:
            main()
        return (exited.value.code, *capsys.readouterr())

    return run


def _line(process: subprocess.Popen[str]) -> str:
    """The next line of its output."""
    assert process.stdout is not None
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        assert selector.select(_SOON_S)
    return process.stdout.readline().strip()


def _connect(process: subprocess.Popen[str]) -> Link:
    printed = _line(process)
    assert printed.startswith("listening on tcp://127.0.0.1:")
    return connect(printed.removeprefix("listening on "), _SOON_S)


def _ask(link: Link, request: bytes) -> bytes:
    link.send(request)
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert isinstance(arrival.content, bytes)
    return arrival.content


def _send_line(process: subprocess.Popen[str], line: str) -> str:
    assert process.stdin is not None
    process.stdin.write(f"{line}\n")
    process.stdin.flush()
    return _line(process)


def _stop(process: subprocess.Popen[str], number: int = signal.SIGTERM) -> str:
    process.send_signal(number)
    _, errors = process.communicate(timeout=_SOON_S)
    assert process.returncode == 0
    return errors


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_address_and_clean_end(start: Start, tmp_path: Path, number: int) -> None:
    """Port 0 is replaced by the real port in output and ready file; a signal ends the process with
    status 0."""
    ready = tmp_path / "where"
    ready.write_text("from before")
    process = start("--ready-file", str(ready))
    printed = _line(process)
    host_port = ready.read_text().strip()
    assert printed == f"listening on tcp://{host_port}"
    assert list(tmp_path.iterdir()) == [ready]
    link = connect(f"tcp://{host_port}")
    assert _ask(link, b"\xaa\x01\x08password\xcc") == b"\xcc\x01\x011\xaa"
    assert _stop(process, number) == ""
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert not isinstance(arrival.content, bytes)
    link.close()


def test_shutdown_ends_the_process(start: Start) -> None:
    """4.35 over the protocol."""
    process = start()
    link = _connect(process)
    _ask(link, b"\xaa\x01\x08password\xcc")
    assert _ask(link, b"\xaa\x60\x00\xcc") == b"\xcc\x60\x011\xaa"
    assert process.wait(_SOON_S) == 0
    link.close()


def test_password_readings_and_programs(start: Start, tmp_path: Path) -> None:
    """Clients can observe the values of the options."""
    (tmp_path / "p.rob").write_bytes(build(Program()))
    options = ["--password", "geheim", "--programs", str(tmp_path), "--time-scale", "10"]
    process = start(*options, "--reading", "op_get_default=0x13", "--reading", "list_prefix_sep=0a")
    link = _connect(process)
    assert _ask(link, b"\xaa\x01\x08password\xcc") == b"\xcc\x01\x010\xaa"
    assert _ask(link, b"\xaa\x01\x06geheim\xcc") == b"\xcc\x01\x011\xaa"
    assert _ask(link, b"\xaa\x0b\x00\xcc") == b"\xcc\x0b\x060p.rob\xaa"
    link.send(b"\xaa\x0d\x00\xcc")
    assert _ask(link, b"\xaa\x13\x00\xcc") == b"\xcc\x13\x00\xaa"
    link.close()
    _stop(process)


def test_data_survive_a_restart(start: Start, tmp_path: Path) -> None:
    """--data keeps programs, password and poses (A-4-6); --password replaces it."""
    data = ["--data", str(tmp_path / "data")]
    process = start(*data)
    link = _connect(process)
    for request in (
        b"\xaa\x01\x08password\xcc",
        b"\xaa\x03\x0cpassword|new\xcc",
        b"\xaa\x35\x051|2|3\xcc",
        b"\xaa\x50\x01f\xcc",
        b"\xaa\x52\x0f\x03\0\0\0\0\0\0\0\x03\0\0\0abc\xcc",
    ):
        assert _ask(link, request)[2:] == b"\x011\xaa"
    link.close()
    process.kill()
    process.wait()
    process = start(*data)
    link = _connect(process)
    assert _ask(link, b"\xaa\x01\x03new\xcc") == b"\xcc\x01\x011\xaa"
    assert _ask(link, b"\xaa\x34\x00\xcc") == b"\xcc\x34\x051|2|3\xaa"
    assert _ask(link, b"\xaa\x0b\x00\xcc") == b"\xcc\x0b\x030|f\xaa"
    link.close()
    _stop(process)
    process = start(*data, "--password", "newer")
    link = _connect(process)
    assert _ask(link, b"\xaa\x01\x05newer\xcc") == b"\xcc\x01\x011\xaa"
    link.close()
    _stop(process)


def test_exchanges_are_logged_and_passwords_are_not(start: Start) -> None:
    """-v: one line per frame, with a time, on stderr."""
    process = start("-v")
    link = _connect(process)
    _ask(link, b"\xaa\x01\x08password\xcc")
    _ask(link, b"\xaa\x09\x00\xcc")
    link.close()
    errors = _stop(process)
    lines = [line.split(" ", 2)[2] for line in errors.splitlines()]
    assert lines[:5] == [
        "#1 opened over tcp",
        "#1 > 0x01 login ••••",
        "#1 < 0x01 login 1",
        "#1 > 0x09 get_status",
        "#1 < 0x09 get_status 00",
    ]
    assert "password" not in errors


def test_control_commands_on_stdin(start: Start) -> None:
    """--control: a reply to each line; the process continues after the end of stdin."""
    process = start("--control")
    link = _connect(process)
    _ask(link, b"\xaa\x01\x08password\xcc")
    assert _send_line(process, "motor-fault inner_arm,wrist") == "ok: status 15"
    assert _ask(link, b"\xaa\x09\x00\xcc") == b"\xcc\x09\x0215\xaa"
    assert _send_line(process, "analog 2 4.75") == "ok: analog input 2 is 4.75"
    assert _ask(link, b"\xaa\x44\x0202\xcc") == b"\xcc\x44\x061|4.75\xaa"
    assert _send_line(process, "boom").startswith("error: there is no command 'boom'")
    assert process.stdin is not None
    process.stdin.close()
    assert _ask(link, b"\xaa\x09\x00\xcc") == b"\xcc\x09\x0215\xaa"
    link.close()
    process.stdin = None
    _stop(process)


def test_control_lines_may_come_from_a_file(tmp_path: Path) -> None:
    """A regular file cannot be polled like a pipe, but is read, too."""
    script = tmp_path / "script"
    script.write_text("input 1 1\nmotor-fault wrist\n")
    with script.open() as lines:
        command = [*_COMMAND, "--listen", "127.0.0.1:0", "--control"]
        process = subprocess.Popen(command, stdin=lines, stdout=subprocess.PIPE, text=True)
    with process:
        assert process.stdout is not None
        printed = [process.stdout.readline() for _ in range(3)]
        process.terminate()
        assert process.wait(_SOON_S) == 0
    assert printed[1:] == ["ok: digital input 1 is 1\n", "ok: status 14\n"]


@pytest.mark.parametrize("scheme", ["", "serial://"])
def test_a_serial_device_is_served(start: Start, scheme: str) -> None:
    """--serial takes a path or a link URL."""
    master, slave = os.openpty()
    process = start("--serial", f"{scheme}{os.ttyname(slave)}")
    assert _line(process).startswith("listening on ")
    os.write(master, b"\xaa\x09\x00\xcc")
    assert os.read(master, 6) == b"\xcc\x09\x0200\xaa"
    _stop(process)
    os.close(slave)
    os.close(master)


def test_a_port_in_use_is_an_error_of_one_sentence(run: Run) -> None:
    """Exit status 2, and a remedy in the message."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        status, _, errors = run("--listen", f"127.0.0.1:{port}")
    assert status == 2
    assert errors == (
        f"scaraspec: cannot listen on 127.0.0.1:{port}: Address already in use; "
        "choose another --listen, port 0 for any\n"
    )


@pytest.mark.parametrize(
    ("options", "reported"),
    [
        (["--listen", "8877:x"], "'x' is not a valid port"),
        (["--listen", "::1:0"], "write an IPv6 address as [::1:0]:8877"),
        (["--listen", "192.0.2.1:0"], "cannot listen on 192.0.2.1:0: Cannot assign requested"),
        (["--listen", f"{'a' * 70}:0"], "the host name is unknown"),
        (["--reading", "endian=middle"], "endian cannot be 'middle'"),
        (["--reading", "nonsense"], "is not a setting"),
        (["--password", "a|b"], "--password takes 1 to 127 bytes without '|'"),
        (["--password", ""], "--password takes"),
        (["--programs", "/nowhere"], "the programs in /nowhere cannot be read"),
        (["--data", "/dev/null/x"], "/dev/null/x cannot be used as a store"),
        (["--serial", "tcp://robot"], "--serial takes a serial device, not 'tcp://robot'"),
        (["--serial", "/dev/null"], "/dev/null is not a serial device"),
        (["--ready-file", "/nowhere/where"], "--ready-file /nowhere/where cannot be written"),
    ],
)
def test_invalid_options_are_an_error_of_one_sentence(
    run: Run, options: list[str], reported: str
) -> None:
    """Exit status 2, no traceback."""
    listen = [] if "--listen" in options else ["--listen", "127.0.0.1:0"]
    status, _, errors = run(*listen, *options)
    assert status == 2
    assert reported in errors
    assert errors.startswith("scaraspec: ")
    assert errors.count("\n") == 1


def test_help_fits_a_screen_and_ends_with_an_example(run: Run) -> None:
    """24 lines of 80 characters."""
    status, printed, _ = run("--help")
    lines = printed.splitlines()
    assert status == 0
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert lines[-1].strip().startswith("scaraspec controller ")
