"""Serial links over a device such as ``/dev/rfcomm0``, a USB adapter, or a pty."""

import importlib
import time
from collections.abc import Sequence
from typing import Any

from scaraspec.transports.clock import now_ns
from scaraspec.transports.link import Arrival, Ending, LinkError
from scaraspec.transports.tcp import SEND_TIMEOUT_S
from scaraspec.transports.url import Serial
from scaraspec.user_message import UserMessage


def load_pyserial() -> Any:
    """Return the module of pyserial, an optional extra.

    Raises:
        OSError: pyserial is not installed; the message states how to install it.
    """
    try:
        return importlib.import_module("serial")
    except ImportError:
        raise OSError("serial lines need pyserial: pip install 'scaraspec[serial]'") from None


def open_port(
    address: Serial, *, read_timeout_s: float | None = None, write_timeout_s: float | None = None
) -> Any:
    """Open a serial device (8N1) for this process alone.

    Args:
        address: The device and its baud rate.
        read_timeout_s: Timeout of a read call, in seconds; None for no timeout.
        write_timeout_s: Timeout of a write call, in seconds; None for no timeout.

    Returns:
        The port, a ``serial.Serial`` of pyserial.

    Raises:
        OSError: pyserial is not installed, the device cannot be opened, or the system does not
            support the baud rate.
    """
    pyserial = load_pyserial()
    try:
        return pyserial.Serial(
            address.device,
            address.baud,
            timeout=read_timeout_s,
            write_timeout=write_timeout_s,
            exclusive=True,
        )
    except ValueError as error:  # a baud rate that the system does not support
        raise OSError(f"{error}") from None


class SerialLink:
    """A link over a serial device; the link opens the device and owns it.

    Raises:
        LinkError: pyserial is not installed, or the device cannot be opened.
    """

    step_s = 1.0

    def __init__(self, address: Serial) -> None:
        try:
            self._port = open_port(address, write_timeout_s=SEND_TIMEOUT_S)
        except OSError as error:
            raise LinkError(
                UserMessage("cannot open {address}: {error}", address=address, error=error)
            ) from None
        self._ending: Ending | None = None

    @property
    def now_s(self) -> float:
        """The current time of the system's monotonic clock."""
        return time.monotonic()

    def send(self, data: bytes) -> int:
        """Send all of `data`; see `Link.send`."""
        self._check_open()
        time_ns = now_ns()
        try:
            self._port.write(data)
        except OSError as error:
            raise LinkError(
                UserMessage("cannot write to the serial line: {error}", error=error)
            ) from None
        return time_ns

    def receive(self, deadline_s: float, _others: Sequence[object] = (), /) -> Arrival | None:
        """Wait for bytes, or until the device fails; see `Link.receive`.

        Other links are ignored: a serial line has one link.
        """
        self._check_open()
        if self._ending is None:
            try:
                self._port.timeout = max(0.0, deadline_s - self.now_s)
                data = bytes(self._port.read(1))
                data += self._port.read(self._port.in_waiting)
            except OSError:
                self._ending = Ending.CLOSED
            else:
                return Arrival(now_ns(), data) if data else None
        return Arrival(now_ns(), self._ending)

    def half_close(self) -> None:
        """Raise `LinkError`: a serial line has no half-close."""
        raise LinkError("a serial line cannot be half closed")

    def close(self) -> None:
        """Close the device."""
        self._port.close()

    def reset(self) -> None:
        """Close the device; a serial line has no reset."""
        self.close()

    def _check_open(self) -> None:
        if not self._port.is_open:
            raise LinkError("this link has been closed")
