"""RFCOMM links, with a stand-in for the sockets that only systems with Bluetooth have."""

import socket
from typing import Any

import pytest

from scaraspec.transports.connect import connect
from scaraspec.transports.link import LinkError


@pytest.fixture
def bluetooth(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Lets an RFCOMM socket be one end of a pair; tells what it was asked to connect to."""
    near, far = socket.socketpair()
    asked: dict[str, Any] = {"far": far, "error": None}

    class Socket(socket.socket):
        def __init__(self, *_: int) -> None:
            super().__init__(near.family, near.type, near.proto, near.detach())

        def connect(self, address: Any) -> None:
            asked["address"] = address
            if asked["error"]:
                self.close()
                raise asked["error"]

    monkeypatch.setattr(socket, "AF_BLUETOOTH", 31, raising=False)
    monkeypatch.setattr(socket, "BTPROTO_RFCOMM", 3, raising=False)
    monkeypatch.setattr("scaraspec.transports.rfcomm.socket.socket", Socket)
    return asked


def test_a_link_to_a_channel(bluetooth: dict[str, Any]) -> None:
    """The bytes are those of any other stream (A-2-3)."""
    link = connect("rfcomm://aa:bb:cc:dd:ee:ff/2")
    assert bluetooth["address"] == ("AA:BB:CC:DD:EE:FF", 2)
    link.send(b"ask")
    assert bluetooth["far"].recv(10) == b"ask"
    link.close()
    bluetooth["far"].close()


@pytest.mark.parametrize(
    ("error", "said"),
    [(OSError(112, "Host is down"), "Host is down"), (TimeoutError(), "no answer in 5 s")],
)
def test_a_device_that_does_not_answer_is_told(
    bluetooth: dict[str, Any], error: OSError, said: str
) -> None:
    """One sentence, which names it."""
    bluetooth["error"] = error
    with pytest.raises(LinkError, match=f"cannot connect to rfcomm://AA:.*/1: {said}"):
        connect("rfcomm://aa:bb:cc:dd:ee:ff")
    bluetooth["far"].close()


def test_a_system_without_bluetooth_tells_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    """The device can be bound to a serial port."""
    monkeypatch.delattr(socket, "AF_BLUETOOTH", raising=False)
    with pytest.raises(LinkError, match="offers no Bluetooth sockets; bind the device"):
        connect("rfcomm://aa:bb:cc:dd:ee:ff")
