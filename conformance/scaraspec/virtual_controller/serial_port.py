"""The serial port: a device such as ``/dev/rfcomm0``, whose client needs no login (L83).

If the device disappears, as Bluetooth devices do, the server opens it again when it is back.
"""

import asyncio
import importlib
import logging
import os
from typing import Final

from scaraspec.user_message import UserMessage
from scaraspec.virtual_controller.server import SLICE_BYTES, UNREAD_BYTES, Server

REOPEN_S: Final = 1.0
"""Interval in seconds between attempts to reopen a device that has disappeared."""

log = logging.getLogger("scaraspec.virtual_controller")


class SerialPortError(Exception):
    """The device cannot be used. The text is one sentence."""


class SerialPort:
    """A serial device that a server serves until the server stops.

    Args:
        server: The server.
        device: Path of the device.
        baud: Speed in bits per second; a pty or an RFCOMM device accepts any speed.

    Raises:
        SerialPortError: This system does not support serial ports, or the device cannot be
            opened.
    """

    def __init__(self, server: Server, device: str, baud: int) -> None:
        self._server = server
        self._device = device
        self._baud = baud
        self._loop = asyncio.get_running_loop()
        self._unsent = bytearray()
        self._connection: int | None = None
        self._line = open_line(device, baud)
        self._start_session()

    def send(self, data: bytes) -> None:
        """Send bytes, buffered until the device accepts them."""
        self._unsent += data
        self._write()

    def finish(self) -> None:
        """End the session; start a new one unless the server stops."""
        self._end_session()
        if self._server.stopped.is_set():
            self._close()
        else:
            self._loop.call_soon(self._start_session)

    def abort(self) -> None:
        """End the session like `finish`: a serial line cannot be disconnected."""
        self.finish()

    def _start_session(self) -> None:
        self._connection = self._server.add_connection(self, "serial")
        if self._connection is None:  # the server is full
            self._loop.call_later(REOPEN_S, self._start_session)
        else:
            self._loop.add_reader(self._line, self._read)

    def _end_session(self) -> None:
        self._loop.remove_reader(self._line)
        if self._connection is not None:
            connection, self._connection = self._connection, None
            self._server.remove_connection(connection)

    def _read(self) -> None:
        try:
            data = os.read(self._line, SLICE_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._device_lost()
        elif self._connection is not None:
            self._server.receive(self._connection, data)

    def _write(self) -> None:
        try:
            written = os.write(self._line, self._unsent)
        except BlockingIOError:
            written = 0
        except OSError:
            self._device_lost()
            return
        del self._unsent[:written]
        if self._unsent:
            self._loop.add_writer(self._line, self._write)
        else:
            self._loop.remove_writer(self._line)
        if self._connection is not None:
            if len(self._unsent) > UNREAD_BYTES:
                self._loop.remove_reader(self._line)
            else:
                self._loop.add_reader(self._line, self._read)

    def _device_lost(self) -> None:
        """Handle the loss of the device: end the session and wait for the device."""
        log.info("%s has disappeared", self._device)
        self._end_session()
        self._close()
        self._reopen()

    def _reopen(self) -> None:
        try:
            self._line = open_line(self._device, self._baud)
        except SerialPortError:
            self._loop.call_later(REOPEN_S, self._reopen)
        else:
            log.info("%s is back", self._device)
            self._start_session()

    def _close(self) -> None:
        self._unsent.clear()
        self._loop.remove_reader(self._line)
        self._loop.remove_writer(self._line)
        os.close(self._line)


def open_line(device: str, baud: int) -> int:
    """Open a serial device in raw, non-blocking mode.

    Returns:
        The file descriptor.

    Raises:
        SerialPortError: The device does not exist or cannot be used.
    """
    try:
        termios, tty = importlib.import_module("termios"), importlib.import_module("tty")
    except ImportError:  # Windows
        raise SerialPortError("serial ports are supported on POSIX systems only") from None
    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise SerialPortError(
            UserMessage(
                "{device} does not support {baud} baud: try 115200", device=device, baud=baud
            )
        )
    try:
        line = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise SerialPortError(
            UserMessage("{device} cannot be opened: {reason}", device=device, reason=error.strerror)
        ) from None
    try:
        tty.setraw(line)
        attributes = termios.tcgetattr(line)
        attributes[2] |= termios.CLOCAL | termios.CREAD
        attributes[4] = attributes[5] = speed
        termios.tcsetattr(line, termios.TCSANOW, attributes)
    except termios.error as error:
        os.close(line)
        raise SerialPortError(
            UserMessage(
                "{device} is not a serial device: {reason}", device=device, reason=error.args[-1]
            )
        ) from None
    return line
