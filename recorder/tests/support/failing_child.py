"""A child for tests that fails: it must be importable in its process, as no fixture is."""

import socket
import sys
import threading
from pathlib import Path

from scaraspec_recorder.child_process import REPORTED_EXIT_STATUS


def fail_once(lives: Path, _line: socket.socket) -> None:
    """Say why, and leave a thread that never ends; all is well the next time."""
    if not lives.exists():
        lives.touch()
        threading.Thread(target=threading.Event().wait).start()
        sys.exit(REPORTED_EXIT_STATUS)
