"""Drawing processes for tests: a process must be able to import them, unlike a fixture."""

import pickle
import threading
from multiprocessing.connection import Connection
from pathlib import Path


def collect(line: Connection, path: Path) -> None:
    """Keep all events."""
    events: list[object] = []
    try:
        while True:
            events += line.recv()[1]
    except EOFError:
        path.write_bytes(pickle.dumps(events))


def hang(_line: Connection) -> None:
    """Take no events, and never end."""
    threading.Event().wait()


def die(_line: Connection) -> None:
    """End immediately."""
