"""RFCOMM links (Bluetooth serial port profile, A-2-3), if the system has Bluetooth sockets."""

import socket

from scaraspec.transports.link import LinkError
from scaraspec.transports.tcp import SocketLink
from scaraspec.transports.url import Rfcomm
from scaraspec.user_message import UserMessage


def connect_rfcomm(address: Rfcomm, timeout_s: float) -> SocketLink:
    """Connect to a channel of a paired device.

    Raises:
        LinkError: The system has no Bluetooth sockets, or the device does not respond.
    """
    try:
        family, protocol = socket.AF_BLUETOOTH, socket.BTPROTO_RFCOMM
        connected = socket.socket(family, socket.SOCK_STREAM, protocol)
    except (AttributeError, OSError):
        raise LinkError(
            UserMessage(
                "cannot connect to {address}: this system has no Bluetooth sockets; bind "
                "the device to a serial port (rfcomm bind) and use serial:///dev/rfcomm0",
                address=address,
            )
        ) from None
    try:
        connected.settimeout(timeout_s)
        connected.connect(tuple(address))
    except OSError as error:
        connected.close()
        reason = error.strerror or f"no response within {timeout_s:g} s"
        raise LinkError(
            UserMessage("cannot connect to {address}: {reason}", address=address, reason=reason)
        ) from None
    return SocketLink(connected)
