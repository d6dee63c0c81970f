"""`scaraspec record` between a client and the virtual controller, with a relay on each side."""

import contextlib
import signal
import socket
from collections import defaultdict
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from scaraspec.cli.demo import session
from scaraspec.client import Client
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.sources.capture import open_capture

PASSWORD = "a-secret-of-this-test"


def address_in(line: str) -> tuple[str, int]:
    """The address at the beginning of a line like ``recording 127.0.0.1:40001 to …``."""
    host, _, port = line.split()[1].rpartition(":")
    return host, int(port)


def streams(file: Path) -> dict[str, dict[Any, bytes]]:
    """The bytes of each connection and direction in a capture, which must have no gap."""
    found: dict[str, dict[Any, bytes]] = defaultdict(lambda: {A2C: b"", C2A: b""})
    for event in open_capture(file, port=None):
        assert event.kind is not Kind.GAP
        if event.kind is Kind.BYTES:
            assert event.offset_bytes == len(found[event.connection][event.direction])
            found[event.connection][event.direction] += event.data
    return found


@pytest.mark.usefixtures("viewer")
@pytest.mark.parametrize("redact", [False, True])
def test_every_byte_is_recorded(
    processes: Any, witness: Callable[..., Any], tmp_path: Path, *, redact: bool
) -> None:
    """The MCAP has the raw bytes that client and controller sent."""
    out = tmp_path / "out"
    controller = processes.controller("--password", PASSWORD)
    options = ["--redact"] if redact else []
    with witness(controller) as far:
        upstream = f"tcp://{far.address[0]}:{far.address[1]}"
        recorder = processes.start(
            "record", upstream, "--listen", "127.0.0.1:0", "--out", str(out), *options
        )
        with (
            witness(address_in(recorder.stdout.readline())) as near,
            Client("tcp://{}:{}".format(*near.address), password=PASSWORD) as robot,
        ):
            now = datetime(2026, 1, 1)  # noqa: DTZ001 - the document names no zone
            session.run(robot, tmp_path, now, lambda _: None)
        recorder.send_signal(signal.SIGINT)
        printed, _ = recorder.communicate(timeout=60)
    assert recorder.returncode == 0, printed
    assert near.seen == far.seen
    ((sent, got),) = near.seen
    (recorded,) = streams(out / "capture.mcap").values()
    secret = PASSWORD.encode()
    expected = bytes(sent).replace(secret, b"*" * len(secret)) if redact else bytes(sent)
    assert recorded == {A2C: expected, C2A: bytes(got)}
    assert f"from the client: {len(sent)} bytes received and forwarded = {len(sent)} rec" in printed
    assert secret not in (out / "capture.rrd").read_bytes()


@pytest.mark.parametrize("there", [False, True])
def test_a_capture_without_a_complete_frame(processes: Any, tmp_path: Path, *, there: bool) -> None:
    """A capture without a complete frame is not conformant, whether a controller answered or
    not."""
    with socket.create_server(("127.0.0.1", 0)) as robot:
        where = "tcp://{}:{}".format(*robot.getsockname())
        if not there:
            robot.close()
        recorder = processes.start(
            "record", where, "--listen", "127.0.0.1:0", "--out", str(tmp_path)
        )
        listening = address_in(recorder.stdout.readline())
        with (
            contextlib.suppress(ConnectionResetError),  # also before the connection is reported
            socket.create_connection(listening, 10) as client,
        ):
            if there:
                half = b"\xaa\x01\x09pass"
                client.sendall(half)
                reached, _ = robot.accept()
                with reached:
                    assert reached.recv(len(half), socket.MSG_WAITALL) == half
            assert client.recv(1) == b""
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=60)
    done = processes.run("audit", str(tmp_path / "capture.mcap"))
    assert done.returncode == 4, done.stdout + done.stderr
    assert "nothing tested" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("http://127.0.0.1",), "http"),
        (("tcp://127.0.0.1", "--listen", "nowhere"), "nowhere"),
        (("tcp://127.0.0.1", "--listen", "192.0.2.1:8877"), "cannot record"),
    ],
)
def test_usage(
    refused: Callable[..., str], tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    """User errors are reported."""
    assert message in refused("record", *arguments, "--out", str(tmp_path))
