"""Relays a serial line (serial port or Bluetooth RFCOMM channel) to the tap.

Belongs here: devices, and threads that copy bytes between a device and a loopback socket. The tap
forwards and records this socket like any other. Threads are used because event loops cannot read
serial ports on every system.

A serial line has no half-close and no reset; it can only hang up. The other side sees a hang-up as
a reset. A client that has finished keeps the line, because replies may follow, until the next
client connects.
"""

import asyncio
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

from scaraspec.transports.rfcomm import open_channel, rfcomm_socket
from scaraspec.transports.serial import load_pyserial, open_port
from scaraspec.transports.url import Rfcomm, Serial
from scaraspec.user_message import UserMessage
from scaraspec_recorder.child_process import ChildProcess, ignore_signals
from scaraspec_recorder.tap import tcp

LINE_WAIT_S: Final = 1.0
"""Time that a client waits for the previous client to release the line."""

RETRY_S: Final = 1.0
"""Delay before the client's line is opened again after a hang-up."""

_POLL_S: Final = 0.1
_READ_BYTES: Final = 64 << 10
_STOP_S: Final = 3.0
_FLUSH_POLL_S: Final = 0.005
_LINGER_NOT: Final = struct.pack("ii", 1, 0)  # close() then sends RST

_log = logging.getLogger(__name__)


class Device(Protocol):
    """An open serial line. One thread reads while another writes."""

    def read(self) -> bytes:
        """Return the next bytes; nothing after a timeout or a cancel.

        Raises:
            OSError: The line has hung up.
        """

    def write(self, data: bytes) -> None:
        """Write all of `data`.

        Raises:
            OSError: The line has hung up.
        """

    def cancel(self) -> None:
        """Make blocked reads and writes return."""

    def close(self) -> None:
        """Close the line. No thread may read or write."""


SerialAddress = Serial | Rfcomm
"""Address of a serial line; `str` returns its URL."""


def check_supported(address: SerialAddress) -> None:
    """Check that this system supports such lines.

    Raises:
        OSError: The system does not support them; the message states what to do.
    """
    if isinstance(address, Serial):
        load_pyserial()
    else:
        rfcomm_socket().close()


def open_device(address: SerialAddress) -> Device:
    """Open a serial line.

    Raises:
        OSError: The device does not exist, does not respond or is in use.
    """
    if isinstance(address, Serial):
        return _Port(open_port(address, read_timeout_s=_POLL_S))
    return _Channel(open_channel(address))


class SerialBridge:
    """Copies bytes between a device and a socket until one of them ends; closes both.

    Args:
        name: Name of the line in the log.
        device: The line.
        sock: Socket connected to the tap.

    Attributes:
        finished: Set when nothing more will be written to the device.
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
        # Not a daemon: at the end of the process, forwarded bytes are still written.
        self._to_device_thread = threading.Thread(target=self._copy_to_device)
        self._to_socket_thread = threading.Thread(target=self._copy_to_socket, daemon=True)
        self._to_device_thread.start()
        self._to_socket_thread.start()

    def close(self) -> None:
        """Close orderly. Returns when device and socket are closed."""
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
                _log.warning("%s hung up: %s", self._name, error)
            raise

    def _copy_to_device(self) -> None:
        """Copy from the tap to the device."""
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
        """Copy from the device to the tap, then close both."""
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
    """The route to a controller on a serial line. One client at a time."""

    address: SerialAddress
    _line: SerialBridge | None = field(default=None, init=False)
    _client: str = field(default="", init=False)  # address of the client that uses it
    _connect_lock: asyncio.Lock = field(default_factory=asyncio.Lock, init=False)

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen, if serial lines are supported; see `Route.listen`."""
        check_supported(self.address)
        return tcp.listen(host, port)

    def target(self, client: socket.socket) -> str:  # noqa: ARG002 - the same for all clients
        """Return the URL of the line."""
        return str(self.address)

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Open the line and return a socket that is connected to it.

        Raises:
            OSError: The line cannot be opened, or another client uses it.
        """
        async with self._connect_lock:
            address = "unknown"
            with suppress(OSError):  # the client is already disconnected
                address = tcp.address_text(client.getpeername())
            connecting = asyncio.create_task(asyncio.to_thread(self._connect, address))
            try:
                return await asyncio.shield(connecting)
            except asyncio.CancelledError:  # the client disconnected
                with suppress(OSError):
                    (await connecting).close()
                raise

    def _connect(self, client: str) -> socket.socket:
        if self._line:
            if not self._line.finished.wait(LINE_WAIT_S):
                raise OSError(UserMessage("the client {client} uses the line", client=self._client))
            self._line.close()
        device = open_device(self.address)
        try:
            near, far = _connected_pair()
        except OSError:
            device.close()
            raise
        self._line, self._client = SerialBridge(str(self.address), device, far), client
        near.settimeout(0)
        return near


@asynccontextmanager
async def relay_serial_client(
    client: SerialAddress, tap_address: tuple[str, int]
) -> AsyncIterator[None]:
    """Connect a client on a serial line to a tap while the context is active.

    A child process opens the line whenever it is available and connects it to the tap.

    Args:
        client: Address of the client's line.
        tap_address: Address that the tap listens on; see `recording.Recording.address`.

    Raises:
        OSError: This system does not support such lines.
    """
    check_supported(client)
    child = ChildProcess("client-line", run_serial_client, client, tap_address)
    try:
        child.start()
        yield
    finally:
        await child.stop(_STOP_S)


def run_serial_client(
    client: SerialAddress, tap_address: tuple[str, int], control_line: socket.socket
) -> None:
    """Relay the client's line until `control_line` is closed; the main function of a process."""
    ignore_signals()
    logged = ""
    while True:
        try:
            bridge = _connect_client(client, tap_address)
        except OSError as error:
            if str(error) != logged:  # retries may continue for weeks; log each error once
                logged = str(error)
                _log.warning("waiting for the client's line, which cannot be opened: %s", error)
        else:
            logged = ""
            while not (bridge.finished.is_set() or _is_closed(control_line, _POLL_S)):
                pass
            bridge.close()
        if _is_closed(control_line, RETRY_S):
            return


def _connect_client(client: SerialAddress, tap_address: tuple[str, int]) -> SerialBridge:
    device = open_device(client)
    try:
        return SerialBridge(str(client), device, socket.create_connection(tap_address))
    except OSError:
        device.close()
        raise


def _is_closed(control_line: socket.socket, timeout_s: float) -> bool:
    """Whether the recorder closes the control line within `timeout_s`."""
    control_line.settimeout(timeout_s)
    try:
        return not control_line.recv(1)
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
            raise OSError("the device hung up")
        return data

    def write(self, data: bytes) -> None:
        self._sock.sendall(data)

    def cancel(self) -> None:
        with suppress(OSError):  # it may have hung up already
            self._sock.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._sock.close()


def _connected_pair() -> tuple[socket.socket, socket.socket]:
    """Return two connected TCP sockets. A socket pair does not support reset."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        near = socket.create_connection(listener.getsockname())
        far, address = listener.accept()
    if address != near.getsockname():
        near.close()
        far.close()
        raise OSError("another process has connected to a port of the recorder")
    return near, far


def _reset_when_flushed(sock: socket.socket) -> None:
    """Wait until queued bytes are sent, `tcp.RESET_FLUSH_S` at most; closing then sends a reset."""
    deadline_s = time.monotonic() + tcp.RESET_FLUSH_S
    with suppress(OSError):  # the tap already reset it
        while tcp.unsent_bytes(sock) and time.monotonic() < deadline_s:
            time.sleep(_FLUSH_POLL_S)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)
