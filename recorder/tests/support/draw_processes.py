"""Drawing processes for tests: they must be importable there, as no fixture is."""

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
    """Take nothing, and never end."""
    threading.Event().wait()


def die(_line: Connection) -> None:
    """End at once."""
