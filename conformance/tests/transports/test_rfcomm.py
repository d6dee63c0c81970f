"""RFCOMM links, with a replacement for Bluetooth sockets, which not every system has."""

import socket
from typing import Any

import pytest

from scaraspec.transports.connect import connect
from scaraspec.transports.link import LinkError


@pytest.fixture
def bluetooth(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replace RFCOMM sockets by one side of a socket pair; record the address of `connect`."""
    near, far = socket.socketpair()
    state: dict[str, Any] = {"far": far, "error": None}

    class Socket(socket.socket):
        def __init__(self, *_: int) -> None:
            super().__init__(near.family, near.type, near.proto, near.detach())

        def connect(self, address: Any) -> None:
            state["address"] = address
            if state["error"]:
                self.close()
                raise state["error"]

    monkeypatch.setattr(socket, "AF_BLUETOOTH", 31, raising=False)
    monkeypatch.setattr(socket, "BTPROTO_RFCOMM", 3, raising=False)
    monkeypatch.setattr("scaraspec.transports.rfcomm.socket.socket", Socket)
    return state


def test_connect_to_a_channel(bluetooth: dict[str, Any]) -> None:
    """An RFCOMM link transmits the same byte stream as other links (A-2-3)."""
    link = connect("rfcomm://aa:bb:cc:dd:ee:ff/2")
    assert bluetooth["address"] == ("AA:BB:CC:DD:EE:FF", 2)
    link.send(b"ask")
    assert bluetooth["far"].recv(10) == b"ask"
    link.close()
    bluetooth["far"].close()


@pytest.mark.parametrize(
    ("error", "reason"),
    [(OSError(112, "Host is down"), "Host is down"), (TimeoutError(), "no response within 5 s")],
)
def test_device_does_not_respond(bluetooth: dict[str, Any], error: OSError, reason: str) -> None:
    """The error message contains the device and the reason."""
    bluetooth["error"] = error
    with pytest.raises(LinkError, match=f"cannot connect to rfcomm://AA:.*/1: {reason}"):
        connect("rfcomm://aa:bb:cc:dd:ee:ff")
    bluetooth["far"].close()


def test_system_without_bluetooth(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error message states how to bind the device to a serial port."""
    monkeypatch.delattr(socket, "AF_BLUETOOTH", raising=False)
    with pytest.raises(LinkError, match="has no Bluetooth sockets; bind the device"):
        connect("rfcomm://aa:bb:cc:dd:ee:ff")
