"""The serial port over a pty: no login, masked by the network, and opened again after a loss."""

import asyncio
import contextlib
import errno
import os
from collections.abc import Awaitable, Callable
from datetime import datetime
from pathlib import Path

import pytest

from scaraspec.protocol.readings import Dialect
from scaraspec.virtual_controller import serial_port
from scaraspec.virtual_controller import server as server_module
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.serial_port import SerialPort, SerialPortError
from scaraspec.virtual_controller.server import Server
from scaraspec.virtual_controller.store import Store

_STATUS = b"\xaa\x09\x00\xcc"
_IDLE = b"\xcc\x09\x0200\xaa"


async def _until(holds: Callable[[], bool]) -> None:
    """Run the loop until the condition is true."""
    while not holds():  # noqa: ASYNC110 - no event reports the condition
        await asyncio.sleep(0)


async def _read(line: int, size: int) -> bytes:
    """Read `size` bytes from the other end."""
    os.set_blocking(line, False)
    data = b""
    while len(data) < size:
        try:
            data += os.read(line, size - len(data))
        except BlockingIOError:
            await asyncio.sleep(0)
    return data


def _run(test: Callable[[Server], Awaitable[None]], **readings: str) -> None:
    async def main() -> None:
        plant = Plant(datetime(2020, 1, 1), now_s=0.0)  # noqa: DTZ001 - the document names no zone
        server = Server(ControllerCore(plant, Store(), Dialect.of(**readings)))
        try:
            async with asyncio.timeout(10):
                await test(server)
        finally:
            server.stop()
            await server.close()

    asyncio.run(main())


def test_a_serial_client_is_served_without_login_unless_masked() -> None:
    """L81, L83: silence while a network client is connected."""

    async def test(server: Server) -> None:
        output: list[bytes] = []
        serve = server.receive

        def receive(connection: int, data: bytes) -> None:
            output.append(data)
            serve(connection, data)

        server.receive = receive  # type: ignore[method-assign] # a witness of what arrives
        master, slave = os.openpty()
        SerialPort(server, os.ttyname(slave), 115200)
        os.close(slave)
        os.write(master, _STATUS)
        assert await _read(master, 6) == _IDLE
        _, writer = await asyncio.open_connection(*await server.listen("127.0.0.1", 0))
        await _until(lambda: len(server.core.sessions) == 2)
        os.write(master, _STATUS)
        await _until(lambda: b"".join(output) == _STATUS * 2)
        writer.close()
        await _until(lambda: len(server.core.sessions) == 1)
        os.write(master, b"\xaa\x08\x00\xcc")
        assert await _read(master, 9) == b"\xcc\x08\x051.0.0\xaa"
        os.close(master)

    _run(test)


def test_a_slow_reader_delays_requests_and_loses_no_reply() -> None:
    """A client that reads late gets all replies, also with any bytes in names."""

    async def test(server: Server) -> None:
        master, slave = os.openpty()
        port = SerialPort(server, os.ttyname(slave), 115200)
        os.close(slave)
        name = bytes(byte for byte in range(1, 256) if chr(byte) not in "/\\|")[:200]
        server.core.store.write(name, b"x")
        for number in range(900):
            server.core.store.write(b"\xff" * 20 + b"%03d" % number, b"x")
        os.set_blocking(master, False)
        os.write(master, b"\xaa\x0b\x00\xcc" * 50 + _STATUS)
        await _until(lambda: len(port._unsent) > 64 * 1024)
        received = b""
        while not received.endswith(_IDLE):
            received += await _read(master, 1)
            with contextlib.suppress(BlockingIOError):
                received += os.read(master, 65536)
        assert received.count(name) == 50
        assert received.count(b"|" + b"\xff" * 20) == 50 * 900
        os.close(master)

    _run(test)


