"""scaraspec in a Windows CPython under Wine, which `make test-windows` installs."""

import os
import pty
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

_TIMEOUT_S = 180.0

# Ctrl-Break cannot be sent under Wine: the process raises the signal when the file appears.
_INTERRUPTED_BY_FILE = """
import pathlib, signal, sys, threading, time

def interrupt(path=pathlib.Path(sys.argv.pop(1))):
    while not path.exists():
        time.sleep(0.1)
    signal.raise_signal(signal.SIGBREAK)

threading.Thread(target=interrupt, daemon=True).start()
from scaraspec.cli import main

if __name__ == "__main__":
    main()
"""


@dataclass
class Output:
    """What a command has written, and its exit status."""

    status: int
    stdout: str
    stderr: str


class RunningCommand:
    """A command that runs under Wine, with its output redirected to files."""

    def __init__(self, folder: Path, python: str, command: list[str], prefix: Path) -> None:
        self._out, self._err = folder / "stdout", folder / "stderr"
        self._stop_file = folder / "stop"
        words = " ".join(f'"{word}"' for word in command)
        script = folder / "run.bat"
        script.write_text(
            f'@echo off\r\nset SCARASPEC_STATE={folder.name}\\state\r\n"{python}" {words}'
            f" > {windows_path(self._out)} 2> {windows_path(self._err)}\r\n"
            "exit /b %errorlevel%\r\n"
        )
        self._console, far = pty.openpty()  # Python needs a console
        environment = {
            name: value for name, value in os.environ.items() if not name.startswith("PYTHON")
        }
        self.process = subprocess.Popen(
            ["wine", "cmd", "/c", windows_path(script)],
            stdin=far,
            stdout=far,
            stderr=far,
            cwd=folder.parent,
            env=environment | {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all"},
        )
        os.close(far)

    def interrupt(self) -> None:
        """Raise SIGBREAK in a command that was started by `Windows.started`."""
        self._stop_file.touch()

    @property
    def stdout(self) -> str:
        """What it has written so far."""
        return self._out.read_text("utf-8") if self._out.exists() else ""

    def wait_for(self, text: str) -> None:
        """Wait until a text is in the standard output."""
        until_s = time.monotonic() + _TIMEOUT_S
        while text not in self.stdout:
            assert self.process.poll() is None, self._err.read_text("utf-8")
            assert time.monotonic() < until_s, f"no {text}"
            time.sleep(0.1)

    def end(self) -> None:
        """Kill it if it runs."""
        self.process.kill()
        self.process.wait()
        if self._console >= 0:
            os.close(self._console)
            self._console = -1

    def finish(self) -> Output:
        """Wait for the end."""
        try:
            status = self.process.wait(_TIMEOUT_S)
        finally:
            self.end()
        return Output(status, self._out.read_bytes().decode(), self._err.read_bytes().decode())


class Windows:
    """Runs commands in one folder."""

    def __init__(self, installation: Path, folder: Path) -> None:
        self.folder = folder
        self._python = windows_path(installation / "python/python.exe")
        self._prefix = installation / "prefix"
        self._commands = 0

    def _start(self, command: list[str]) -> RunningCommand:
        self._commands += 1
        own = self.folder / f"command-{self._commands}"
        own.mkdir()
        (own / "interrupted_by_file.py").write_text(_INTERRUPTED_BY_FILE)
        words = [word.replace("OWN", windows_path(own)) for word in command]
        return RunningCommand(own, self._python, words, self._prefix)

    def run(self, *arguments: str) -> Output:
        """Run `scaraspec` with these arguments."""
        return self._start(["-m", "scaraspec", *arguments]).finish()

    @contextmanager
    def started(self, *arguments: str) -> Iterator[RunningCommand]:
        """Run `scaraspec` while the context is active; `interrupt` ends it."""
        script = ["OWN\\interrupted_by_file.py", "OWN\\stop"]
        command = self._start([*script, *arguments])
        try:
            yield command
        finally:
            command.end()


def windows_path(path: Path) -> str:
    """A path of this system as Wine names it."""
    return f"Z:{path}".replace("/", "\\")


@pytest.fixture(scope="session")
def installation() -> Path:
    """The folder with the Windows CPython."""
    return Path(os.environ["SCARASPEC_WINE"])


@pytest.fixture
def windows(installation: Path, tmp_path: Path) -> Windows:
    """Commands under Wine, in an empty folder."""
    return Windows(installation, tmp_path)


@pytest.fixture
def linux_controller(tmp_path: Path) -> Iterator[str]:
    """The URL of a virtual controller on this system."""
    ready = tmp_path / "ready"
    arguments = ("controller", "--listen", "127.0.0.1:0", "--ready-file", str(ready))
    process = subprocess.Popen(
        [sys.executable, "-m", "scaraspec", *arguments], stdout=subprocess.DEVNULL
    )
    try:
        until_s = time.monotonic() + _TIMEOUT_S
        while not ready.exists():
            assert process.poll() is None
            assert time.monotonic() < until_s
            time.sleep(0.05)
        yield f"tcp://{ready.read_text().strip()}"
    finally:
        process.terminate()
        process.wait()
