"""uvloop_forward PORT TARGET: a bare forwarder with uvloop protocols, the limit for the recorder.

It writes what it reads and does nothing else: it records nothing and knows no back-pressure. Ends
when its standard input closes.
"""

import asyncio
import sys
from typing import cast

import uvloop


class End(asyncio.Protocol):
    """One socket; its received bytes are written to the other one."""

    def __init__(self, target: int | None) -> None:
        self.target = target
        self.transport: asyncio.Transport | None = None
        self.peer: End | None = None
        self.early: list[bytes] = []

    def connection_made(self, transport: asyncio.BaseTransport) -> None:  # noqa: D102 - asyncio's
        self.transport = cast(
            "asyncio.Transport", transport
        )  # uvloop's class does not inherit from it
        if self.target is not None:
            self.dialling = asyncio.get_running_loop().create_task(self.dial(self.target))

    def data_received(self, data: bytes) -> None:  # noqa: D102 - asyncio's
        if self.peer and self.peer.transport:
            self.peer.transport.write(data)
        else:
            self.early.append(data)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002, D102 - asyncio's
        if self.peer and self.peer.transport:
            self.peer.transport.close()

    async def dial(self, port: int) -> None:
        """Connect the other socket."""
        upstream = End(None)
        upstream.peer = self
        loop = asyncio.get_running_loop()
        await loop.create_connection(lambda: upstream, "127.0.0.1", port)
        self.peer = upstream
        for data in self.early:
            self.data_received(data)


async def main(port: int, target: int) -> None:
    """Forward until standard input closes."""
    loop = asyncio.get_running_loop()
    await loop.create_server(lambda: End(target), "127.0.0.1", port)
    closed = asyncio.Event()
    loop.add_reader(sys.stdin, closed.set)
    await closed.wait()


if __name__ == "__main__":
    uvloop.run(main(int(sys.argv[1]), int(sys.argv[2])))