def test_a_line_waits_if_the_server_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit of clients also applies to it."""
    monkeypatch.setattr(server_module, "MAX_CLIENTS", 1)
    monkeypatch.setattr(serial_port, "REOPEN_S", 0.001)

    async def test(server: Server) -> None:
        address = await server.listen("127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(*address)
        writer.write(b"\xaa\x01\x08password\xcc")
        await reader.readexactly(5)
        master, slave = os.openpty()
        SerialPort(server, os.ttyname(slave), 115200)
        os.close(slave)
        assert len(server.core.sessions) == 1
        writer.close()
        os.write(master, _STATUS)
        assert await _read(master, 6) == _IDLE
        os.close(master)

    _run(test)


def test_a_failing_line_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of reading or writing closes it; an empty read does not."""

    async def test(server: Server) -> None:
        master, slave = os.openpty()
        port = SerialPort(server, os.ttyname(slave), 115200)
        port._read()
        assert len(server.core.sessions) == 1
        os.close(master)
        port.send(b"x")
        assert not server.core.sessions
        os.close(slave)
        master, slave = os.openpty()
        port = SerialPort(server, os.ttyname(slave), 115200)

        def fail(_line: int, _size: int) -> bytes:
            raise OSError(errno.EIO, "Input/output error")

        with monkeypatch.context() as patch:
            patch.setattr(os, "read", fail)
            port._read()
        assert list(server.core.sessions) == [3]  # the device exists, so it is opened again
        os.close(slave)
        os.close(master)

    _run(test)


def test_a_closed_session_starts_again() -> None:
    """A line has no end of a connection: the next request starts a new session."""

    async def test(server: Server) -> None:
        master, slave = os.openpty()
        SerialPort(server, os.ttyname(slave), 115200)
        os.close(slave)
        os.write(master, b"\xaa\x02\x00\xcc")
        await _until(lambda: 2 in server.core.sessions)
        os.write(master, _STATUS)
        assert await _read(master, 6) == _IDLE
        os.close(master)

    _run(test, on_unknown="close")


def test_a_lost_line_is_opened_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bluetooth lines may disappear; a jog over such a line ends."""
    monkeypatch.setattr(serial_port, "REOPEN_S", 0.001)
    device = tmp_path / "rfcomm0"
    failures: list[SerialPortError] = []

    def open_line(device: str, baud: int) -> int:
        try:
            return serial_port_open_line(device, baud)
        except SerialPortError as error:
            failures.append(error)
            raise

    serial_port_open_line = serial_port.open_line
    monkeypatch.setattr(serial_port, "open_line", open_line)

    async def test(server: Server) -> None:
        master, slave = os.openpty()
        device.symlink_to(os.ttyname(slave))
        SerialPort(server, str(device), 115200)
        os.write(master, b"\xaa\x3d\x011\xcc")
        assert await _read(master, 5) == b"\xcc\x3d\x011\xaa"
        device.unlink()
        os.close(slave)
        os.close(master)
        await _until(lambda: not server.core.sessions)
        assert server.core.robot.status == "00"
        await _until(lambda: len(failures) >= 3)
        master, slave = os.openpty()
        device.symlink_to(os.ttyname(slave))
        await _until(lambda: bool(server.core.sessions))
        os.write(master, _STATUS)
        assert await _read(master, 6) == _IDLE
        os.close(slave)
        os.close(master)

    _run(test)


def test_shutdown_over_the_line_answers_and_ends_serving() -> None:
    """4.35 over Bluetooth."""

    async def test(server: Server) -> None:
        master, slave = os.openpty()
        SerialPort(server, os.ttyname(slave), 115200)
        os.write(master, b"\xaa\x60\x00\xcc")
        assert await _read(master, 5) == b"\xcc\x60\x011\xaa"
        await server.stopped.wait()
        assert not server._endpoints
        os.close(slave)
        os.close(master)

    _run(test)


@pytest.mark.parametrize(
    ("device", "baud", "reported"),
    [
        ("/dev/there-is-none", 115200, "/dev/there-is-none cannot be opened: No such file"),
        ("/dev/null", 115200, "/dev/null is not a serial device: "),
        ("/dev/ttyS0", 12345, "/dev/ttyS0 does not support 12345 baud: try 115200"),
    ],
)
def test_an_unusable_device_is_an_error(device: str, baud: int, reported: str) -> None:
    """One sentence, which names the device."""

    async def test(server: Server) -> None:
        with pytest.raises(SerialPortError, match=reported):
            SerialPort(server, device, baud)

    _run(test)
