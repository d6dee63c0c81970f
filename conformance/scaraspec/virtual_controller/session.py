"""Sessions: the state of one client's connection, its requests, and the actions of the core.

This module contains only data; `core` and `behaviour` change it.
"""

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.transfer import Receiver, Sender
from scaraspec.virtual_controller.request_framer import RequestFramer

Carrier = Literal["tcp", "serial"]
"""The kind of link of a connection: the network, or a serial line such as Bluetooth (L77-83)."""


class Send(NamedTuple):
    """Send these bytes on a connection."""

    connection: int
    data: bytes


class Close(NamedTuple):
    """Close a connection after all bytes are sent; `data` is always None."""

    connection: int
    data: None = None


Action = Send | Close
"""What the server must do for the core."""


class OpenTransfer(NamedTuple):
    """A file transfer in progress: an upload has a receiver, a download a sender."""

    name: bytes
    end: Receiver | Sender


@dataclass(eq=False, slots=True)
class Session:
    """One client, from its connection to its end.

    Attributes:
        connection: The connection number that the server assigned.
        carrier: The kind of link.
        framer: Finds the frames in the bytes of the client.
        logged_in: Whether the client may use every command (A-4.1-1).
        transfer: The file transfer in progress, at most one (A-5-17).
        remaining_list_parts: Parts of the program list that are not requested yet (A-4.10-3).
    """

    connection: int
    carrier: Carrier
    framer: RequestFramer
    logged_in: bool
    transfer: OpenTransfer | None = None
    remaining_list_parts: list[NameListPart] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Request:
    """A decoded frame of a client.

    Attributes:
        session: The session that sent it.
        command: The row of the command table.
        frame: The frame.
        value: The decoded value; None if there is none, or if the controller must not act on it.
        now_s: When it arrived, in seconds.
    """

    session: Session
    command: Command
    frame: Frame
    value: Any
    now_s: float
