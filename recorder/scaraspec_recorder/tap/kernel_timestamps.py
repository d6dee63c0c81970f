"""Stamps: bytes read together with the time at which the system received them (Linux).

Law: reading of one socket, and the time that comes with it; where the bytes go is the affair of
others. The event loops read without asking for that time, so here is a reader in their place.
"""

import asyncio
import os
import socket
import struct
import sys
from collections.abc import Callable
from typing import Final

READ_BYTES: Final = 64 << 10
"""How much is read at once."""

_SO_TIMESTAMPNS: Final = 64  # SO_TIMESTAMPNS_NEW, of 64 bits everywhere; socket has no name for it
_STAMP: Final = struct.Struct("=qq")
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(_STAMP.size) if sys.platform != "win32" else 0
_SECOND_NS: Final = 1_000_000_000

Received = Callable[[bytes, int, bool], None]
"""Takes bytes, when they came in (ns since the epoch; 0 for now), and whether that is a stamp."""


def enable_timestamps(sock: socket.socket) -> bool:
    """Ask the system to stamp what this socket, or one accepted from it, receives from now on.

    Returns:
        Whether it can.
    """
    if sys.platform != "linux":
        return False
    try:
        sock.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
    except OSError:
        return False
    return True


class TimestampedReader:
    """Reads a transport's socket in the transport's place; it never reads at first.

    Args:
        transport: Whose socket it is; it is to read no more.
        received: Takes what is read.
        ended: Called where the sender sends no more.

    Attributes:
        failure: Why reading failed; the transport was aborted for it.

    Raises:
        OSError: The process has too many files open.
    """

    def __init__(
        self, transport: asyncio.Transport, received: Received, ended: Callable[[], object]
    ) -> None:
        self.failure: OSError | None = None
        self._transport = transport
        self._received = received
        self._ended = ended
        self._loop = asyncio.get_running_loop()
        # A number of its own: the event loops watch none that a transport has.
        number = os.dup(transport.get_extra_info("socket").fileno())
        self._sock = socket.socket(fileno=number)
        self._sock.settimeout(0)
        self._reading = False

    def pause_reading(self) -> None:
        """Read no more for now."""
        if self._reading:
            self._reading = False
            self._loop.remove_reader(self._sock)

    def resume_reading(self) -> None:
        """Read on, unless the transport is closing."""
        if not self._reading and not self._transport.is_closing():
            self._reading = True
            self._loop.add_reader(self._sock, self._read)

    def is_reading(self) -> bool:
        """Whether it reads."""
        return self._reading

    def is_closing(self) -> bool:
        """Whether it was closed."""
        return self._sock.fileno() < 0

    def close(self) -> None:
        """Let go of the socket."""
        self.pause_reading()
        self._sock.close()

    def _read(self) -> None:
        try:
            data, ancillary, _, _ = self._sock.recvmsg(READ_BYTES, _ANCILLARY_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self.failure = error
            self.pause_reading()
            self._transport.abort()
            return
        if not data:
            self.pause_reading()
            self._ended()
        elif ancillary:
            seconds, rest_ns = _STAMP.unpack(ancillary[0][2])
            self._received(data, seconds * _SECOND_NS + rest_ns, True)  # noqa: FBT003 - for the fewest steps
        else:  # it came in before the system had begun to stamp
            self._received(data, 0, False)  # noqa: FBT003 - as above
