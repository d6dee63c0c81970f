"""Peers: the forwarders that are measured.

This module starts them, waits until they are ready, and stops them. `forwarding` measures.
Everything listens on 127.0.0.1.
"""

import os
import shutil
import socket
import subprocess
import sys
import time
import venv
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

HOST: Final = "127.0.0.1"
PROBES: Final = 1
"""How many exchanges `running` itself sends through a peer."""

_LOGIN: Final = b"\xaa\x01\x08password\xcc"
_HERE: Final = Path(__file__).parent
_BIN: Final = Path(sys.executable).parent
_READY_S: Final = 30.0
_END_S: Final = 1800.0  # the time that the recorder gives its writing process for the rest
_POLL_S: Final = 0.05


@dataclass(frozen=True)
class Peer:
    """A forwarder.

    Attributes:
        name: What it is called in the results.
        command: Its command line: of the port to listen on, the port to connect to, a new folder.
        link_module: What only that one of its processes has loaded that forwards, where it has
            others: they are no part of the link.
    """

    name: str
    command: Callable[[int, int, Path], list[str]]
    link_module: str = ""


def compile_programs(folder: Path) -> None:
    """Compile the C programs into a folder.

    Raises:
        subprocess.CalledProcessError: The compiler refuses; the output has the reason.
    """
    for name in ("load", "bulk", "answer", "forward"):
        flags = ("-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror")
        command = ("cc", *flags, "-o", str(folder / name), str(_HERE / f"{name}.c"))
        subprocess.run(command, check=True)  # noqa: S603 - the compiler, and our own sources


def c_forwarder(programs: Path) -> Peer:
    """Return our C forwarder; it only forwards."""
    program = str(programs / "forward")
    return Peer("C forwarder", lambda port, target, _: [program, str(port), str(target)])


def uvloop_forwarder() -> Peer:
    """Return our uvloop forwarder; it only forwards."""
    start = (sys.executable, str(_HERE / "uvloop_forward.py"))
    return Peer("uvloop forwarder", lambda port, target, _: [*start, str(port), str(target)])


def epoll_forwarder() -> Peer:
    """Return our Python forwarder without an event loop; it only forwards."""
    start = (sys.executable, str(_HERE / "epoll_forward.py"))
    return Peer("epoll in Python", lambda port, target, _: [*start, str(port), str(target)])


def tap(*, taken: bool) -> Peer:
    """Return the tap of the recorder alone: records are dropped, or collected and not written."""

    def command(port: int, target: int, folder: Path) -> list[str]:
        spool = [str(folder)] if taken else []
        return [sys.executable, str(_HERE / "tap_forward.py"), str(port), str(target), *spool]

    return Peer(f"tap, records {'taken' if taken else 'dropped'}", command)


def recorder(name: str = "scaraspec record", *options: str) -> Peer:
    """Return the recorder, which records and decodes in other processes."""

    def command(port: int, target: int, folder: Path) -> list[str]:
        link = (f"tcp://{HOST}:{target}", "--listen", f"{HOST}:{port}")
        return [str(_BIN / "scaraspec"), "record", *link, "--out", str(folder), *options]

    return Peer(name, command, link_module="uvloop")


def socat() -> Peer | None:
    """Return socat, if it is installed."""
    program = shutil.which("socat")
    if not program:
        return None

    def command(port: int, target: int, _: Path) -> list[str]:
        listen = f"TCP-LISTEN:{port},bind={HOST},reuseaddr,fork,nodelay"
        return [program, listen, f"TCP:{HOST}:{target},nodelay"]

    return Peer("socat", command)


def mitmproxy(folder: Path) -> Peer:
    """Install mitmproxy into a folder of its own, and return it as a recorder of TCP.

    Raises:
        subprocess.CalledProcessError: It cannot be installed; the output of pip has the reason.
    """
    venv.create(folder, with_pip=True)
    pip = (str(folder / "bin" / "pip"), "install", "--quiet", "mitmproxy")
    subprocess.run(pip, check=True)  # noqa: S603 - the new environment's pip, and a name
    program = str(folder / "bin" / "mitmdump")

    def command(port: int, target: int, out: Path) -> list[str]:
        mode = f"reverse:tcp://{HOST}:{target}@{HOST}:{port}"
        return [program, "--quiet", "--mode", mode, "--save-stream-file", str(out / "flows")]

    return Peer("mitmproxy", command)


def free_port() -> int:
    """Return a free port."""
    with socket.create_server((HOST, 0)) as found:
        return int(found.getsockname()[1])


@contextmanager
def running(command: list[str], port: int, log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run a server for as long as the context lasts, from when it answers until it has ended.

    Raises:
        RuntimeError: It does not answer.
        subprocess.TimeoutExpired: It does not end.
    """
    with (
        log.open("wb") as output,
        subprocess.Popen(  # noqa: S603 - the command of a `Peer`
            command, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT
        ) as process,
    ):
        try:
            wait_until(
                lambda: process.poll() is not None or _answers(port),
                lambda: f"{command[0]} gives no answer: {log.read_text()}",
            )
            if process.poll() is not None:
                raise RuntimeError(f"{command[0]} has ended: {log.read_text()}")
            yield process
            process.terminate()
            process.wait(_END_S)
        finally:
            process.kill()


def set_processors(parent: int, link_module: str, processors: set[int]) -> int:
    """Move a process and its children onto these processors, but for the one that forwards.

    Returns:
        The one that forwards.

    Raises:
        RuntimeError: No process has loaded the module by which it is recognised.
    """
    linking: set[str] = set()

    def family() -> set[str]:
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text()
        return {str(parent), *children.split()}

    def found() -> bool:
        linking.update(n for n in family() if link_module in Path(f"/proc/{n}/maps").read_text())
        return bool(linking)

    wait_until(found, lambda: f"no process of {parent} has loaded {link_module}")
    for number in family() - linking:
        for task in Path(f"/proc/{number}/task").iterdir():
            os.sched_setaffinity(int(task.name), processors)
    return int(min(linking))


def wait_until(ready: Callable[[], bool], otherwise: Callable[[], str]) -> None:
    """Ask again and again.

    Raises:
        RuntimeError: The answer stays no.
    """
    deadline_s = time.monotonic() + _READY_S
    while not ready():
        if time.monotonic() > deadline_s:
            raise RuntimeError(otherwise())
        time.sleep(_POLL_S)


def _answers(port: int) -> bool:
    """Send one exchange; return whether its answer came."""
    try:
        with socket.create_connection((HOST, port), timeout=_READY_S) as link:
            link.sendall(_LOGIN)
            return bool(link.recv(64))
    except OSError:
        return False
