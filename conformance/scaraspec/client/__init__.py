"""The reference client: `Client` and `AsyncClient`, and what can keep them from their task.

`core` is the client without a link and a clock; `operation`, `transfer` and `replies` are its
parts. `operations` has one method for each row of the table; `blocking` and `aio` carry them out.
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
