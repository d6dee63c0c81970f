"""What a client's process remembers from one connection to the next, as static variables do."""

import asyncio
from typing import Any, Final
from weakref import WeakKeyDictionary

_MEMORIES: Final[WeakKeyDictionary[asyncio.AbstractEventLoop, dict[str, Any]]] = WeakKeyDictionary()


def memory() -> dict[str, Any]:
    """The static variables of the client that runs in this loop."""
    return _MEMORIES.setdefault(asyncio.get_running_loop(), {})
