"""The numbers of packets in which the bytes of a stream are."""

import pytest

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.report import packet_index
from scaraspec.report.packet_index import PacketIndex
from scaraspec.traffic.wire import Kind, WireEvent, WireRange


def add(index: PacketIndex, packet: int, offset_bytes: int) -> None:
    """Add ten bytes of the client."""
    event = WireEvent(0, "1", A2C, Kind.BYTES, bytes(10), offset_bytes, packet=packet)
    index.add(event)


def at(offset_bytes: int) -> WireRange:
    """A byte that the client sent."""
    return WireRange("1", A2C, offset_bytes, 1, 0)


def test_a_byte_is_in_its_packet() -> None:
    """The packet that begins at it or before it."""
    index = PacketIndex()
    for packet, offset_bytes in ((4, 0), (9, 10), (12, 20)):
        add(index, packet, offset_bytes)
    assert [index.find(at(n)) for n in (0, 9, 10, 25)] == [4, 4, 9, 12]
    assert index.find(at(0)._replace(direction=C2A)) == 0


def test_a_name_is_used_again() -> None:
    """The index has the last connection of a name."""
    index = PacketIndex()
    add(index, 4, 0)
    index.add(WireEvent(0, "1", A2C, Kind.OPENED, packet=7))
    assert index.find(at(0)) == 0


def test_old_entries_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """A long capture has numbers for recent bytes."""
    monkeypatch.setattr(packet_index, "_MAX_ENTRIES", 8)
    index = PacketIndex()
    for number in range(100):
        add(index, number + 1, 10 * number)
    assert index.find(at(990)) == 100
    assert index.find(at(0)) == 0
