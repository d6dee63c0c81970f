"""The driver: the reference client controlled by JSON Lines on stdio, to certify this client.

One object per line. Input: ``{"id": 1, "do": "get_status"}``. Output: ``{"id": 1, "ok": true,
"result": "00"}``, ``{"id": 1, "ok": false, "error": "..."}`` or ``{"id": 1, "unimplemented":
true}``, in the order in which the operations end. `text_interface` defines the names and values;
the command table defines the operations.
"""

import asyncio
import json
import sys
from collections.abc import Awaitable, Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.errors import ClientError, Failed, Refused
from scaraspec.client.operations import parse_direction
from scaraspec.client.results import Status
from scaraspec.client.text_interface import OPERATIONS, TRANSFERS, to_json
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.transports.link import LinkError
from scaraspec.transports.url import join_host_port
from scaraspec.user_message import UserMessage

MakeClient = Callable[[str, str | None], AsyncClient]
"""Creates a client for a URL and a password."""

_LINE_BYTES: Final = 2**20


class Driver:
    """Executes the commands of the driver protocol concurrently.

    Args:
        write: Called with each answer.
        make: Creates the clients.
    """

    def __init__(self, write: Callable[[Mapping[str, Any]], None], make: MakeClient) -> None:
        self._write, self._make = write, make
        self._client: AsyncClient | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    def take(self, line: str) -> None:
        """Start the command of one line as a task."""
        try:
            request = json.loads(line)
            number, name = request["id"], request["do"]
        except (ValueError, KeyError, TypeError):
            error = UserMessage("not a line of the driver protocol: {line!r}", line=line[:80])
            self._write({"id": None, "ok": False, "error": error})
            return
        values = {key: value for key, value in request.items() if key not in ("id", "do")}
        task = asyncio.get_running_loop().create_task(self._do(number, name, values))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def end(self) -> None:
        """Close the link, and wait until the pending commands have failed."""
        if self._client:
            await self._client.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _do(self, number: Any, name: str, values: dict[str, Any]) -> None:
        own: dict[str, Callable[..., Awaitable[None]]] = {
            "connect": self._connect,
            "disconnect": self._disconnect,
        }
        if name not in own and name not in OPERATIONS:
            self._write({"id": number, "unimplemented": True})
            return
        try:
            result = await (own[name](**values) if name in own else self._operate(name, values))
        except (ClientError, LinkError, PayloadError, OSError, TypeError, ValueError) as error:
            self._write({"id": number, "ok": False, "error": str(error) or type(error).__name__})
        else:
            self._write({"id": number, "ok": True, "result": result})

    async def _connect(
        self, host: str, port: int = DEFAULT_PORT, password: str | None = None
    ) -> None:
        await self._disconnect()
        self._client = self._make(f"tcp://{join_host_port(host, port)}", password)
        await self._client.connect()

    async def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client:
            await client.close()

    async def _operate(self, name: str, values: dict[str, Any]) -> Any:
        client = self._client
        if client is None:
            raise ClientError("there is no connection: send connect first")
        operate = getattr(client, name)
        command = BY_NAME.get(name)
        if command is None or not (command.two_stage or name == "shutdown"):
            return _driver_result(name, await operate(*_arguments(name, values)))
        try:
            await operate(*_arguments(name, values))
        except Refused as refused:
            return {"accepted": False, "code": refused.code and refused.code.text}
        except Failed as failed:
            return {"accepted": True, "outcome": "00", "code": failed.code and failed.code.text}
        return {"accepted": True, "outcome": "11"} if command.two_stage else {"accepted": True}


def _arguments(name: str, values: Mapping[str, Any]) -> list[Any]:
    """Return the arguments of an operation, in its order.

    Raises:
        PayloadError: An argument is missing, unknown or not valid.
    """
    names = [parameter.strip("[]") for parameter in OPERATIONS[name]]
    if unknown := values.keys() - set(names):
        raise PayloadError(
            UserMessage("{command} has no argument {argument}", command=name, argument=min(unknown))
        )
    if missing := [parameter for parameter in names if parameter not in values]:
        raise PayloadError(
            UserMessage(
                "{command} needs the argument {argument}", command=name, argument=missing[0]
            )
        )
    if name in TRANSFERS:
        return [values[parameter] for parameter in names]
    if names == ["direction"]:
        return [parse_direction(values["direction"])]
    return [values[field.name] for field in BY_NAME[name].request.fields]


def _driver_result(name: str, result: Any) -> Any:
    """Convert a result to the driver protocol: times and codes as on the wire."""
    if isinstance(result, datetime):
        return f"{result:%Y%m%d%H%M%S}"
    if isinstance(result, Status):
        return result.code
    if name in TRANSFERS or isinstance(result, Path):
        return None
    return to_json(result)


async def serve(make: MakeClient) -> None:
    """Execute the lines of stdin until it ends."""
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader(limit=_LINE_BYTES)
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)

    def write(answer: Mapping[str, Any]) -> None:
        sys.stdout.write(json.dumps(answer, ensure_ascii=True) + "\n")
        sys.stdout.flush()

    driver = Driver(write, make)
    try:
        while line := await reader.readline():
            driver.take(line.decode("utf-8", "replace"))
    except (ValueError, BrokenPipeError):
        pass  # a line is too long, or stdout is closed
    finally:
        await driver.end()
