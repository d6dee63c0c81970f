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
    """The far end of a serial line, and the device's name."""
    master, slave = os.openpty()
    name = os.ttyname(slave)
    os.close(slave)
    yield master, name
    with contextlib.suppress(OSError):  # a test may have closed it
        os.close(master)


def test_bytes_go_both_ways_unchanged(pty: tuple[int, str]) -> None:
    """Raw: no byte means anything to the line."""
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


def test_a_device_that_vanishes_is_the_end(pty: tuple[int, str]) -> None:
    """An adapter is pulled, a Bluetooth line is lost."""
    master, name = pty
    link = connect(f"serial://{name}")
    os.close(master)
    for _ in range(2):
        arrival = link.receive(link.now_s + _SOON_S)
        assert arrival is not None
        assert arrival.content is Ending.CLOSED
    with pytest.raises(LinkError, match="takes no bytes"):
        link.send(b"x")
    link.close()


def test_a_line_has_no_half_and_no_reset(pty: tuple[int, str]) -> None:
    """A reset closes it."""
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
def test_what_is_no_serial_device_is_told(device: str) -> None:
    """One sentence, which names the device."""
    with pytest.raises(LinkError, match=f"cannot open serial://{device}"):
        connect(f"serial://{device}")


def test_without_pyserial_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra is optional."""
    monkeypatch.setitem(sys.modules, "serial", None)
    importlib.invalidate_caches()
    with pytest.raises(LinkError, match=r"pip install 'scaraspec\[serial\]'"):
        connect("serial:///dev/ttyS0")
