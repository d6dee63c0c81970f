"""Link URLs: parsing, with one clear error message for an invalid URL.

This module opens no link.
"""

import ipaddress
import re
from typing import NamedTuple
from urllib.parse import parse_qsl, unquote, urlsplit

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.transports.link import LinkError
from scaraspec.user_message import UserMessage

DEFAULT_BAUD = 115200
DEFAULT_CHANNEL = 1

_EXAMPLES = (
    f"tcp://192.168.1.2:{DEFAULT_PORT}, serial:///dev/rfcomm0?baud={DEFAULT_BAUD} "
    "or rfcomm://AA:BB:CC:DD:EE:FF/1"
)
_MAX_PORT = 65535
_MAX_CHANNEL = 30  # RFCOMM has the channels 1 to 30
_MAC = re.compile(r"[0-9A-F]{2}(:[0-9A-F]{2}){5}", re.IGNORECASE)
_NUMBER = re.compile(r"[0-9]{1,7}")


class UrlError(LinkError):
    """A link URL is invalid."""


class Tcp(NamedTuple):
    """A TCP port of a host; an IPv6 address is stored without brackets."""

    host: str
    port: int = DEFAULT_PORT

    @property
    def needs_login(self) -> bool:
        """Whether a client must log in (L83)."""
        return True

    @property
    def detects_close(self) -> bool:
        """Whether a controller notices the end of a connection."""
        return True

    def __str__(self) -> str:
        return f"tcp://{join_host_port(*self)}"


class Serial(NamedTuple):
    """A serial device."""

    device: str
    baud: int = DEFAULT_BAUD

    @property
    def needs_login(self) -> bool:
        """See `Tcp.needs_login`."""
        return False

    @property
    def detects_close(self) -> bool:
        """See `Tcp.detects_close`."""
        return False

    def __str__(self) -> str:
        return f"serial://{self.device}?baud={self.baud}"


class Rfcomm(NamedTuple):
    """A channel of a Bluetooth device (A-2-3)."""

    address: str
    channel: int = DEFAULT_CHANNEL

    @property
    def needs_login(self) -> bool:
        """See `Tcp.needs_login`."""
        return False

    @property
    def detects_close(self) -> bool:
        """See `Tcp.detects_close`."""
        return True

    def __str__(self) -> str:
        return f"rfcomm://{self.address}/{self.channel}"


def parse(url: str) -> Tcp | Serial | Rfcomm:
    """Parse a link URL.

    Raises:
        UrlError: The URL is invalid; the message states the error and a valid example.
    """
    try:
        parts = urlsplit(url)
    except ValueError as error:
        raise UrlError(
            UserMessage(
                "{url!r} is not a link URL: {error}; write for example {examples}",
                url=url,
                error=error,
                examples=_EXAMPLES,
            )
        ) from None
    if url.isprintable() and not parts.username and not parts.fragment:
        if parts.scheme == "tcp" and parts.path in ("", "/") and not parts.query:
            return Tcp(*split_host_port(parts.netloc))
        if parts.scheme == "serial" and parts.netloc + parts.path:
            return Serial(unquote(parts.netloc + parts.path), _parse_baud(parts.query))
        if parts.scheme == "rfcomm" and _MAC.fullmatch(parts.netloc) and not parts.query:
            channel = parts.path.strip("/") or str(DEFAULT_CHANNEL)
            number = _parse_number("RFCOMM channel", channel, 1, _MAX_CHANNEL)
            return Rfcomm(parts.netloc.upper(), number)
    raise UrlError(
        UserMessage(
            "{url!r} is not a link URL: write for example {examples}", url=url, examples=_EXAMPLES
        )
    )


def split_host_port(text: str, lowest_port: int = 1) -> tuple[str, int]:
    """Split ``host``, ``host:port`` or ``[IPv6]:port``; the default port is 8877.

    Raises:
        UrlError: The host is missing, an IPv6 address has no brackets, or the port is invalid.
    """
    if text.startswith("["):
        host, _, rest = text[1:].partition("]")
        try:
            ipaddress.IPv6Address(host)
        except ValueError:
            raise UrlError(UserMessage("{host!r} is not an IPv6 address", host=host)) from None
        colon, port = rest[:1], rest[1:]
    else:
        host, colon, port = text.partition(":")
        if ":" in port:
            raise UrlError(
                UserMessage(
                    "{text!r} is ambiguous: write an IPv6 address as [{text}]:{default_port}",
                    text=text,
                    default_port=DEFAULT_PORT,
                )
            )
    if not host or colon not in ("", ":") or not host.isprintable() or " " in host:
        raise UrlError(
            UserMessage(
                "{text!r} has no valid host: write host:port or [IPv6 address]:port", text=text
            )
        )
    if not colon:
        return host, DEFAULT_PORT
    return host, _parse_number("port", port, lowest_port, _MAX_PORT)


def join_host_port(host: str, port: int) -> str:
    """Join host and port in the form that `split_host_port` parses."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _parse_baud(query: str) -> int:
    settings = parse_qsl(query, keep_blank_values=True)
    if not query:
        return DEFAULT_BAUD
    if [key for key, _ in settings] != ["baud"]:
        raise UrlError(
            UserMessage(
                "{query!r} is not a valid setting of a serial link: write ?baud={default_baud}",
                query=query,
                default_baud=DEFAULT_BAUD,
            )
        )
    return _parse_number("baud rate", settings[0][1], 1, 4_000_000)


def _parse_number(name: str, text: str, lowest: int, highest: int) -> int:
    if not _NUMBER.fullmatch(text) or not lowest <= int(text) <= highest:
        raise UrlError(
            UserMessage(
                "{text!r} is not a valid {name}: it must be a number from {lowest} to {highest}",
                text=text,
                name=name,
                lowest=lowest,
                highest=highest,
            )
        )
    return int(text)
