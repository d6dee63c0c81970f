"""RFCOMM links (Bluetooth serial port profile, A-2-3), if the system has Bluetooth sockets."""

import socket

from scaraspec.transports.link import LinkError
from scaraspec.transports.tcp import SocketLink
from scaraspec.transports.url import Rfcomm
from scaraspec.user_message import UserMessage


def rfcomm_socket() -> socket.socket:
    """Return a new RFCOMM socket.

    Raises:
        OSError: The system has no Bluetooth sockets; the message states the alternative.
    """
    try:
        return socket.socket(socket.AF_BLUETOOTH, socket.SOCK_STREAM, socket.BTPROTO_RFCOMM)
    except (AttributeError, OSError):
        raise OSError(
            "this system has no Bluetooth sockets; bind the device to a serial port "
            "(rfcomm bind) and use serial:///dev/rfcomm0"
        ) from None


def open_channel(address: Rfcomm, timeout_s: float | None = None) -> socket.socket:
    """Return a socket that is connected to a channel of a paired device.

    Args:
        address: The device and its channel.
        timeout_s: Timeout of the connection and of the socket, in seconds; None for the timeout
            of the system.

    Raises:
        OSError: The system has no Bluetooth sockets, or the device does not respond.
    """
    connected = rfcomm_socket()
    try:
        connected.settimeout(timeout_s)
        connected.connect(tuple(address))
    except OSError:
        connected.close()
        raise
    return connected


def connect_rfcomm(address: Rfcomm, timeout_s: float) -> SocketLink:
    """Connect to a channel of a paired device.

    Raises:
        LinkError: The system has no Bluetooth sockets, or the device does not respond.
    """
    try:
        return SocketLink(open_channel(address, timeout_s))
    except TimeoutError:
        reason: str = UserMessage("no response within {timeout_s:g} s", timeout_s=timeout_s)
    except OSError as error:
        reason = error.strerror or f"{error}"
    raise LinkError(
        UserMessage("cannot connect to {address}: {reason}", address=address, reason=reason)
    )
