"""From a URL to an open link: the one place that knows every carrier."""

from scaraspec.links.link import Link
from scaraspec.links.rfcomm import connect_rfcomm
from scaraspec.links.serial import SerialLink
from scaraspec.links.tcp import connect_tcp
from scaraspec.links.url import Rfcomm, Tcp, parse

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
