"""Serial links over a pty."""

import contextlib
import importlib
import os
import sys
from collections.abc import Iterator

import pytest

from scaraspec.transports.connect import connect
from scaraspec.transports.link import Ending, LinkError

_SOON_S = 5.0


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    """Return the file descriptor of the peer, and the device name of the serial line."""
    master, slave = os.openpty()
    name = os.ttyname(slave)
    os.close(slave)
    yield master, name
    with contextlib.suppress(OSError):  # a test may have closed it
        os.close(master)


def test_send_and_receive_all_bytes(pty: tuple[int, str]) -> None:
    """The line is raw: every byte value is transmitted unchanged."""
    master, name = pty
    every = bytes(range(256))
    link = connect(f"serial://{name}?baud=9600")
    link.send(every)
    assert os.read(master, 300) == every
    os.write(master, every)
    received = b""
    while len(received) < len(every):
        arrival = link.receive(link.now_s + _SOON_S)
        assert arrival is not None
        assert isinstance(arrival.content, bytes)
        received += arrival.content
    assert received == every
    assert link.receive(link.now_s) is None
    link.close()


def test_removed_device_ends_the_link(pty: tuple[int, str]) -> None:
    """An adapter is unplugged, or a Bluetooth connection is lost."""
    master, name = pty
    link = connect(f"serial://{name}")
    os.close(master)
    for _ in range(2):
        arrival = link.receive(link.now_s + _SOON_S)
        assert arrival is not None
        assert arrival.content is Ending.CLOSED
    with pytest.raises(LinkError, match="cannot write to the serial line"):
        link.send(b"x")
    link.close()


def test_half_close_and_reset(pty: tuple[int, str]) -> None:
    """A serial line cannot be half-closed; a reset closes it."""
    _, name = pty
    link = connect(f"serial://{name}")
    with pytest.raises(LinkError, match="cannot be half closed"):
        link.half_close()
    link.reset()
    with pytest.raises(LinkError, match="has been closed"):
        link.send(b"x")
    with pytest.raises(LinkError, match="has been closed"):
        link.receive(0.0)


@pytest.mark.parametrize("device", ["/dev/there-is-none", "/dev/null", "/etc/passwd"])
def test_invalid_device(device: str) -> None:
    """The error message contains the device."""
    with pytest.raises(LinkError, match=f"cannot open serial://{device}"):
        connect(f"serial://{device}")


def test_missing_pyserial(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error message states how to install the optional extra."""
    monkeypatch.setitem(sys.modules, "serial", None)
    importlib.invalidate_caches()
    with pytest.raises(LinkError, match=r"pip install 'scaraspec\[serial\]'"):
        connect("serial:///dev/ttyS0")
