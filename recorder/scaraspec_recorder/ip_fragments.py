"""Combines the fragments of IP packets, with bounded memory."""

from typing import Final, NamedTuple

_MAX_PACKETS: Final = 64  # incomplete ones; if there are more, the oldest one is dropped
_MAX_PACKET_BYTES: Final = 1 << 16


class FragmentPosition(NamedTuple):
    """Which part of which packet a fragment is.

    Attributes:
        packet: Identifies the packet: sender, receiver and the number that the sender gave it.
        offset_bytes: Offset of the fragment in the payload of the packet.
        more: Whether further fragments follow.
    """

    packet: tuple[bytes, bytes, int]
    offset_bytes: int
    more: bool


class _Packet:
    def __init__(self) -> None:
        self.size_bytes: int | None = None
        self.parts: dict[int, bytes] = {}  # by offset

    def payload(self) -> bytes | None:
        """Return the payload if no part is missing."""
        whole = b""
        for offset, part in sorted(self.parts.items()):
            if offset > len(whole):
                return None
            whole += part[len(whole) - offset :]
        return whole if len(whole) == self.size_bytes else None


class FragmentBuffer:
    """The incomplete packets of a capture.

    Attributes:
        dropped: Number of packets that were dropped because a part is missing.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._packets: dict[tuple[bytes, bytes, int], _Packet] = {}

    @property
    def incomplete(self) -> int:
        """Number of packets of which a part is missing so far."""
        return self.dropped + len(self._packets)

    def add(self, position: FragmentPosition, data: bytes) -> bytes | None:
        """Add a fragment. Return the payload of its packet if it is complete now.

        If a fragment is repeated, the first copy is used.
        """
        packet = self._packets.get(position.packet)
        if packet is None:
            if len(self._packets) >= _MAX_PACKETS:
                self._packets.pop(next(iter(self._packets)))
                self.dropped += 1
            packet = self._packets[position.packet] = _Packet()
        end = position.offset_bytes + len(data)
        if end <= _MAX_PACKET_BYTES:
            packet.parts.setdefault(position.offset_bytes, data)
            if not position.more:
                packet.size_bytes = end
        payload = packet.payload()
        if payload is not None:
            del self._packets[position.packet]
        return payload
