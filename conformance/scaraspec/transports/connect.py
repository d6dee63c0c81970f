"""From a URL to an open link: the one place that knows every carrier."""

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

    Raises:
        LinkError: The URL names none (`UrlError`), or it cannot be opened.
    """
    match parse(url):
        case Tcp() as address:
            return connect_tcp(address, timeout_s)
        case Rfcomm() as address:
            return connect_rfcomm(address, timeout_s)
        case address:
            return SerialLink(address)


def resolve_url(url: str) -> str:
    """A URL with its address resolved: two names of one controller give the same text.

    Raises:
        LinkError: The URL names no link, or its host is not known.
    """
    match parse(url):
        case Tcp(host, port):
            try:
                found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
            except OSError as error:
                raise LinkError(
                    UserMessage(
                        "the host {host} is not known: {strerror}",
                        host=host,
                        strerror=error.strerror,
                    )
                ) from None
            addresses = sorted(found, key=lambda each: each[0] is not socket.AF_INET)
            return f"{Tcp(str(addresses[0][4][0]), port)}"  # its IPv4 address, if it has one
        case Serial(device):
            return f"serial://{os.path.realpath(device)}"
        case Rfcomm() as address:
            return f"{address}"
