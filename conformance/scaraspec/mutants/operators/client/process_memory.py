"""State that a client's process keeps from one connection to the next, like static variables."""

import asyncio
from typing import Any, Final
from weakref import WeakKeyDictionary

_MEMORIES: Final[WeakKeyDictionary[asyncio.AbstractEventLoop, dict[str, Any]]] = WeakKeyDictionary()


def memory() -> dict[str, Any]:
    """Return the state of the client that runs in this event loop."""
    return _MEMORIES.setdefault(asyncio.get_running_loop(), {})
