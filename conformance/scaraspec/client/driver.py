"""Driver: the reference client behind JSON Lines on stdio, for a tester that plays the controller.

One object a line each way: ``{"id": 1, "do": "get_status"}`` in, ``{"id": 1, "ok": true, "result":
"00"}``, ``{"id": 1, "ok": false, "error": "..."}`` or ``{"id": 1, "unimplemented": true}`` out, in
the order in which operations end. What the words mean is in `words`; which operations there are,
in the command table.
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
"""A client for a URL and a password."""

_LINE_BYTES: Final = 2**20


class Driver:
    """Does what the lines say, several things at once.

    Args:
        write: Takes each answer.
        make: Makes the clients.
    """

    def __init__(self, write: Callable[[Mapping[str, Any]], None], make: MakeClient) -> None:
        self._write, self._make = write, make
        self._client: AsyncClient | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    def take(self, line: str) -> None:
        """Begin what a line says; it goes on by itself."""
        try:
            order = json.loads(line)
            number, name = order["id"], order["do"]
        except (ValueError, KeyError, TypeError):
            told = UserMessage("no line of the driver protocol: {line!r}", line=line[:80])
            self._write({"id": None, "ok": False, "error": told})
            return
        values = {key: value for key, value in order.items() if key not in ("id", "do")}
        task = asyncio.get_running_loop().create_task(self._do(number, name, values))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def end(self) -> None:
        """Close the link, and give up what is under way."""
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
            raise ClientError("there is no connection: connect comes first")
        operate = getattr(client, name)
        command = BY_NAME.get(name)
        if command is None or not (command.two_stage or name == "shutdown"):
            return _told(name, await operate(*_arguments(name, values)))
        try:
            await operate(*_arguments(name, values))
        except Refused as refused:
            return {"accepted": False, "code": refused.code and refused.code.text}
        except Failed as failed:
            return {"accepted": True, "outcome": "00", "code": failed.code and failed.code.text}
        return {"accepted": True, "outcome": "11"} if command.two_stage else {"accepted": True}


def _arguments(name: str, values: Mapping[str, Any]) -> list[Any]:
    """The arguments of an operation, in its order.

    Raises:
        PayloadError: One is missing, unknown or unreadable.
    """
    takes = [parameter.strip("[]") for parameter in OPERATIONS[name]]
    if unknown := values.keys() - set(takes):
        raise PayloadError(
            UserMessage("{name} takes no {unknown}", name=name, unknown=min(unknown))
        )
    if missing := [parameter for parameter in takes if parameter not in values]:
        raise PayloadError(UserMessage("{name} wants {missing} too", name=name, missing=missing[0]))
    if name in TRANSFERS:
        return [values[parameter] for parameter in takes]
    if takes == ["direction"]:
        return [parse_direction(values["direction"])]
    return [values[field.name] for field in BY_NAME[name].request.fields]


def _told(name: str, result: Any) -> Any:
    """A result in the words of the driver protocol: times and codes as they are on the wire."""
    if isinstance(result, datetime):
        return f"{result:%Y%m%d%H%M%S}"
    if isinstance(result, Status):
        return result.code
    if name in TRANSFERS or isinstance(result, Path):
        return None
    return to_json(result)


async def serve(make: MakeClient) -> None:
    """Serve stdin until it ends."""
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
        pass  # a line without end, or nobody reads any more
    finally:
        await driver.end()
