"""A relay in front of the controller that keeps the bytes of each connection: the second witness.

It has nothing in common with the recorder, except for the library of the event loop.
"""

import asyncio
import threading
from contextlib import suppress
from typing import Self

from scaraspec.protocol.direction import A2C, C2A, Direction

Bytes = dict[Direction, bytearray]


class FarEnd:
    """Relays to a controller in a thread of its own.

    Attributes:
        address: Where it listens.
        connections: The bytes of each connection that a controller received and sent.
    """

    def __init__(self, controller: tuple[str, int]) -> None:
        self.address = ("", 0)
        self.connections: list[Bytes] = []
        self._controller = controller
        self._started = threading.Event()
        self._tasks = set[object]()  # the event loop alone would not keep them
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self._started.wait()
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._relay, "127.0.0.1")
        self.address = server.sockets[0].getsockname()
        self._started.set()
        await self._stop.wait()
        server.close()

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        data: Bytes = {A2C: bytearray(), C2A: bytearray()}
        self.connections.append(data)
        self._tasks.add(asyncio.current_task())
        replies, requests = await asyncio.open_connection(*self._controller)
        pumps = (_pump(reader, requests, data[A2C]), _pump(replies, writer, data[C2A]))
        with suppress(asyncio.CancelledError):  # the end of the test
            await asyncio.gather(*pumps)
        for each in (writer, requests):
            each.close()


async def _pump(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, data: bytearray
) -> None:
    try:
        while piece := await reader.read(1 << 16):
            data += piece
            writer.write(piece)
            await writer.drain()
        writer.write_eof()
    except OSError:  # the recorder was killed
        writer.close()
