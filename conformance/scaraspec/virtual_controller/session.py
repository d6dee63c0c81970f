"""Sessions: what the controller knows of one client, and what goes out to it.

State only; who changes it, and when, is decided elsewhere.
"""

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.transfer import Receiver, Sender
from scaraspec.virtual_controller.request_framer import RequestFramer

Carrier = Literal["tcp", "serial"]
"""What a connection runs over: the network, or a serial line such as Bluetooth's (L77-83)."""


class Send(NamedTuple):
    """Send these bytes on a connection."""

    connection: int
    data: bytes


class Close(NamedTuple):
    """Close a connection once what was sent on it is out; `data` is always None."""

    connection: int
    data: None = None


Action = Send | Close
"""What the shell is to do for the core."""


class OpenTransfer(NamedTuple):
    """A file on its way: in at a receiver, or out of a sender."""

    name: bytes
    end: Receiver | Sender


@dataclass(eq=False, slots=True)
class Session:
    """One client, from its connection to its end.

    Attributes:
        connection: The number that the shell gave the connection.
        carrier: What it runs over.
        inlet: Where its bytes become frames.
        logged_in: Whether it may use every command (A-4.1-1).
        transfer: Its file transfer, if one is under way: one at a time (A-5-17).
        list_rest: Parts of the program list that it has yet to ask for (A-4.10-3).
    """

    connection: int
    carrier: Carrier
    framer: RequestFramer
    logged_in: bool
    transfer: OpenTransfer | None = None
    remaining_list_parts: list[NameListPart] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Request:
    """A frame of a client, read.

    Attributes:
        session: Whose it is.
        command: Its row of the table.
        frame: The frame.
        value: What it says; None where that is nothing, or nothing a controller may act upon.
        now_s: When it came.
    """

    session: Session
    command: Command
    frame: Frame
    value: Any
    now_s: float
