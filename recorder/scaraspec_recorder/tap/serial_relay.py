"""Relays: a serial line (a port, or a Bluetooth RFCOMM channel) as one side of the tap, or both.

Lives here: devices, and threads that carry a device's bytes to and from a loopback socket. All else
is the tap's: it forwards and records that socket like any other. Threads, for no event loop reads a
serial port on every system; at its speed they cost nothing.

A serial line knows neither half-close nor reset: it only hangs up. Its hang-up reaches the other
side as a reset. A client that has finished keeps the line, since answers may still come, until the
next client asks for it.
"""

import asyncio
import importlib
import logging
import select
import socket
import struct
import threading
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from scaraspec_recorder.child_process import ChildProcess, ignore_signals
from scaraspec_recorder.tap import tcp

LINE_WAIT_S: Final = 1.0
"""How long a client waits for one before it, which may be about to go, to leave the line."""

RETRY_S: Final = 1.0
"""How long the client's line rests after a hang-up before it is opened again."""

_POLL_S: Final = 0.1
_READ_BYTES: Final = 64 << 10
_STOP_S: Final = 3.0
_FLUSH_POLL_S: Final = 0.005
_LINGER_NOT: Final = struct.pack("ii", 1, 0)  # close() then sends RST

_log = logging.getLogger(__name__)


class Device(Protocol):
    """An open serial line. One thread reads while another writes."""

    def read(self) -> bytes:
        """Return what comes next; nothing after a while, or once it is cancelled.

        Raises:
            OSError: The line has hung up.
        """

    def write(self, data: bytes) -> None:
        """Write all of it.

        Raises:
            OSError: The line has hung up.
        """

    def cancel(self) -> None:
        """Let reads and writes that wait return."""

    def close(self) -> None:
        """Hang up, once no thread reads or writes any more."""


class SerialEndpoint(Protocol):
    """Where a serial line is. Picklable, and as text the URL of the link."""

    def check(self) -> None:
        """Find out whether this system has such lines at all.

        Raises:
            OSError: It has not; the text says what to do.
        """

    def open(self) -> Device:
        """Open it.

        Raises:
            OSError: It is not there, or in use.
        """


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port: a device such as ``/dev/ttyUSB0``, ``/dev/rfcomm0`` or ``COM3``; 8N1."""

    device: str
    baud: int

    def check(self) -> None:
        """See `SerialEndpoint.check`."""
        _pyserial()

    def open(self) -> Device:
        """Open it for this process alone; see `SerialEndpoint.open`."""
        try:
            port = _pyserial().Serial(self.device, self.baud, timeout=_POLL_S, exclusive=True)
        except ValueError as error:  # a speed that the system does not know
            raise OSError(f"cannot open {self}: {error}") from None
        return _Port(port)

    def __str__(self) -> str:
        return f"serial://{self.device}?baud={self.baud}"


@dataclass(frozen=True, slots=True)
class RfcommChannel:
    """An RFCOMM channel of a paired Bluetooth device."""

    address: str
    channel: int

    def check(self) -> None:
        """See `SerialEndpoint.check`."""
        self._socket().close()

    def open(self) -> Device:
        """Connect to it; see `SerialEndpoint.open`."""
        sock = self._socket()
        try:
            sock.connect((self.address, self.channel))
        except OSError:
            sock.close()
            raise
        return _Channel(sock)

    def __str__(self) -> str:
        return f"rfcomm://{self.address}/{self.channel}"

    def _socket(self) -> socket.socket:
        try:
            return socket.socket(socket.AF_BLUETOOTH, socket.SOCK_STREAM, socket.BTPROTO_RFCOMM)
        except (AttributeError, OSError):
            raise OSError(
                "this system offers no Bluetooth sockets: bind the device to a serial port "
                "(rfcomm bind) and use serial:///dev/rfcomm0"
            ) from None


class SerialBridge:
    """Carries bytes between a device and a socket, both of which it owns, until either ends.

    Args:
        name: What the line is called in the log.
        device: The line.
        sock: Connected to the tap.

    Attributes:
        finished: Nothing more will be written to the device: the tap has finished, or it is over.
    """

    def __init__(self, name: str, device: Device, sock: socket.socket) -> None:
        tcp.tune(sock)
        self._name = name
        self.finished = threading.Event()
        self._device = device
        self._sock = sock
        self._stopped = False
        self._close_requested = False
        self._closing = threading.Lock()
        self._closed = False
        # At the end of the process, what the tap has forwarded is still written to the device.
        self._to_device_thread = threading.Thread(target=self._copy_to_device)
        self._to_socket_thread = threading.Thread(target=self._copy_to_socket, daemon=True)
        self._to_device_thread.start()
        self._to_socket_thread.start()

    def close(self) -> None:
        """End in order, if it has not ended; returns when device and socket are closed."""
        if not self._stopped:
            self._close_requested = True
            with suppress(OSError):  # the tap may have reset it
                self._sock.shutdown(socket.SHUT_RDWR)
        self._end()
        self._to_socket_thread.join()

    def _end(self) -> None:
        self._stopped = True
        with self._closing:
            if not self._closed:
                self._device.cancel()

    def _read(self) -> bytes:
        try:
            return self._device.read()
        except OSError as error:
            if not self._stopped:
                _log.warning("%s has hung up: %s", self._name, error)
            raise

    def _copy_to_device(self) -> None:
        """From the tap to the device."""
        try:
            while not self._stopped:
                if select.select([self._sock], [], [], _POLL_S)[0]:
                    data = self._sock.recv(_READ_BYTES)
                    if not data:
                        break
                    self._device.write(data)
        except OSError:  # the tap has reset the connection, or the device has hung up
            self._end()
        self.finished.set()

    def _copy_to_socket(self) -> None:
        """From the device to the tap; then close both."""
        try:
            while not self._stopped:
                self._sock.sendall(self._read())
        except OSError:  # as above
            pass
        self._end()
        if not self._close_requested:
            _reset_when_flushed(self._sock)
        self._to_device_thread.join()
        with self._closing:
            self._closed = True
            self._device.close()
        self._sock.close()


@dataclass(slots=True)
class SerialRoute:
    """The route to a controller on a serial line, which has one client at a time."""

    end: SerialEndpoint
    _line: SerialBridge | None = field(default=None, init=False)
    _turn: asyncio.Lock = field(default_factory=asyncio.Lock, init=False)

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen, where there are such lines at all; see `Route.listen`."""
        self.end.check()
        return tcp.listen(host, port)

    def target(self, client: socket.socket) -> str:  # noqa: ARG002 - all are led to one
        """Return the URL of the line."""
        return str(self.end)

    async def connect_upstream(self, client: socket.socket) -> socket.socket:  # noqa: ARG002 - see above
        """Open the line and return the near end of a connection that leads to it.

        Raises:
            OSError: The line cannot be opened, or a client before this one does not leave it.
        """
        async with self._turn:
            dialling = asyncio.create_task(asyncio.to_thread(self._dial))
            try:
                return await asyncio.shield(dialling)
            except asyncio.CancelledError:  # the client has gone meanwhile
                with suppress(OSError):
                    (await dialling).close()
                raise

    def _dial(self) -> socket.socket:
        if self._line:
            if not self._line.finished.wait(LINE_WAIT_S):
                raise OSError("another client has the line")
            self._line.close()
        device = self.end.open()
        try:
            near, far = _connected_pair()
        except OSError:
            device.close()
            raise
        self._line = SerialBridge(str(self.end), device, far)
        near.settimeout(0)
        return near


