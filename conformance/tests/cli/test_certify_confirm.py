"""On a terminal, a run that will move the robot asks for confirmation before it sends anything."""

import os
import pty
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, suppress
from typing import Any

import pytest

CERTIFY = [sys.executable, "-m", "scaraspec", "certify", "controller"]
MOTION = ("--allow", "state,motion", "--only", "4.25/2")
LIMIT_S = 60


@pytest.fixture
def url(processes: Any) -> str:
    """The URL of a virtual controller."""
    host, port = processes.controller()
    return f"tcp://{host}:{port}"


class Terminal:
    """A process of scaraspec on its own terminal."""

    def __init__(self, *arguments: str) -> None:
        self._near, far = pty.openpty()
        self.run = subprocess.Popen([*CERTIFY, *arguments], stdin=far, stdout=far, stderr=far)
        os.close(far)
        self.shown = ""

    def until(self, text: str) -> None:
        """Read until this text is printed."""
        while text not in self.shown:
            self.shown += os.read(self._near, 4096).decode()

    def answer(self, text: str) -> None:
        """Type a line."""
        os.write(self._near, f"{text}\n".encode())

    def end(self) -> int:
        """Read to the end; return the exit status."""
        with suppress(OSError):  # the terminal ends with the process
            while data := os.read(self._near, 4096):
                self.shown += data.decode()
        return self.run.wait(LIMIT_S)

    def close(self) -> None:
        """End the run, so that it restores the robot."""
        self.run.kill()
        self.run.wait()
        os.close(self._near)


@pytest.fixture
def terminals() -> Iterator[list[Terminal]]:
    """The terminals in this list are closed after the test."""
    started: list[Terminal] = []
    yield started
    for terminal in started:
        terminal.close()


def test_only_yes_moves_the_robot(terminals: list[Terminal]) -> None:
    """The question has axes, travel and speed; after "n" nothing is sent, exit status 2."""
    controller = socket.create_server(("127.0.0.1", 0))
    controller.settimeout(0)
    url = f"tcp://127.0.0.1:{controller.getsockname()[1]}"
    terminals.append(terminal := Terminal(url, *MOTION))
    terminal.until("[y/N]")
    assert "x, y, z" in terminal.shown
    assert "4.5 mm" in terminal.shown
    assert "10 %" in terminal.shown
    terminal.answer("n")
    assert terminal.end() == 2
    assert "nothing was sent" in terminal.shown
    with closing(controller), pytest.raises(BlockingIOError):
        controller.accept()


def test_confirmation_is_requested_once(url: str, terminals: list[Terminal]) -> None:
    """After "y" the run continues to its verdict."""
    terminals.append(terminal := Terminal(url, *MOTION))
    terminal.until("[y/N]")
    terminal.answer("y")
    assert terminal.end() == 0
    assert terminal.shown.count("[y/N]") == 1


def test_yes_needs_no_answer(terminals: list[Terminal]) -> None:
    """With --yes the run connects at once."""
    with closing(socket.create_server(("127.0.0.1", 0))) as controller:
        url = f"tcp://127.0.0.1:{controller.getsockname()[1]}"
        terminals.append(Terminal(url, *MOTION, "--yes"))
        controller.settimeout(LIMIT_S)
        controller.accept()[0].close()


def test_a_run_without_motion_needs_no_confirmation(url: str, terminals: list[Terminal]) -> None:
    """Queries need no confirmation."""
    terminals.append(terminal := Terminal(url, "--only", "4.7"))
    assert terminal.end() == 0
    assert "[y/N]" not in terminal.shown
