"""A child process that fails, for tests: it must be importable, unlike a fixture."""

import os
import socket
import sys
import threading
from pathlib import Path

from scaraspec_recorder.child_process import REPORTED_EXIT_STATUS


def fail_once(marker: Path, _line: socket.socket) -> None:
    """Report the reason, and leave a thread that never ends; the next call succeeds."""
    if not marker.exists():
        marker.touch()
        threading.Thread(target=threading.Event().wait).start()
        sys.exit(REPORTED_EXIT_STATUS)


def lack_files(marker: Path, _line: socket.socket) -> None:
    """Open more files than the process may; the next call succeeds."""
    if not marker.exists():
        marker.touch()
        while True:
            os.dup(0)
