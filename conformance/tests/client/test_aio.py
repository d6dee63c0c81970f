"""The asyncio client, on an event loop with simulated time."""

import asyncio
import contextlib
import selectors
import socket
from collections.abc import Awaitable, Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from scaraspec.client import (
    AsyncClient,
    Interrupted,
    LinkLost,
    LoginFailed,
    Refused,
    ReplyTimeout,
    State,
    TransferFailed,
)
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.readings import DEFAULT
from scaraspec.protocol.transfer import FILE_DATA, chunks_of
from scaraspec.transports.url import UrlError
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.server import Server
from scaraspec.virtual_controller.store import Store

URL = "tcp://127.0.0.1"
PASSWORD = "password"


class _JumpingSelector(selectors.DefaultSelector):
    """If nothing is ready, the time jumps to the next timer."""

    now_s = 0.0

    def select(self, timeout: float | None = None) -> list[Any]:
        ready = super().select(0)
        if not ready:
            assert timeout is not None, "everybody waits, and no timer is set"
            self.now_s += max(0.0, timeout)
        return ready


class Loop(asyncio.SelectorEventLoop):
    """An event loop with simulated time; every connection leads to the controller's socket."""

    def __init__(self) -> None:
        self._jumping = _JumpingSelector()
        self.ours, self.theirs = socket.socketpair()
        super().__init__(self._jumping)

    def time(self) -> float:
        return self._jumping.now_s

    async def create_connection(self, factory: Any, *_address: Any, sock: Any = None) -> Any:
        return await super().create_connection(factory, sock=sock or self.ours)


class Controller:
    """The controller: it waits for requests and sends the replies of the test."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self.writer = writer
        self._framer = Framer(A2C)
        self._frames: list[Any] = []

    async def expect(self, *opcodes: int) -> bytes:
        """Wait for these requests; return the data of the last."""
        for opcode in opcodes:
            while not self._frames:
                self._frames = self._framer.feed(await self._reader.read(4096))
            frame = self._frames.pop(0)
            assert frame.opcode == opcode
        return bytes(frame.data)

    def send_frame(self, opcode: int, data: bytes = b"1", *, tagged: bool = False) -> None:
        """Send a frame."""
        self.writer.write(Frame(C2A, opcode, data, tagged).encode())


def perform(play: Callable[[AsyncClient, Controller], Awaitable[None]], **options: Any) -> None:
    """Connect a client without a login and run the test."""

    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, Loop)
        controller = Controller(*await asyncio.open_connection(sock=loop.theirs))
        client = AsyncClient(URL, **options)
        client._core.logged_in = True
        try:
            await client.connect()
            await play(client, controller)
        finally:
            await client.close()
            controller.writer.close()
            with contextlib.suppress(ConnectionError):
                await controller.writer.wait_closed()

    with asyncio.Runner(loop_factory=Loop) as runner:
        runner.run(main())


def test_async_with_logs_in_and_closes() -> None:
    """2/10: the login is the first request."""

    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, Loop)
        controller = Controller(*await asyncio.open_connection(sock=loop.theirs))
        client = AsyncClient(URL, password=PASSWORD)
        entering = asyncio.create_task(client.__aenter__())
        assert await controller.expect(0x01) == b"password"
        controller.send_frame(0x01)
        assert await entering is client
        await client.__aexit__(None, None, None)
        with pytest.raises(LinkLost, match="this client was closed"):
            await client.get_status()
        controller.writer.close()

    with asyncio.Runner(loop_factory=Loop) as runner:
        runner.run(main())


def test_a_failed_login_closes() -> None:
    """The connection is closed after a refused login (4.1/5)."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        login = asyncio.create_task(client.login("wrong"))
        await controller.expect(0x01)
        controller.send_frame(0x01, b"0")
        with pytest.raises(LoginFailed):
            await login
        with pytest.raises(LoginFailed):
            await client.get_status()

    perform(play)


def test_reply_or_timeout() -> None:
    """A missing reply raises an error after 5 s; a slow one is accepted (A-3-15, T/9)."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        began_s = asyncio.get_running_loop().time()
        with pytest.raises(ReplyTimeout):
            await client.get_version()
        assert asyncio.get_running_loop().time() - began_s == pytest.approx(5)
        time = asyncio.create_task(client.get_time())
        await controller.expect(0x08, 0x07)
        for byte in Frame(C2A, 0x07, b"20141222143000").encode():
            controller.writer.write(bytes((byte,)))
            await asyncio.sleep(0.2)
        assert (await time).year == 2014

    perform(play)


def test_the_link_ends_if_a_reply_cannot_be_assigned() -> None:
    """One reply comes for two requests; the client then closes the connection."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        with pytest.raises(ReplyTimeout):
            await client.get_version()
        version = asyncio.create_task(client.get_version())
        await controller.expect(0x08, 0x08)
        controller.writer.write(Frame(C2A, 0x08, b"1.0.0").encode())
        with pytest.raises(ReplyTimeout):
            await version
        with pytest.raises(LinkLost, match="replies to get_version came late"):
            await client.get_status()
        assert await controller._reader.read() == b""

    perform(play)


