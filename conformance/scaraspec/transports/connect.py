"""Open the link that a URL names; the only module that knows all kinds of links."""

import os
import socket

from scaraspec.transports.link import Link, LinkError
from scaraspec.transports.rfcomm import connect_rfcomm
from scaraspec.transports.serial import SerialLink
from scaraspec.transports.tcp import connect_tcp
from scaraspec.transports.url import Rfcomm, Serial, Tcp, parse
from scaraspec.user_message import UserMessage

CONNECT_TIMEOUT_S = 5.0


def connect(url: str, timeout_s: float = CONNECT_TIMEOUT_S) -> Link:
    """Open the link that a URL names.

    Args:
        url: The link URL, for example ``tcp://192.168.1.2``.
        timeout_s: Timeout for the connection, in seconds; not used for serial links.

    Raises:
        LinkError: The URL is invalid (`UrlError`), or the link cannot be opened.
    """
    match parse(url):
        case Tcp() as address:
            return connect_tcp(address, timeout_s)
        case Rfcomm() as address:
            return connect_rfcomm(address, timeout_s)
        case address:
            return SerialLink(address)


def resolve_url(url: str) -> str:
    """Return a URL with its address resolved: two names of one controller give the same text.

    Raises:
        LinkError: The URL is invalid, or the host is unknown.
    """
    match parse(url):
        case Tcp(host, port):
            try:
                found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
            except OSError as error:
                raise LinkError(
                    UserMessage(
                        "the host {host} is unknown: {reason}",
                        host=host,
                        reason=error.strerror,
                    )
                ) from None
            addresses = sorted(found, key=lambda each: each[0] is not socket.AF_INET)
            return f"{Tcp(str(addresses[0][4][0]), port)}"  # its IPv4 address, if it has one
        case Serial(device):
            return f"serial://{os.path.realpath(device)}"
        case Rfcomm() as address:
            return f"{address}"
