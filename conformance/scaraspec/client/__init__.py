"""The reference client: `Client` (blocking), `AsyncClient` (asyncio) and their exceptions.

Belongs here: everything that a client program needs to command one controller. `core` is the
client without I/O and without a clock; `pending_operation`, `transfer` and `replies` are its
parts. `operations` has one method for each command; `blocking` and `aio` perform them.

Does not belong here: what the suite uses to test a controller. The suite does not import this
package, so that a common mistake cannot hide in both.
"""

from scaraspec.client.aio import AsyncClient, AsyncPending
from scaraspec.client.blocking import Client, Pending
from scaraspec.client.core import ClientCore
from scaraspec.client.errors import (
    ClientError,
    Failed,
    Interrupted,
    LinkLost,
    LoginFailed,
    ProtocolError,
    Refused,
    ReplyTimeout,
    TransferFailed,
)
from scaraspec.client.results import RunningProgram, State, Status

__all__ = [
    "AsyncClient",
    "AsyncPending",
    "Client",
    "ClientCore",
    "ClientError",
    "Failed",
    "Interrupted",
    "LinkLost",
    "LoginFailed",
    "Pending",
    "ProtocolError",
    "Refused",
    "ReplyTimeout",
    "RunningProgram",
    "State",
    "Status",
    "TransferFailed",
]
