"""Reports readiness, the end and signs of life to a service manager, by the protocol of systemd.

Without a service manager, or on a system without Unix sockets, nothing is reported.
"""

import os
import socket
import sys
from contextlib import suppress
from typing import Final

READY: Final = "READY=1"
STOPPING: Final = "STOPPING=1"
ALIVE: Final = "WATCHDOG=1"


def notify(state: str) -> None:
    """Report a state, see sd_notify(3). A service manager that does not listen is ignored."""
    address = os.environ.get("NOTIFY_SOCKET")
    if sys.platform == "win32" or not address:
        return
    if address.startswith("@"):
        address = f"\0{address[1:]}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock, suppress(OSError):
        sock.settimeout(0)
        sock.sendto(state.encode(), address)