def test_emergency_stop_interrupts_a_run() -> None:
    """4.17/10, 4.17/9: another task stops the run, whose own final result does not arrive."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        run = asyncio.create_task(client.run_program("a.rob"))
        await controller.expect(0x30)
        controller.send_frame(0x30)
        await asyncio.sleep(3600)
        halt = asyncio.create_task(client.emergency_stop())
        await controller.expect(0x32)
        controller.send_frame(0x32)
        controller.send_frame(0x32, b"11", tagged=True)
        await halt
        with pytest.raises(Interrupted, match="its own result did not arrive"):
            await run

    perform(play)


def test_other_commands_work_while_one_is_pending() -> None:
    """A-4-3; `wait` accepts a timeout and can be repeated; it raises a refusal."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        starting = asyncio.create_task(client.start_reset())
        await controller.expect(0x33)
        controller.send_frame(0x33)
        pending = await starting
        assert (pending.accepted, pending.done) == (True, False)
        with pytest.raises(ReplyTimeout, match="no final result after 10 s"):
            await pending.wait(10)
        controller.send_frame(0x33, b"11", tagged=True)
        await pending.wait()
        starting = asyncio.create_task(client.start_jog("+y"))
        await controller.expect(0x3D)
        controller.send_frame(0x3D, b"0|04")
        pending = await starting
        assert not pending.accepted
        with pytest.raises(Refused, match="04, moving"):
            await pending.wait()
        with pytest.raises(ReplyTimeout):
            await client.start_lock_joints()

    perform(play)


def test_equal_requests_are_serialised() -> None:
    """A second request with the same opcode waits for the reply to the first (3/25)."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        tasks = [asyncio.create_task(client.get_status()) for _ in range(3)]
        for code in (b"00", b"01", b"02"):
            await controller.expect(0x09)
            controller.send_frame(0x09, code)
        assert sorted(status.code for status in await asyncio.gather(*tasks)) == ["00", "01", "02"]

    perform(play)


def test_files_are_transferred(tmp_path: Path) -> None:
    """Upload and download with progress."""
    content, printed = bytes(range(250)) * 2, []
    (tmp_path / "a.rob").write_bytes(content)

    async def play(client: AsyncClient, controller: Controller) -> None:
        upload = asyncio.create_task(
            client.upload(tmp_path / "a.rob", progress=lambda *p: printed.append(p))
        )
        await controller.expect(0x50)
        controller.send_frame(0x50)
        for _ in range(3):
            await controller.expect(0x52)
            controller.send_frame(0x52)
        await upload
        download = asyncio.create_task(client.download("b.rob", tmp_path / "b.rob"))
        await controller.expect(0x54)
        controller.send_frame(0x54)
        for chunk in chunks_of(content):
            controller.send_frame(0x56, FILE_DATA.encode(chunk, DEFAULT))
            assert await controller.expect(0x56) == b"1"
        assert await download == tmp_path / "b.rob"

    perform(play)
    assert printed == [(200, 500), (400, 500), (500, 500)]
    assert (tmp_path / "b.rob").read_bytes() == content


def test_a_cancelled_upload_is_signalled() -> None:
    """L787: a chunk of length 0 in place of the next chunk."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        upload = asyncio.create_task(client.upload_bytes(b"x" * 500, "a.rob"))
        await controller.expect(0x50)
        controller.send_frame(0x50)
        await controller.expect(0x52)
        upload.cancel()
        with pytest.raises(asyncio.CancelledError):
            await upload
        controller.send_frame(0x52)
        assert FILE_DATA.decode(await controller.expect(0x52)).value.length == 0

    perform(play)


def test_transfer_timeout() -> None:
    """Silence after the name ends a download (5.2/9)."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        with pytest.raises(TransferFailed, match="no frame for 30 s"):
            await client.download_bytes("a.rob")
        await controller.expect(0x54)

    perform(play)


def test_session_with_the_virtual_controller(tmp_path: Path) -> None:
    """Over TCP in one process."""

    async def main() -> None:
        plant = Plant(datetime(2014, 12, 22), now_s=0.0)  # noqa: DTZ001 - the document names no zone
        server = Server(ControllerCore(plant, Store()), time_scale=20)
        host, port = await server.listen("127.0.0.1", 0)
        async with AsyncClient(f"tcp://{host}:{port}", password=PASSWORD) as client:
            await client.upload_bytes(b"content", "a.rob")
            assert await client.list_programs() == ("a.rob",)
            assert await client.download("a.rob", tmp_path / "a.rob") == tmp_path / "a.rob"
            jog = await client.start_jog("+x")
            assert (await client.get_status()).state is State.RUNNING
            await client.emergency_stop()
            await jog.wait()
            await client.shutdown()
        await server.close()

    asyncio.run(main())
    assert (tmp_path / "a.rob").read_bytes() == b"content"


def test_link_end_raises_link_lost() -> None:
    """Calls in progress and later calls raise it."""

    async def play(client: AsyncClient, controller: Controller) -> None:
        status = asyncio.create_task(client.get_status())
        await controller.expect(0x09)
        controller.writer.close()
        for call in (status, client.get_version()):
            with pytest.raises(LinkLost, match="closed the connection"):
                await call

    perform(play)


def test_failed_connection_raises_link_lost() -> None:
    """The message contains the address."""

    async def main() -> None:
        with socket.socket() as unused:
            unused.bind(("127.0.0.1", 0))
            url = f"tcp://127.0.0.1:{unused.getsockname()[1]}"
            with pytest.raises(LinkLost, match=f"cannot connect to {url}: "):
                await AsyncClient(url).connect()

    asyncio.run(main())


def test_only_network_links_are_accepted() -> None:
    """The message names the alternative; a call before `connect` asks to connect first."""
    with pytest.raises(UrlError, match="use Client"):
        AsyncClient("serial:///dev/rfcomm0")

    async def main() -> None:
        with pytest.raises(LinkLost, match="call connect"):
            await AsyncClient(URL).get_status()

    asyncio.run(main())
