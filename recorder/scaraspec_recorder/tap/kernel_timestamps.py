"""Reads a socket together with the kernel's reception timestamps (Linux).

Event loops do not read these timestamps; `TimestampedReader` replaces their reads for one socket.
"""

import asyncio
import os
import socket
import struct
import sys
from collections.abc import Callable
from typing import Final

READ_BYTES: Final = 64 << 10
"""Maximum size of one read."""

_SO_TIMESTAMPNS: Final = 64  # SO_TIMESTAMPNS_NEW, of 64 bits everywhere; socket has no name for it
_STAMP: Final = struct.Struct("=qq")
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(_STAMP.size) if sys.platform != "win32" else 0
_SECOND_NS: Final = 1_000_000_000

Received = Callable[[bytes, int, bool], None]
"""Receives bytes, reception time (ns since the epoch; 0 for now), whether it is from the kernel."""


def enable_timestamps(sock: socket.socket) -> bool:
    """Enable kernel timestamps for this socket and for sockets accepted from it.

    Returns:
        Whether the system supports it.
    """
    if sys.platform != "linux":
        return False
    try:
        sock.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
    except OSError:
        return False
    return True


class TimestampedReader:
    """Reads the socket of a transport instead of the transport. Starts paused.

    Args:
        transport: The transport; it must not read any more.
        received: Receives the data.
        ended: Called when the sender half-closes.

    Attributes:
        failure: Error of a failed read, after which the transport is aborted.

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
        # Duplicated: event loops do not watch a descriptor that a transport uses.
        number = os.dup(transport.get_extra_info("socket").fileno())
        self._sock = socket.socket(fileno=number)
        self._sock.settimeout(0)
        self._reading = False

    def pause_reading(self) -> None:
        """Pause reading."""
        if self._reading:
            self._reading = False
            self._loop.remove_reader(self._sock)

    def resume_reading(self) -> None:
        """Resume reading, unless the transport is closing."""
        if not self._reading and not self._transport.is_closing():
            self._reading = True
            self._loop.add_reader(self._sock, self._read)

    def is_reading(self) -> bool:
        """Whether reading is active."""
        return self._reading

    def is_closing(self) -> bool:
        """Whether the reader is closed."""
        return self._sock.fileno() < 0

    def close(self) -> None:
        """Close the duplicated socket."""
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
        else:  # received before timestamps were enabled
            self._received(data, 0, False)  # noqa: FBT003 - as above