@asynccontextmanager
async def relay_serial_client(end: SerialEndpoint, address: tuple[str, int]) -> AsyncIterator[None]:
    """Let a client on a serial line take part in a recording, for as long as the context lasts.

    The line is opened whenever it is there, and connected to the tap as soon as it is open.

    Args:
        end: Where the client is.
        address: Where the tap listens, best on the loopback; see `recording.Recording.address`.

    Raises:
        OSError: There are no such lines on this system.
    """
    end.check()
    caller = ChildProcess("caller", run_serial_client, end, address)
    try:
        caller.start()
        yield
    finally:
        await caller.stop(_STOP_S)


def run_serial_client(end: SerialEndpoint, address: tuple[str, int], line: socket.socket) -> None:
    """Be the caller's process: carry a client's line to the tap until the recorder's is closed."""
    ignore_signals()
    told = ""
    while True:
        try:
            carried = _call(end, address)
        except OSError as error:
            if str(error) != told:  # it may be tried for weeks
                told = str(error)
                _log.warning("the client's line is not there: %s", error)
        else:
            told = ""
            while not (carried.finished.is_set() or _is_closed(line, _POLL_S)):
                pass
            carried.close()
        if _is_closed(line, RETRY_S):
            return


def _call(end: SerialEndpoint, address: tuple[str, int]) -> SerialBridge:
    device = end.open()
    try:
        return SerialBridge(str(end), device, socket.create_connection(address))
    except OSError:
        device.close()
        raise


def _is_closed(line: socket.socket, timeout_s: float) -> bool:
    """Whether the recorder closes this line within so long."""
    line.settimeout(timeout_s)
    try:
        return not line.recv(1)
    except TimeoutError:
        return False


class _Port:
    """A serial port, by pyserial."""

    def __init__(self, port: Any) -> None:
        self._port = port

    def read(self) -> bytes:
        first = bytes(self._port.read(1))
        return first + bytes(self._port.read(self._port.in_waiting))

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def cancel(self) -> None:
        self._port.cancel_read()
        self._port.cancel_write()

    def close(self) -> None:
        self._port.close()


class _Channel:
    """A Bluetooth socket."""

    def __init__(self, sock: socket.socket) -> None:
        self._sock = sock

    def read(self) -> bytes:
        data = self._sock.recv(_READ_BYTES)
        if not data:
            raise OSError("the device has hung up")
        return data

    def write(self, data: bytes) -> None:
        self._sock.sendall(data)

    def cancel(self) -> None:
        with suppress(OSError):  # it may have hung up already
            self._sock.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._sock.close()


def _pyserial() -> Any:
    try:
        return importlib.import_module("serial")  # an optional extra
    except ImportError:
        raise OSError("serial lines need pyserial: pip install 'scaraspec[serial]'") from None


def _connected_pair() -> tuple[socket.socket, socket.socket]:
    """Two TCP sockets that are connected to each other: a socket pair knows no reset."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        near = socket.create_connection(listener.getsockname())
        far, address = listener.accept()
    if address != near.getsockname():
        near.close()
        far.close()
        raise OSError("another process has connected to a port of the recorder")
    return near, far


def _reset_when_flushed(sock: socket.socket) -> None:
    """Let what is queued leave, for `tcp.RESET_FLUSH_S` at most; closing it then resets."""
    deadline_s = time.monotonic() + tcp.RESET_FLUSH_S
    with suppress(OSError):  # the tap was first
        while tcp.unsent_bytes(sock) and time.monotonic() < deadline_s:
            time.sleep(_FLUSH_POLL_S)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)
